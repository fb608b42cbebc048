"""What a run came to: the bag and the evaluation file become `summary.json`.

This is evaluation: the only place, besides the tests, that reads ground truth.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.instance.cell_instance import FILE, read_instance_file
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.world.evaluation import ending_of, read_truth
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.common.statistics import wilson_interval
from samrl_core.common.version import samrl_version
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.cell.incidents import Incident
from samrl_ros.contract.outcomes import is_given_up
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions.from_message import operator_judgement, stamp_ns

STATE, TARGET = cell_topic("model_updater/state"), cell_topic("view_planner/target")
OUTCOME, READY = cell_topic("supervisor/outcome"), cell_topic("sim_bridge/ready")
EXECUTED = cell_topic("manipulator/executed_action")
JUDGEMENT = cell_topic("operator/judgement")
STATUS = tuple(arm_topic(role, "motion_status") for role in ROLES)


def summarise(
    folder: Path,
    task: Task,
    settings: dict[str, Any],
    wall_time_s: dict[int, float],
    marks: Mapping[int, Iterable[tuple[float, str]]],
    error: str = "",
    incidents: Sequence[Incident] = (),
) -> dict[str, Any]:
    """Read `folder/bag` and `folder/evaluation/truth.jsonl` and join them per episode.

    Args:
        folder: the run's folder.
        task: for its definition of success.
        settings: what was asked for, recorded as it is.
        wall_time_s: wall time per finished episode [s].
        marks: per episode, when by the wall clock each of its phases began: seconds since it was laid out,
            and a mark of the topic `phase`, or "move" when the action was known.
        error: why the run ended early, empty when it did not.
        incidents: stops, restarts and the like, as they came.

    Raises:
        InputError: a run that did not end early has no readable bag.
    """
    try:
        messages, timing = _by_episode(folder / "bag"), _timing(folder / "bag")
    except InputError as unreadable:
        if not error:
            raise
        # A run that recorded nothing still has its error.
        error, messages, timing = f"{error}; no figures: {unreadable}", {}, _timing_of([], [], [])
    truth_file = folder / "evaluation" / "truth.jsonl"
    truth = read_truth(truth_file) if truth_file.is_file() else {}
    sealed = truth_file.with_name(FILE)
    cell_instance = read_instance_file(sealed)["name"] if sealed.is_file() else None
    episodes: list[dict[str, Any]] = [
        _episode(number, topics, truth.get(number, {}), task, wall_time_s.get(number, float("nan")))
        | {"marks": [[round(s, 4), what] for s, what in marks.get(number, ())]}
        for number, topics in sorted(messages.items())
        if topics[OUTCOME]
    ]
    judged_by = "truth" if truth else _take_judgements(folder / "bag", episodes) if episodes else None
    judged = [bool(e["success"]) for e in episodes if e["success"] is not None]
    return {
        "schema": 1,
        "task": task.name,
        "version": samrl_version(),
        "settings": settings,
        "cell_instance": cell_instance,
        "error": error,
        "given_up": sum(is_given_up(e["reason"]) for e in episodes),
        "incidents": [asdict(one) for one in incidents],
        "successes": sum(judged),
        "judged": len(judged),  # episodes; of the others nobody knows whether they succeeded
        "judged_by": judged_by,
        "success_rate_wilson95": wilson_interval(sum(judged), len(judged)),
        "detector": _detector(episodes),
        "timing": timing,
        "median_hole_error_before_contact_m": _median(
            [e["estimate_error_before_contact_m"] for e in episodes]
        ),
        "episodes": episodes,
    }


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write whole or not at all; a number that is not finite becomes null, as JSON has none."""
    write_whole(path, json.dumps(_plain(data), indent=1, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(float(value)) else None
    return value.item() if isinstance(value, np.generic) else value


def _take_judgements(bag_path: Path, episodes: list[dict[str, Any]]) -> str | None:
    """Enter what the operator of a real cell said of each episode; "operator" if there was a word."""
    said = {}
    for _, message in open_bag(bag_path).decoded((JUDGEMENT,)):
        with suppress(InputError):  # a message of another node, which judges nothing
            episode, success = operator_judgement(message.data)
            said[episode] = success
    for one in episodes:
        one["success"] = said.get(one["episode"])
    return "operator" if said else None


def _median(values: list[float]) -> float:
    finite = [v for v in values if math.isfinite(v)]
    return float(np.median(finite)) if finite else float("nan")


def _by_episode(bag_path: Path) -> dict[int, dict[str, list[Any]]]:
    topics = (STATE, TARGET, OUTCOME, READY, EXECUTED, *STATUS)
    episodes: dict[int, dict[str, list[Any]]] = defaultdict(lambda: {t: [] for t in topics})
    for record, message in open_bag(bag_path).decoded(topics):
        episodes[int(message.episode)][record.topic].append(message)
    return episodes


def _timing(bag_path: Path) -> dict[str, float]:
    """Pace of the simulation as its bridge reported it, and the rate of joint states in simulated time."""
    factors, gaps, stamps = [], [], []
    joints = arm_topic(ROLES[0], "joint_states")
    bag = open_bag(bag_path)
    for _, message in bag.decoded(("/diagnostics",)):
        for status in message.status:
            if status.name.endswith("/sim_bridge"):
                values_by_name = {v.key: v.value for v in status.values}
                factors.append(float(values_by_name.get("real_time_factor", "nan")))
                gaps.append(float(values_by_name.get("longest_gap_s", "nan")))
    for record in bag.messages((joints,)):
        stamps.append(header_stamp_ns(record.type, record.data) or 0)  # the header alone: there are many
    return _timing_of(factors, gaps, stamps)


def _timing_of(factors: list[float], gaps: list[float], stamps: list[int]) -> dict[str, float]:
    periods = np.diff(np.array(sorted(stamps), dtype=np.int64)) * 1e-9
    moving = [f for f in factors if math.isfinite(f) and f > 0]
    return {
        "real_time_factor_median": float(np.median(moving)) if moving else float("nan"),
        "longest_wall_gap_s": max((g for g in gaps if math.isfinite(g)), default=float("nan")),
        "joint_state_hz_median": float(1.0 / np.median(periods)) if periods.size else float("nan"),
        "joint_state_period_p99_s": float(np.quantile(periods, 0.99)) if periods.size else float("nan"),
    }


def _episode(
    number: int, topics: dict[str, list[Any]], truth: dict[str, dict[str, Any]], task: Task, wall_s: float
) -> dict[str, Any]:
    outcome = topics[OUTCOME][-1]
    states = topics[STATE]
    start_ns = stamp_ns(topics[READY][0]) if topics[READY] else stamp_ns(outcome)
    last = states[-1] if states else None
    summary: dict[str, Any] = {
        "episode": number,
        "detected_success": bool(outcome.detected_success),
        "actions": int(outcome.actions),
        "reason": outcome.reason,
        "wall_time_s": wall_s,
        "sim_time_s": (stamp_ns(outcome) - start_ns) * 1e-9,
        "estimate": dict(zip(last.names, last.values, strict=True)) if last else {},
        "estimate_sigma_m": float(outcome.estimate_error_bound),
        "updates": [_update(s) for s in states],
        "views": [_view(v) for v in topics[TARGET]],
        "tracking_error_rad": max(
            (m.tracking_error for t in STATUS for m in topics[t]), default=float("nan")
        ),
    }
    summary.update(_evaluate(truth, states, task))
    return summary


def _evaluate(truth: dict[str, dict[str, Any]], states: list[Any], task: Task) -> dict[str, Any]:
    """What only ground truth can tell."""
    if "end" not in truth:
        keys = ("final_error_m", "estimate_error_before_contact_m", "peak_contact_force_N")
        return {"seed": None, "success": None, **dict.fromkeys(keys, float("nan"))}
    end = truth["end"]
    ending = ending_of(end)
    contact_ns = end["first_contact_ns"]
    before = [s for s in states if contact_ns < 0 or stamp_ns(s) < contact_ns]
    error = float("nan")
    if before and task.stands_still:
        poses = task.body_poses(np.array(before[-1].values))
        start = truth["start"]["body_position"]
        error = max(
            (float(np.linalg.norm(p.position - np.array(start[k]))) for k, p in poses.items()),
            default=float("nan"),  # the parameters move no body
        )
    return {
        "seed": end["seed"],
        "success": task.succeeded(ending),
        "final_error_m": task.final_error(ending),
        "estimate_error_before_contact_m": error,
        "peak_contact_force_N": end["peak_contact_force"],
    }


def _update(state: Any) -> dict[str, Any]:
    return {
        "step": int(state.step),
        "loss_before": state.loss_before,
        "loss_after": state.loss_after,
        "iterations": int(state.iterations),
        "why_stopped": state.why_stopped,
        "values": list(state.values),
    }


def _view(view: Any) -> dict[str, Any]:
    p = view.camera_in_world.position
    return {
        "step": int(view.step),
        "move": bool(view.move),
        "camera_position_m": [p.x, p.y, p.z],
        "score": view.score,
        "present_score": view.present_score,
        "visibility": view.visibility,
        "reason": view.reason,
    }


def _detector(episodes: list[dict[str, Any]]) -> dict[str, int]:
    """Confusion of the automatic termination against evaluation truth."""
    evaluated = [
        (bool(e["detected_success"]), bool(e["success"])) for e in episodes if e["success"] is not None
    ]
    return {
        "true_positive": evaluated.count((True, True)),
        "false_positive": evaluated.count((True, False)),
        "false_negative": evaluated.count((False, True)),
        "true_negative": evaluated.count((False, False)),
    }
