"""What a run's page shows, read from its bag in one pass, which others may watch."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from samrl_core.cell.robots.robot import ROLES
from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import BagDecoder, RawMessage, open_bag
from samrl_ros.cell.report.tracking import JointSamples, Tracking, tracking_of
from samrl_ros.contract.topics import FORMER_NAMES, arm_topic, cell_topic
from samrl_ros.conversions.from_message import points, stamp_ns

STATE, TARGET = cell_topic("model_updater/state"), cell_topic("view_planner/target")
CANDIDATES = cell_topic("view_planner/candidates")
NOMINAL, PHASE = cell_topic("policy/nominal_action"), cell_topic("phase")
SAFETY, READY = cell_topic("safety_state"), cell_topic("sim_bridge/ready")
WATCH = cell_topic("node_watch")
OUTCOME, ROSOUT = cell_topic("supervisor/outcome"), "/rosout"
STATUS = tuple(arm_topic(role, "motion_status") for role in ROLES)

EVENTS = 200  # kinds of event, at most
GUARD = "command guard"
WARN = 30  # level of rcl_interfaces/msg/Log
NUMBER = re.compile(r"\d+(\.\d+)?")
LEVELS = {0: "ok", 1: "warning", 2: "error", 3: "stale", 30: "warning", 40: "error", 50: "fatal"}


def losses_of(state: Any) -> str:
    """What a caption says of an update's loss (eq. 6); where nothing was compared, there is none."""
    before, after = float(state.loss_before), float(state.loss_after)
    if math.isnan(before) and math.isnan(after):
        return "target not seen" if state.why_stopped == "no_target" else "nothing compared"
    return f"loss {before:.3g} \u2192 {after:.3g}"


@dataclass(frozen=True)
class Phase:
    """A stage of the loop."""

    name: str
    start: float  # [s] of the bag's clock
    end: float  # [s]


@dataclass(frozen=True)
class Event:
    """Something that a person would want to know of; said again with other numbers, it is the same event."""

    time: float  # [s], the first time
    level: str  # ok, warning, error, ...
    source: str
    text: str  # as it was said first
    safety: bool  # of the arms' safety; else a node's warning
    last: float  # [s]
    count: int = 1


@dataclass(frozen=True)
class ConsideredView:
    """A view that was considered."""

    time: float  # [s]
    episode: int
    step: int
    position: np.ndarray  # (3,) camera in world [m]
    moved: bool
    score: float
    present_score: float
    reason: str


@dataclass(frozen=True)
class ChosenAction:
    """An action as the policy chose it."""

    time: float  # [s]
    nominal: float  # length [m]
    residual: float  # length [m]


@dataclass(frozen=True)
class ModelUpdate:
    """A model update."""

    time: float  # [s], of the image
    episode: int
    step: int
    before: float  # eq. 6
    after: float


