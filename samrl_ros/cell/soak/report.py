"""What the turns of a soak come to: `soak.json`, a table, a picture."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from samrl_core.common.figure_file import save_figure
from samrl_core.common.files import write_whole
from samrl_core.common.trend import common_trend
from samrl_ros.cell.soak.bag_figures import LATENCIES, percentiles
from samrl_ros.cell.soak.options import SAMPLES, read_turn
from samrl_ros.cell.soak.process_watch import read_samples

WARM_UP_S = 180.0  # of each turn: libraries load, every kind of computation is done for the first time
BLOCK_S = 60.0  # of samples that count as one value, their median
GROWING = {
    "anonymous_MB": "memory [MB]",
    "resident_MB": "resident memory [MB]",
    "threads": "threads",
    "handles": "open handles",
}
Series = list[tuple[np.ndarray, np.ndarray]]  # of each turn: times [h] and values


def report_soak(turns: list[Path], out: Path) -> dict[str, Any]:
    """Write `soak.json` and `soak.png` into the soak's folder; returns what is in the former."""
    told = [read_turn(turn) for turn in turns]
    samples = [list(read_samples(turn / SAMPLES)) for turn in turns]
    hours = sum(one["wall_s"] for one in told) / 3600.0
    episodes = sum(one["episodes"] for one in told)
    processes = sorted({row["process"] for rows in samples for row in rows} - {"", "other"})
    found = {
        "schema": 1,
        "hours": hours,
        "episodes": episodes,
        "successes": sum(one["successes"] for one in told),
        "errors": [one["error"] for one in told if one["error"]],
        "warm_up_s": WARM_UP_S,
        "block_s": BLOCK_S,
        "growth_per_hour": {
            name: {
                what: _growth(_blocks(samples, name, what), hours, episodes)
                for what in GROWING
                if name or what == "anonymous_MB"
            }
            for name in processes
        },
        "shared_memory_MB": {
            **_growth(_blocks(samples, "", "shared_MB"), hours, episodes),
            "most": max(
                (row["shared_MB"] for rows in samples for row in rows if not row["process"]), default=0.0
            ),
            "files_left_behind": sum(len(one["left_in_shared_memory"]) for one in told),
        },
        "latencies": {name: _latency(told, name) for name in LATENCIES},
        "losses": _losses(told),
        "turns": [{k: v for k, v in one.items() if k not in ("latencies", "losses")} for one in told],
    }
    write_whole(out / "soak.json", json.dumps(_plain(found), indent=1, allow_nan=False) + "\n")
    _plot(out / "soak.png", samples, told, found, processes)
    return found


