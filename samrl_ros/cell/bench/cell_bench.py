"""The cell's own costs: CPU per node, how old images and commands are, and where an action's time goes."""

from __future__ import annotations

import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from rich.console import Console
from rich.table import Table

from samrl_ros.bags.reader import open_bag
from samrl_ros.cell.options import CellOptions
from samrl_ros.cell.run import run_cell
from samrl_ros.cell.summary import write_json
from samrl_ros.contract.exit_codes import FAILED, OK
from samrl_ros.contract.topics import arm_topic, camera_topic, cell_topic
from samrl_ros.conversions.from_message import stamp_ns
from samrl_ros.nodes.manipulator import ManipulatorSettings

REQUEST, EXECUTED = cell_topic("supervisor/request"), cell_topic("manipulator/executed_action")
STATE, TARGET = cell_topic("model_updater/state"), cell_topic("view_planner/target")
ACTION, CAMERA_STATUS = cell_topic("policy/nominal_action"), arm_topic("camera_arm", "motion_status")
COLOR = camera_topic("color/image_raw")
History = list[tuple[str, dict[str, str]]]  # a node's full name and its diagnostics


class CpuSampler:
    """CPU seconds of every child process, sampled while the cell runs."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}
        self._since = time.monotonic()
        self.wall_s = 0.0

    def sample(self, pids: dict[str, int]) -> None:
        """Take the running totals; a process that has ended keeps its last."""
        for name, pid in pids.items():
            try:
                times = psutil.Process(pid).cpu_times()
            except psutil.NoSuchProcess:
                continue
            self._seconds[name] = times.user + times.system
        self.wall_s = time.monotonic() - self._since

    def shares(self) -> dict[str, float]:
        """Cores used per node, 1.0 is one core, start-up included."""
        return {name: seconds / max(self.wall_s, 1e-9) for name, seconds in self._seconds.items()}


def bench_cell(out: Path, seed: int, episodes: int, real_time_factor: float) -> int:
    """Run, measure, print a table, write `bench.json`; returns the exit code."""
    console = Console()
    sampler = CpuSampler()
    options = CellOptions(
        episodes=episodes, seed=seed, out=out, layout="processes", real_time_factor=real_time_factor
    )
    outputs: dict[str, Any] = {}
    history: History = []
    code = run_cell(
        options,
        console,
        on_tick=sampler.sample,
        keep=outputs,
        on_figures=lambda node, figures: history.append((node, figures)),
    )
    if code != OK:
        return FAILED
    watch = outputs["watch"]
    report = {
        "schema": 1,
        "cpu_cores_per_node": sampler.shares(),
        "bridge": _bridge(history),
        "ages": _ages(history, out / "bag"),
        "stages": _stages(out / "bag"),
        "loop_wall_s_per_action": _per_action(watch),
    }
    write_json(out / "bench.json", report)
    _print(console, report)
    console.print(f"bench:   {out / 'bench.json'}", highlight=False)
    return OK


def _quantiles(values: list[float]) -> dict[str, float]:
    if not values:
        return {"n": 0}
    array = np.array(values)
    return {
        "n": len(values),
        "p50": float(np.median(array)),
        "p99": float(np.quantile(array, 0.99)),
        "max": float(array.max()),
    }


def _figure(history: History, node: str, key: str) -> list[float]:
    found = [float(values[key]) for name, values in history if name.endswith(node) and key in values]
    return [v for v in found if np.isfinite(v)]


def _bridge(history: History) -> dict[str, Any]:
    factors = [f for f in _figure(history, "sim_bridge", "real_time_factor") if f > 0]
    gaps = _figure(history, "sim_bridge", "longest_gap_s")
    leads = _figure(history, "sim_bridge", "command_lead_min_ms")
    return {
        "real_time_factor": _quantiles(factors),
        "longest_wall_gap_s": max(gaps, default=float("nan")),
        "least_command_lead_ms": min(leads, default=float("nan")),
    }


def _ages(history: History, bag: Path) -> dict[str, Any]:
    """Ages at reception by the simulated clock: images at the updater, joint states at the manipulator."""
    return {
        "image_at_model_updater_s": _quantiles(_figure(history, "model_updater", f"{COLOR} age_s")),
        "joint_states_at_manipulator_s": _quantiles(
            _figure(history, "manipulator", f"{arm_topic('tool_arm', 'joint_states')} age_s")
        ),
        "command_behind_joint_state_s": _quantiles(_command_delay(bag)),
    }


def _command_delay(bag: Path) -> list[float]:
    """From a reading's stamp to the recorder's receipt of the command that answers it, in simulated time."""
    horizon = ManipulatorSettings.horizon
    topic = arm_topic("tool_arm", "command")
    return [
        record.log_time_ns * 1e-9 - (stamp_ns(message) * 1e-9 - horizon)
        for record, message in open_bag(bag).decoded((topic,))
    ]


def _stages(bag: Path) -> dict[str, Any]:
    """Simulated time from each request to its answer."""
    asked: dict[tuple[int, int, str], float] = {}
    spans: dict[str, list[float]] = defaultdict(list)
    answers = {STATE: "update", TARGET: "view", ACTION: "act"}
    for record, message in open_bag(bag).decoded((REQUEST, *answers, EXECUTED, CAMERA_STATUS)):
        now = record.log_time_ns * 1e-9
        key = (int(message.episode), int(message.step))
        if record.topic == REQUEST:
            asked[(*key, message.stage)] = now
        elif record.topic in answers:
            stage = answers[record.topic]
            if (*key, stage) in asked:
                spans[stage].append(now - asked.pop((*key, stage)))
            asked[(*key, "camera" if record.topic == TARGET else "move")] = now
        else:
            stage = "move" if record.topic == EXECUTED else "camera"
            if (*key, stage) in asked:
                spans[f"{stage} (motion)"].append(now - asked.pop((*key, stage)))
    return {stage: _quantiles(values) for stage, values in spans.items()}


def _per_action(watch: Any) -> dict[str, float]:
    per_action = {}
    for episode, outcome in watch.outcomes.items():
        if outcome.actions:
            per_action[str(episode)] = watch.wall_time_s[episode] / outcome.actions
    return per_action


def _print(console: Console, report: dict[str, Any]) -> None:
    table = Table(title="CPU per node (1.0 is one core)")
    table.add_column("node")
    table.add_column("cores", justify="right")
    for name, share in report["cpu_cores_per_node"].items():
        table.add_row(name, f"{share:.2f}")
    console.print(table)
    table = Table(title=r"time \[s], simulated unless it says wall")
    for column in ("what", "n", "p50", "p99", "max"):
        table.add_column(column)
    rows = {**report["ages"], **{f"stage {k}": v for k, v in report["stages"].items()}}
    for name, q in rows.items():
        if q["n"]:
            table.add_row(name, str(q["n"]), f"{q['p50']:.4f}", f"{q['p99']:.4f}", f"{q['max']:.4f}")
    console.print(table)
    factor = report["bridge"]["real_time_factor"]
    console.print(
        f"real-time factor {factor.get('p50', float('nan')):.2f}, "
        f"longest wall gap {report['bridge']['longest_wall_gap_s'] * 1e3:.0f} ms, "
        f"least command lead {report['bridge']['least_command_lead_ms']:.1f} ms",
        highlight=False,
    )
    for episode, seconds in report["loop_wall_s_per_action"].items():
        console.print(f"episode {episode}: {seconds:.2f} s wall per action", highlight=False)