@dataclass(frozen=True, eq=False)
class RunRecord:
    """Contents of a run's bag."""

    duration: float = 0.0  # [s]
    start: float = 0.0  # [s]
    messages: int = 0
    damage: tuple[str, ...] = ()
    task: str = ""
    phases: list[Phase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    views: list[ConsideredView] = field(default_factory=list)
    scored: list[np.ndarray] = field(default_factory=list)  # per search (N, 4): camera in world [m], score
    actions: list[ChosenAction] = field(default_factory=list)
    fits: list[ModelUpdate] = field(default_factory=list)
    outcomes: dict[int, str] = field(default_factory=dict)
    episodes: list[int] = field(default_factory=list)  # laid out
    tracking: list[Tracking] = field(default_factory=list)


class Watcher(Protocol):
    """Sees messages of a bag while it is read."""

    topics: frozenset[str]

    def take(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        """Take one message of `topics`, in log-time order.

        Args:
            raw: as recorded.
            decoded: makes an object of this message or of an earlier one.
        """
        ...


def read_run(bag_path: Path, watchers: Sequence[Watcher] = ()) -> RunRecord:
    """Read what the page shows.

    Raises:
        InputError: no bag, or one that cannot be read.
    """
    bag = open_bag(bag_path)
    run = RunRecord(
        duration=(bag.end_ns - bag.start_ns) * 1e-9,
        start=bag.start_ns * 1e-9,
        messages=bag.message_count,
        damage=bag.damage,
        task=bag.custom_data.get("task", ""),
    )
    marks: list[tuple[float, str]] = []
    events: list[Event] = []
    former = tuple(old for old, new in FORMER_NAMES.items() if new == NOMINAL)
    told = {STATE, TARGET, CANDIDATES, NOMINAL, PHASE, SAFETY, WATCH, READY, OUTCOME, ROSOUT}.union(
        former, STATUS
    )
    samples = {
        arm_topic(role, name): JointSamples(bag, arm_topic(role, name))
        for role in ROLES
        for name in ("joint_states", "command")
    }
    decode = BagDecoder(bag)
    for raw in bag.messages(told.union(samples, *(w.topics for w in watchers))):
        if raw.topic in samples:
            samples[raw.topic].take(raw, decode)
        elif raw.topic in told:
            _take(run, marks, events, raw, decode(raw))
        for watcher in watchers:
            if raw.topic in watcher.topics:
                watcher.take(raw, decode)
    ends = [time for time, _ in marks[1:]] + [bag.end_ns * 1e-9]  # one too many where no phase came
    run.phases.extend(Phase(name, time, end) for (time, name), end in zip(marks, ends, strict=False))
    # The first ones tell the cause.
    run.events.extend(_grouped(events)[:EVENTS])
    for role in ROLES:
        measured, commanded = (samples[arm_topic(role, name)] for name in ("joint_states", "command"))
        run.tracking.extend(tracking_of(role, measured, commanded))
    return run


def _take(
    run: RunRecord, marks: list[tuple[float, str]], events: list[Event], raw: RawMessage, m: Any
) -> None:
    now = raw.log_time_ns * 1e-9
    topic = FORMER_NAMES.get(raw.topic, raw.topic)
    if topic == PHASE:
        marks.append((now, m.data))
    elif topic == STATE:
        when = stamp_ns(m) * 1e-9
        run.fits.append(
            ModelUpdate(when, int(m.episode), int(m.step), float(m.loss_before), float(m.loss_after))
        )
    elif topic == TARGET:
        p = m.camera_in_world.position
        position = np.array([p.x, p.y, p.z])
        if np.isfinite(position).all():
            run.views.append(
                ConsideredView(
                    now,
                    int(m.episode),
                    int(m.step),
                    position,
                    bool(m.move),
                    float(m.score),
                    float(m.present_score),
                    m.reason,
                )
            )
    elif topic == CANDIDATES:
        run.scored.append(points(m, ("x", "y", "z", "score")))
    elif topic == NOMINAL:
        run.actions.append(ChosenAction(now, _length(m.nominal), _length(m.residual)))
    elif topic == READY:
        run.episodes.append(int(m.episode))
    elif topic == OUTCOME:
        run.outcomes[int(m.episode)] = m.reason
    elif topic == SAFETY:
        _safety(events, now, m)
    elif topic == WATCH:
        level = LEVELS.get(m.level[0] if isinstance(m.level, bytes) else int(m.level), "error")
        events.append(Event(now, level, f"node {m.name}", m.message, True, now))
    elif topic == ROSOUT:
        if int(m.level) >= WARN:
            level = LEVELS.get(int(m.level), str(m.level))
            events.append(Event(now, level, m.name.removeprefix("cell."), m.msg, False, now))
    elif int(m.status) != int(m.REACHED):
        text = f"{m.message or 'motion not finished'} (episode {m.episode}, action {m.step})"
        events.append(Event(now, "warning", f"motion of {m.arm}", text, True, now))


def _safety(events: list[Event], now: float, m: Any) -> None:
    """Changes of the command guard. That arms begin or cease to follow commands is no event."""
    level = m.level[0] if isinstance(m.level, bytes) else int(m.level)
    last = next((e for e in reversed(events) if e.source == GUARD), None)
    if level == 0 and (last is None or last.level == "ok"):
        return
    modes = ", ".join(f"{v.key} {v.value}" for v in m.values)
    text = f"{m.message} ({modes})" if modes else m.message
    if last is None or last.text != text:
        events.append(Event(now, LEVELS.get(level, str(level)), GUARD, text, True, now))


def _grouped(events: list[Event]) -> list[Event]:
    """Warnings that differ by numbers alone become one. Safety events stay apart: their order matters."""
    found: dict[Any, Event] = {}
    for at, event in enumerate(events):
        same = at if event.safety else (event.level, event.source, NUMBER.sub("#", event.text))
        first = found.get(same, event)
        found[same] = replace(first, last=event.time, count=first.count + (same in found))
    return list(found.values())


def _length(v: Any) -> float:
    return math.sqrt(v.x**2 + v.y**2 + v.z**2)


def task_of(run: RunRecord, summary: dict[str, Any]) -> str:
    """Name of the run's task, empty when neither bag nor summary tells it."""
    name = summary.get("task") or run.task
    return name if isinstance(name, str) else ""


def empty_run(error: InputError) -> RunRecord:
    """What is known of a run whose bag cannot be read: why."""
    return RunRecord(damage=(str(error),))
