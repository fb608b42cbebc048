"""Where the time of an action goes, from the bags of runs: updating, looking for a view, acting, moving."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from rich.console import Console
from rich.table import Table

from samrl_core.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.exit_codes import OK
from samrl_ros.summary import write_json
from samrl_ros.topics import arm_topic, cell_topic

GOAL_S = 2.0  # an action with all its updates should take no longer [s]
REQUEST, EXECUTED = cell_topic("supervisor/request"), cell_topic("manipulator/executed_action")
# The part that the time until a message of this topic belongs to. Motions of either arm are one part.
PART_OF = {
    cell_topic("model_updater/state"): "update",
    cell_topic("view_planner/target"): "view",
    cell_topic("view_planner/nominal_action"): "act",
    arm_topic("camera_arm", "motion_status"): "move",
    EXECUTED: "move",
}
PARTS = ("update", "view", "act", "move")


@dataclass(frozen=True)
class ActionTime:
    """One action: from the request for its first update until it is executed."""

    episode: int
    step: int
    seconds: dict[str, float]  # by part, of simulated time [s]

    @property
    def total(self) -> float:
        """Of all parts [s]."""
        return sum(self.seconds.values())


def action_times(events: Iterable[tuple[float, str, Any]]) -> Iterator[ActionTime]:
    """Attributes all the time between an action's first request and its end to the part that it ends.

    Args:
        events: time [s], topic and message, in order of time; topics other than the above are left out.
    """
    under_way: tuple[int, int] | None = None  # episode and step
    last = 0.0
    seconds: dict[str, float] = {}
    for now, topic, message in events:
        key = int(message.episode), int(message.step)
        if topic == REQUEST and key != under_way:
            under_way, last = key, now
            seconds = dict[str, float].fromkeys(PARTS, 0.0)
        elif topic in PART_OF and key == under_way:
            seconds[PART_OF[topic]] += now - last
            last = now
            if topic == EXECUTED:
                yield ActionTime(*key, seconds)


def bench_actions(runs: Sequence[Path], out: Path) -> int:
    """Read finished runs of `samrl cell`, print a table, write JSON and picture; returns the exit code.

    Raises:
        InputError: a folder holds no finished run, or none of its actions.
    """
    rows = {str(run): _figures(run) for run in runs}
    report = {"schema": 1, "goal_s": GOAL_S, "runs": rows}
    write_json(out / "time_per_action.json", report)
    _draw(rows, out / "time_per_action.png")
    _print(rows)
    return OK


def _figures(run: Path) -> dict[str, Any]:
    try:
        summary = json.loads((run / "summary.json").read_text())
        # The bag's clock is the simulation's; how much slower it went is known per episode.
        slower = {e["episode"]: e["wall_time_s"] / e["sim_time_s"] for e in summary["episodes"]}
        named = {k: str(summary["settings"][k]) for k in ("task", "policy", "strategy")}
    except (OSError, ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise InputError(
            f"{run} has no summary of a finished run ({error}); run `samrl cell` there"
        ) from error
    messages = open_bag(run / "bag").decoded((REQUEST, *PART_OF))
    times = list(action_times((r.log_time_ns * 1e-9, r.topic, m) for r, m in messages))
    times = [t for t in times if t.episode in slower]
    if not times:
        raise InputError(f"{run} holds no executed action; take another run")
    wall = np.array([t.total * slower[t.episode] for t in times])
    return {
        **named,
        "episodes": len(slower),
        "actions": len(times),
        "real_time_factor": float(np.median([1.0 / s for s in slower.values()])),
        "wall_s": {
            "mean": float(wall.mean()),
            "p50": float(np.median(wall)),
            "p90": float(np.quantile(wall, 0.9)),
            "max": float(wall.max()),
            "share_within_goal": float(np.mean(wall <= GOAL_S)),
        },
        "mean_wall_s": {p: float(np.mean([t.seconds[p] * slower[t.episode] for t in times])) for p in PARTS},
        "mean_simulated_s": {p: float(np.mean([t.seconds[p] for t in times])) for p in PARTS},
    }


def _draw(rows: dict[str, dict[str, Any]], path: Path) -> None:
    figure, axis = plt.subplots(figsize=(8, 1.4 + 0.6 * len(rows)), layout="constrained")
    left = np.zeros(len(rows))
    for part in PARTS:
        width = np.array([row["mean_wall_s"][part] for row in rows.values()])
        axis.barh(range(len(rows)), width, left=left, label=part)
        left += width
    ends = [row["wall_s"]["p90"] for row in rows.values()]
    axis.plot(ends, range(len(rows)), "k|", markersize=14, label="90 % of all actions")
    axis.axvline(GOAL_S, color="0.5", linestyle=":", label="goal")
    names = [f"{r['task']}, {r['policy']}, {r['strategy']}".replace("_", " ") for r in rows.values()]
    axis.set_yticks(range(len(rows)), names)
    axis.set(xlabel="wall time of an action [s], mean", xlim=(0.0, None))
    axis.legend(fontsize=8, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _print(rows: dict[str, dict[str, Any]]) -> None:
    table = Table(title=r"wall time of an action \[s]")
    for column in ("run", "actions", *PARTS, "mean", "p90", "max", "speed"):
        table.add_column(column, justify="left" if column == "run" else "right")
    for name, row in rows.items():
        parts = [f"{row['mean_wall_s'][part]:.2f}" for part in PARTS]
        wall = [f"{row['wall_s'][key]:.2f}" for key in ("mean", "p90", "max")]
        table.add_row(name, str(row["actions"]), *parts, *wall, f"{row['real_time_factor']:.2f}")
    Console().print(table)
