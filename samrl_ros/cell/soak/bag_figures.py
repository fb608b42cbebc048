"""Latencies and losses of a run, from its bag; times are simulated unless they say wall."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions.from_message import stamp_ns

REQUEST, OUTCOME = cell_topic("supervisor/request"), cell_topic("supervisor/outcome")
STATE, ACTION = cell_topic("model_updater/state"), cell_topic("policy/nominal_action")
JOINTS, DIAGNOSTICS = arm_topic("tool_arm", "joint_states"), "/diagnostics"
LATENCIES = {
    "image_to_state_s": "image to the model state that it led to",
    "request_to_action_s": "request of an action to the action",
    "joint_state_gap_s": "from one joint state to the next",
    "wall_gap_s": "longest standstill of the simulation in a second, wall",
}


@dataclass
class BagFigures:
    """What a bag tells."""

    latencies: dict[str, list[tuple[float, float]]]  # by name: when [s], and how long [s]
    losses: dict[str, dict[str, float]]  # by node and topic: share that did not arrive, where any is missing
    outcomes: list[tuple[float, str]]  # when each episode ended [s], and why


@dataclass
class _Counts:
    """Messages that a node has received, from its first report as an active node to its newest."""

    first: dict[str, tuple[float, int]] = field(default_factory=dict)  # by topic: when [s], and how many
    newest: dict[str, tuple[float, int]] = field(default_factory=dict)


def figures_of(bag: Path) -> BagFigures:
    """Read a bag.

    Raises:
        InputError: it is none.
    """
    arrivals, gaps = _arrivals(bag)
    latencies: dict[str, list[tuple[float, float]]] = {name: [] for name in LATENCIES}
    latencies["joint_state_gap_s"] = gaps
    outcomes: list[tuple[float, str]] = []
    counts: dict[str, _Counts] = defaultdict(_Counts)
    asked: dict[tuple[int, int], float] = {}
    last_ns = 0  # stamp of the newest model state
    for record, message in open_bag(bag).decoded((REQUEST, STATE, ACTION, OUTCOME, DIAGNOSTICS)):
        now = 1e-9 * record.log_time_ns
        if record.topic == DIAGNOSTICS:
            for status in message.status:
                _count(counts[status.name.rpartition("/")[2]], status, now)
                latencies["wall_gap_s"] += [(now, gap) for gap in _gaps_of(status)]
        elif record.topic == OUTCOME:
            outcomes.append((now, message.reason))
        elif record.topic == STATE:
            taken_ns = stamp_ns(message)
            if taken_ns != last_ns:  # else sent again
                latencies["image_to_state_s"].append((now, now - 1e-9 * taken_ns))
            last_ns = taken_ns
        elif record.topic == ACTION:
            begun = asked.pop((message.episode, message.step), None)
            if begun is not None:
                latencies["request_to_action_s"].append((now, now - begun))
        elif message.stage == "act":
            asked[message.episode, message.step] = now
    losses = {node: lost for node, one in counts.items() if (lost := _losses(one, arrivals))}
    return BagFigures(latencies, losses, outcomes)


def _arrivals(bag: Path) -> tuple[dict[str, np.ndarray], list[tuple[float, float]]]:
    """When the recorder received the messages of each topic [s]; when and how long no joint state came."""
    times: dict[str, list[float]] = defaultdict(list)
    gaps: list[tuple[float, float]] = []
    last_ns = 0
    for record in open_bag(bag).messages():
        times[record.topic].append(1e-9 * record.log_time_ns)
        if record.topic == JOINTS:
            now_ns = header_stamp_ns(record.type, record.data) or 0
            if last_ns:
                gaps.append((1e-9 * now_ns, 1e-9 * (now_ns - last_ns)))
            last_ns = now_ns
    return {topic: np.array(found) for topic, found in times.items()}, gaps


def _gaps_of(status: Any) -> list[float]:
    if not status.name.endswith("/sim_bridge"):
        return []
    found = [float(v.value) for v in status.values if v.key == "longest_gap_s"]
    return [gap for gap in found if np.isfinite(gap)]


def _count(counts: _Counts, status: Any, now: float) -> None:
    values = {v.key: v.value for v in status.values}
    if values.get("state") != "active":
        return
    for key, value in values.items():
        topic, _, what = key.rpartition(" ")
        if what == "received":
            counts.first.setdefault(topic, (now, int(value)))
            counts.newest[topic] = (now, int(value))


def _losses(counts: _Counts, arrivals: dict[str, np.ndarray]) -> dict[str, float]:
    found = {}
    for topic, (since, before) in counts.first.items():
        until, after = counts.newest[topic]
        times = arrivals.get(topic, np.empty(0))
        sent = int(((times > since) & (times <= until)).sum())
        if sent > after - before:
            found[topic] = (sent - (after - before)) / sent
    return found


def percentiles(values: list[float]) -> dict[str, float]:
    """Of at least one value; else only that there is none."""
    if not values:
        return {"n": 0}
    array = np.array(values)
    names = {"p50": 0.5, "p95": 0.95, "p99": 0.99}
    return {
        "n": len(values),
        **{k: float(np.quantile(array, q)) for k, q in names.items()},
        "max": float(array.max()),
    }