def _blocks(samples: list[list[dict[str, Any]]], process: str, what: str) -> Series:
    """Medians of the samples of a process, of each turn, after the warm-up."""
    series: Series = []
    for rows in samples:
        blocks: dict[int, list[float]] = defaultdict(list)
        # When the nodes have ended, the cell reads its bag and sums up: that is no growth.
        until = max(
            (row["wall_s"] for row in rows if row["process"] not in ("", "cell", "other")), default=math.inf
        )
        for row in rows:
            if row["process"] == process and what in row and WARM_UP_S <= row["wall_s"] < until:
                blocks[int(row["wall_s"] // BLOCK_S)].append(row[what])
        if blocks:
            times = np.array([(k + 0.5) * BLOCK_S / 3600.0 for k in sorted(blocks)])
            series.append((times, np.array([float(np.median(blocks[k])) for k in sorted(blocks)])))
    return series


def _growth(series: Series, hours: float, episodes: int) -> dict[str, Any]:
    trend = common_trend(series)
    if trend is None:
        return {"blocks": 0}
    return {
        "per_hour": trend.slope,
        "interval95": list(trend.ci95),
        "includes_zero": trend.includes_zero,
        "per_episode": trend.slope * hours / episodes if episodes else math.nan,
        "blocks": trend.values,
        "effective_blocks": trend.effective,
        "median": float(np.median(np.concatenate([values for _, values in series]))),
    }


def _latency(told: list[dict[str, Any]], name: str) -> dict[str, dict[str, float]]:
    """Percentiles over the first and the last half of all turns."""
    found = {}
    for half in ("start", "end"):
        counts = [pair for one in told for pair in one["latencies"].get(name, {}).get(half, [])]
        values = [value for value, count in counts for _ in range(count)]
        found[half] = percentiles(values)
    return found


def _losses(told: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Mean share of messages that did not arrive, by node and topic."""
    shares: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    counted = [one for one in told if one["episodes"]]
    for one in counted:
        for node, topics in one["losses"].items():
            for topic, share in topics.items():
                shares[node][topic] += share / len(counted)
    return {node: dict(topics) for node, topics in shares.items()}


def print_soak(found: dict[str, Any], console: Console) -> None:
    """The figures as tables."""
    table = Table(title="growth per hour after the warm-up, 95 % interval")
    for column in ("process", *GROWING.values()):
        table.add_column(column)
    for process, growth in found["growth_per_hour"].items():
        table.add_row(process, *(_interval(growth[what]) for what in GROWING))
    console.print(table)
    shared = found["shared_memory_MB"]
    console.print(
        f"shared memory: at most {shared['most']:.1f} MB, {_interval(shared)} MB an hour, "
        f"{shared['files_left_behind']} files left behind",
        highlight=False,
    )
    table = Table(title=r"latency \[ms], first and last half of the turns; simulated unless it says wall")
    for column in ("what", "half", "n", "p50", "p95", "p99", "max"):
        table.add_column(column)
    for name, halves in found["latencies"].items():
        for half, q in halves.items():
            if q["n"]:
                cells = [f"{1e3 * q[key]:.1f}" for key in ("p50", "p95", "p99", "max")]
                table.add_row(LATENCIES[name], half, str(q["n"]), *cells)
    console.print(table)
    for node, topics in found["losses"].items():
        worst = sorted(topics.items(), key=lambda entry: -entry[1])[:3]
        text = ", ".join(f"{topic} {100 * share:.2f} %" for topic, share in worst)
        console.print(f"not received by {node}: {text}", highlight=False, soft_wrap=True)
    console.print(
        f"{found['hours']:.2f} h, {found['episodes']} episodes, {found['successes']} succeeded, "
        f"{len(found['errors'])} turns with errors",
        highlight=False,
    )


def _interval(growth: dict[str, Any]) -> str:
    if not growth["blocks"]:
        return "-"
    low, high = growth["interval95"]
    return f"{growth['per_hour']:+.2f} ({low:+.2f} to {high:+.2f})"


def _plot(
    path: Path,
    samples: list[list[dict[str, Any]]],
    told: list[dict[str, Any]],
    found: dict[str, Any],
    processes: list[str],
) -> None:
    """Memory of each process over the soak, a panel each, and the latencies of both halves."""
    figure = Figure(
        figsize=(12.0, 2.1 * (len(processes) + 2)), dpi=110, layout="constrained", facecolor="white"
    )
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(processes) + 2, 1)
    starts = np.concatenate([[0.0], np.cumsum([one["wall_s"] for one in told])]) / 60.0
    tasks = list(dict.fromkeys(one["task"] for one in told))
    for axis, process in zip(axes, [*processes, ""], strict=False):
        what = "anonymous_MB" if process else "shared_MB"
        for start, rows, one in zip(starts, samples, told, strict=False):
            chosen = [row for row in rows if row["process"] == process and what in row]
            color = f"C{tasks.index(one['task'])}"
            times = [start + row["wall_s"] / 60.0 for row in chosen]
            axis.plot(times, [row[what] for row in chosen], color=color, linewidth=1)
        growth = found["growth_per_hour"][process][what] if process else found["shared_memory_MB"]
        axis.set_title(
            f"{process or 'shared memory'}: {_interval(growth)} MB an hour", fontsize=9, loc="left"
        )
        axis.set_ylabel("MB", fontsize=8)
    axes[-2].set_xlabel("wall time [min]", fontsize=8)
    for index, task in enumerate(tasks):
        axes[0].plot([], [], color=f"C{index}", label=task.replace("_", " "))
    axes[0].legend(fontsize=8, ncols=len(tasks), loc="lower right")
    _draw_latencies(axes[-1], found["latencies"])
    for axis in axes:
        axis.tick_params(labelsize=8)
        axis.spines[["top", "right"]].set_visible(False)
    save_figure(figure, path)


def _draw_latencies(axis: Any, latencies: dict[str, Any]) -> None:
    row, labels = 0, []
    for name, halves in latencies.items():
        for half, color in (("start", "0.6"), ("end", "C3")):
            q = halves[half]
            if q["n"]:
                axis.plot([1e3 * q["p50"], 1e3 * q["p99"]], [row, row], color=color, linewidth=2)
                axis.plot([1e3 * q[k] for k in ("p50", "p95", "p99")], [row] * 3, "|", color=color)
            labels.append(f"{LATENCIES[name]}, {half}")
            row += 1
    axis.set_yticks(range(row), labels, fontsize=7)
    axis.invert_yaxis()
    axis.set_xscale("log")
    axis.set_xlabel("ms: median, 95 %, 99 %", fontsize=8)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
