"""Where an action's time goes, by the wall clock: update, view, act, move.

A run of `samrl cell` leaves in its `summary.json` when each phase of its episodes began. An action is all
that happens from the end of the one before it to its own: update of the model, choice of a view where one is
due, motion of the camera there and update from the new image, the actor (or plan) and residual, motion of
the tool. What follows the last action, the updates that find the task done, belongs to none.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.errors import InputError
from samrl_core.common.figure_file import save_figure
from samrl_core.common.files import write_whole
from samrl_core.common.statistics import bootstrap_interval

NAME = "time_per_action"
_PART_OF = {"update": "update", "view": "view", "act": "act", "look": "camera", "move": "tool"}
_WORDS = {
    "update": "update (Real2Sim)",
    "view": "view (choice)",
    "act": "act (action, residual)",
    "camera": "move: camera arm",
    "tool": "move: tool arm",
}


@dataclass(frozen=True)
class ActionTime:
    """Wall time of one action [s]."""

    update: float = 0.0
    view: float = 0.0
    act: float = 0.0
    camera: float = 0.0  # motion of the camera arm
    tool: float = 0.0  # motion of the tool arm

    @property
    def whole(self) -> float:
        """All of it."""
        return sum(asdict(self).values())


PARTS = tuple(f.name for f in fields(ActionTime))


def times_of(marks: list[tuple[float, str]]) -> list[ActionTime]:
    """The actions of one episode.

    Args:
        marks: when each phase began, in order [s], and its name: update, view, look, act, move, end. Others
            are passed over.
    """
    found: list[ActionTime] = []
    spent = dict.fromkeys(PARTS, 0.0)
    part, since = "", 0.0
    for now, what in marks:
        if what not in _PART_OF and what != "end":
            continue
        if part:
            spent[part] += now - since
        if part == "tool":  # whatever comes next: the tool stands
            found.append(ActionTime(**spent))
            spent = dict.fromkeys(PARTS, 0.0)
        part, since = _PART_OF.get(what, ""), now
    return found


def time_per_action(run: Path, seed: int = 0) -> dict[str, Any]:
    """Writes `time_per_action.json` and `.png` into a run's folder; returns what is in the former.

    Args:
        run: folder of `samrl cell`.
        seed: of the bootstrap.

    Raises:
        InputError: no readable summary there, or one without times of an action.
    """
    path = run / "summary.json"
    try:
        summary = json.loads(path.read_text())
        by_episode = [times_of([(s, what) for s, what in e["marks"]]) for e in summary["episodes"]]
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(
            f"{path} has no times ({error!r}); give the folder of a run of `samrl cell` of this version"
        ) from error
    by_episode = [times for times in by_episode if times]
    if not by_episode:
        raise InputError(f"no episode in {path} came to an action; run `samrl cell` again")
    every = [one for times in by_episode for one in times]
    with_search = [one for one in every if one.view > 0.0]
    found = {
        "schema": 1,
        "experiment": NAME,
        "task": summary["task"],
        "settings": summary["settings"],
        "real_time_factor_median": summary["timing"]["real_time_factor_median"],
        "episodes": len(by_episode),
        "whole_s": _metrics_of([[one.whole for one in times] for times in by_episode], seed),
        "parts_s": {
            part: _metrics_of([[getattr(one, part) for one in times] for times in by_episode], seed)
            for part in PARTS
        },
        "with_a_new_view_s": _spread([one.whole for one in with_search]),
        "without_s": _spread([one.whole for one in every if one.view == 0.0]),
        "share_of_time": {p: sum(getattr(o, p) for o in every) / sum(o.whole for o in every) for p in PARTS},
        "actions": [[asdict(one) for one in times] for times in by_episode],
    }
    write_whole(run / f"{NAME}.json", json.dumps(found, indent=1) + "\n")
    write_picture(run / f"{NAME}.png", found, by_episode[0])
    return found


def _spread(values: list[float]) -> dict[str, float]:
    if not values:
        return {"n": 0}
    low = {"n": len(values), "mean": float(np.mean(values)), "median": float(np.median(values))}
    return low | {"q95": float(np.quantile(values, 0.95)), "max": float(np.max(values))}


def _metrics_of(by_episode: list[list[float]], seed: int) -> dict[str, Any]:
    """Spread over all actions, with an interval of the median over episodes."""
    interval = bootstrap_interval(
        by_episode,
        lambda some: float(np.median([value for values in some for value in values])),
        np.random.default_rng([seed, 5]),
    )
    return _spread([value for values in by_episode for value in values]) | {
        "median_interval95": list(interval)
    }


def write_picture(path: Path, found: dict[str, Any], shown: list[ActionTime]) -> None:
    """The actions of one episode in their parts, and the spread over all.

    Args:
        path: of the PNG.
        found: as `time_per_action` returns it.
        shown: actions of one episode.
    """
    fig = Figure(figsize=(13.0, 4.2), dpi=110, layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    left, right = fig.subplots(1, 2, width_ratios=(2, 1))
    colors = dict(zip(PARTS, ("C0", "C1", "C2", "0.55", "0.8"), strict=True))
    base = np.zeros(len(shown))
    for part in PARTS:
        values = np.array([getattr(one, part) for one in shown])
        left.bar(range(1, len(shown) + 1), values, 0.85, bottom=base, color=colors[part], label=_WORDS[part])
        base += values
    left.axhline(2.0, color="0.3", linewidth=0.8, linestyle=":")
    left.set_xlim(0.3, len(shown) + 0.7)
    left.annotate("2 s", (0.3, 2.0), (2, 2), textcoords="offset points", fontsize=8, color="0.3")
    left.set(xlabel="action of the first episode", ylabel="wall time [s]")
    left.set_ylim(0.0, max(2.2, 1.3 * float(base.max())))
    left.legend(fontsize=8, ncols=3, loc="upper right")
    factor = found["real_time_factor_median"]
    title = (
        f"{found['task'].replace('_', ' ')}, {found['whole_s']['n']} actions of {found['episodes']} episodes"
    )
    if factor is not None:
        title += f"; the cell ran at {factor:.2f} of real time"
    left.set_title(title, fontsize=9)
    names = [*PARTS, "whole"]
    rows = [*(found["parts_s"][part] for part in PARTS), found["whole_s"]]
    at = np.arange(len(names))
    right.barh(at, [row["mean"] for row in rows], color=[*colors.values(), "black"])
    for k, row in enumerate(rows):
        right.plot([row["mean"], row["q95"]], [k, k], color="0.2", linewidth=1)
        right.plot(row["q95"], k, "|", color="0.2")
        right.annotate(
            f"{row['mean']:.2f} | {row['median']:.2f} | {row['q95']:.2f}",
            (max(row["q95"], row["mean"]), k),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    right.axvline(2.0, color="0.3", linewidth=0.8, linestyle=":")
    right.set_yticks(at, [*(_WORDS[part] for part in PARTS), "whole action"], fontsize=8)
    right.invert_yaxis()
    right.set_xlim(0.0, 1.5 * max(2.0, *(row["q95"] for row in rows)))
    right.set_xlabel("wall time [s]: mean | median | 95 %")
    right.spines[["top", "right"]].set_visible(False)
    left.spines[["top", "right"]].set_visible(False)
    save_figure(fig, path)
