"""The only door to ground truth: it leads into a file that evaluation alone opens.

`tests/architecture/test_truth.py` lists the callers of `SimulatedWorld.truth` and searches bags and
topics for what it returns.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.tasks.task import Ending, Task
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.world import SimulatedWorld, Truth
from samrl_core.common.errors import InputError
from samrl_core.common.files import append_line
from samrl_core.common.text_files import parse_json, read_text


class TruthLog:
    """Appends one JSON line per event; flushed at once, so that a killed process loses nothing."""

    def __init__(self, path: Path, world: SimulatedWorld) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        self._world = world

    def record(self, episode: int, seed: int, event: str) -> None:
        """Write the truth of this instant. `event` is "start" or "end"."""
        truth = self._world.truth()
        line = {
            "episode": episode,
            "seed": seed,
            "event": event,
            "stamp_ns": truth.stamp_ns,
            "body_position": {k: v.tolist() for k, v in truth.body_position.items()},
            "body_quat_xyzw": {k: v.tolist() for k, v in truth.body_quat_xyzw.items()},
            "body_speed": truth.body_speed,
            "body_peak_height": truth.body_peak_height,
            "tip_position": truth.tip_position.tolist(),
            "chain_points": truth.chain_points.tolist(),
            "first_contact_ns": truth.first_contact_ns,
            "peak_contact_force": truth.peak_contact_force,
        }
        append_line(self._path, json.dumps(line), outlives_power=False)


def read_truth(path: Path) -> dict[int, dict[str, dict[str, Any]]]:
    """Truth per episode and event.

    Raises:
        InputError: the file is missing or damaged.
    """
    if not path.is_file():
        raise InputError(f"no evaluation file at {path}; it is written by the simulated world's bridge alone")
    episodes: dict[int, dict[str, dict[str, Any]]] = {}
    for number, line in enumerate(read_text(path, "the truth").splitlines(), 1):
        if line.strip():
            entry = parse_json(line, f"{path}, line {number}")
            try:
                episodes.setdefault(entry["episode"], {})[entry["event"]] = entry
            except (KeyError, TypeError) as error:
                raise InputError(f"{path}, line {number} is no event of an episode: {error!r}") from error
    return episodes


def ending_of(entry: dict[str, Any]) -> Ending:
    """Input of `Task.succeeded`, from an entry of `read_truth`."""
    return Ending(
        {
            k: Pose(np.array(v), np.array(entry["body_quat_xyzw"][k]))
            for k, v in entry["body_position"].items()
        },
        dict(entry["body_speed"]),
        dict(entry["body_peak_height"]),
        np.array(entry["tip_position"]),
        np.array(entry["chain_points"], dtype=np.float64).reshape(-1, 3),
        float(entry["peak_contact_force"]),
    )


def ending_now(truth: Truth) -> Ending:
    """Input of `Task.succeeded`, if the episode ended at this instant."""
    return Ending(
        _bodies(truth),
        dict(truth.body_speed),
        dict(truth.body_peak_height),
        truth.tip_position,
        truth.chain_points,
        truth.peak_contact_force,
    )


def true_values(task: Task, truth: Truth) -> np.ndarray:
    """The task's parameters (P,) as they really are at this instant."""
    return task.values_from_truth(_bodies(truth), truth.chain_points)


def chain_angles_of(task: Task, ending: Ending) -> np.ndarray:
    """Angles (2 K,) [rad] of the chain that hangs from the tool as an episode ended, for a photograph."""
    return task.chain_angles(task.values_from_truth(ending.body_in_world, ending.chain_points))


def _bodies(truth: Truth) -> dict[str, Pose]:
    return {k: Pose(v, truth.body_quat_xyzw[k]) for k, v in truth.body_position.items()}


@dataclass(frozen=True)
class TrueOutcome:
    """Metrics of the true state at one instant, without that state."""

    success: bool
    final_error: float  # [m]
    reward: float  # of the paper, for the learners that it compares with [m]
    peak_force: float  # largest normal force on the tool in this episode [N]


def evaluate_now(world: SimulatedWorld, task: Task) -> TrueOutcome:
    """Metrics of the episode if it ended now: rewards of the learners that are compared."""
    ending = ending_now(world.truth())
    return TrueOutcome(
        task.succeeded(ending),
        task.final_error(ending),
        task.shaped_reward(ending),
        ending.peak_contact_force,
    )
