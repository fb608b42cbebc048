"""Bags with the contract's topics, made by anybody, to arm recordings. What is odd is noted or refused."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import Bag, RawMessage, open_bag
from samrl_ros.recordings.joint_messages import (
    JOINT_STATE,
    JOINT_TRAJECTORY,
    JointMessages,
    decode_text,
    decode_topic,
)
from samrl_ros.recordings.nominal_texts import ControllerText, parse_controller, parse_tool
from samrl_ros.recordings.signals import common_joints, signal_of

STRING = "std_msgs/msg/String"
PHASE = "/cell/phase"
_STATES = re.compile(r"^/cell/([^/]+)/joint_states$")
_CHANNELS = {
    "joint_states": JOINT_STATE,
    "command": JOINT_TRAJECTORY,
    "commanded_effort": JOINT_STATE,
    "torque_enabled": JOINT_STATE,
}
_TEXTS = ("robot_description", "controller", "tool")
_MOVING = ("revolute", "continuous", "prismatic")
RAW = "raw_effort"  # custom data: channels whose effort is in units of the drive, not N m
_EPOCHS_APART_S = 1.0  # log time against header stamps; more is another clock, not a delay


@dataclass(frozen=True, eq=False)
class LoadedBag:
    """What a bag holds, and what is worth saying about it."""

    recordings: tuple[ArmRecording, ...]  # by role
    notes: dict[str, tuple[str, ...]]  # by role; each a sentence


def read_recordings(
    path: Path | str, urdf: str | None = None, tolerances: Tolerances | None = None
) -> tuple[ArmRecording, ...]:
    """One recording per arm found, see `load_recordings`."""
    return load_recordings(path, urdf, tolerances).recordings


def load_recordings(
    path: Path | str, urdf: str | None = None, tolerances: Tolerances | None = None
) -> LoadedBag:
    """Read every arm of a bag: folder, single .mcap, split, compressed, unindexed or truncated.

    Stamps are those of the headers; a recording's time starts at its first joint state. Joints are put in
    the order of the controller's text (else of the command, the URDF, the states); others are left out.

    Args:
        path: bag folder or .mcap file.
        urdf: XML text that replaces the bag's own description.
        tolerances: replace those that the controller's text states.

    Raises:
        InputError: no bag, no joint states, joints that do not match, stamps that do not increase (where
            and the message says by how much), messages or texts that are broken.
    """
    path = Path(path)
    bag = open_bag(path)
    roles = [m[1] for t in bag.topics if (m := _STATES.match(t.name)) and t.count > 0]
    if not roles:
        present = ", ".join(f"{t.name} ({t.count})" for t in bag.topics) or "none"
        cut = f"; it is truncated: {'; '.join(bag.damage)}" if bag.truncated else ""
        raise InputError(
            f"bag {path} holds no joint states{cut}: none on /cell/<arm>/joint_states; topics present:"
            f" {present}. Record or remap to the contract's names, or turn a log into a bag with"
            " `samrl bag import`"
        )
    bag, messages = _messages(bag, roles)
    damage = [*_damage_notes(bag), *bag.notes]
    if RAW in bag.custom_data:
        damage.append(f"the effort of {bag.custom_data[RAW]} is in raw units of the drive, not in N m")
    digest = bag.sha256()
    recordings, notes = [], {}
    for role in roles:
        found = list(damage)
        recordings.append(_recording(bag, role, messages, digest, urdf, tolerances, found))
        notes[role] = tuple(found)
    return LoadedBag(tuple(recordings), notes)


def has_arms(bag: Bag) -> bool:
    """Whether a bag holds joint states under the contract's names."""
    return any(_STATES.match(topic.name) and topic.count > 0 for topic in bag.topics)


def _messages(bag: Bag, roles: list[str]) -> tuple[Bag, dict[str, list[RawMessage]]]:
    """The bag (reopened up to its first damage where it only looked whole) and its messages by topic."""
    wanted = {f"/cell/{role}/{name}" for role in roles for name in (*_CHANNELS, *_TEXTS)} | {PHASE}
    _check_types(bag, wanted)
    while True:
        by_topic: dict[str, list[RawMessage]] = {name: [] for name in wanted}
        try:
            for message in bag.messages(wanted):
                by_topic[message.topic].append(message)
        except InputError:
            if bag.truncated:
                raise
            bag = open_bag(bag.path, verify=True)
            if not bag.truncated:
                raise
            continue
        return bag, by_topic


def _check_types(bag: Bag, wanted: set[str]) -> None:
    for topic in bag.topics:
        if topic.name not in wanted:
            continue
        expected = _CHANNELS.get(topic.name.rsplit("/", 1)[-1], STRING)
        if topic.type != expected or topic.serialization != "cdr":
            raise InputError(
                f"bag {bag.path}: topic {topic.name} is {topic.type} in {topic.serialization},"
                f" must be {expected} in cdr"
            )


def _damage_notes(bag: Bag) -> list[str]:
    if not bag.truncated:
        return []
    return [
        f"the bag is truncated: {'; '.join(bag.damage)}; {bag.lost_bytes} bytes at the end could not be read,"
        f" {bag.message_count} messages up to log time {bag.end_ns * 1e-9:.3f} s are used"
    ]


def _recording(
    bag: Bag,
    role: str,
    messages: dict[str, list[RawMessage]],
    digest: str,
    urdf: str | None,
    tolerances: Tolerances | None,
    notes: list[str],
) -> ArmRecording:
    texts = {name: _text(messages, f"/cell/{role}/{name}", notes) for name in _TEXTS}
    urdf = urdf if urdf is not None else texts["robot_description"]
    about = ControllerText((), None, None)
    if texts["controller"] is not None:
        about = parse_controller(texts["controller"], f"{bag.path}: /cell/{role}/controller")
        notes.extend(about.notes)
    tool = None
    if texts["tool"] is not None:
        tool, more = parse_tool(texts["tool"], f"{bag.path}: /cell/{role}/tool")
        notes.extend(more)
    decoded = {
        name: decode_topic(kind, f"/cell/{role}/{name}", [m.data for m in messages[f"/cell/{role}/{name}"]])
        for name, kind in _CHANNELS.items()
    }
    moving = moving_joints(urdf) if urdf is not None else None
    joints = _joint_order(bag, role, about, moving, decoded, notes)
    logged = {
        name: np.array([m.log_time_ns for m in messages[f"/cell/{role}/{name}"]], dtype=np.int64)
        for name in _CHANNELS
    }
    start = _start(decoded["joint_states"], logged["joint_states"])
    signals = {
        name: signal_of(f"{bag.path}: /cell/{role}/{name}", name, part, logged[name], start, joints, notes)
        for name, part in decoded.items()
        if len(part.stamp_ns)
    }
    for name in ("command", "commanded_effort"):
        if name not in signals:
            notes.append(f"/cell/{role}/{name} was not recorded")
    if urdf is None:
        notes.append(f"/cell/{role}/robot_description was not recorded and no URDF was given")
    effective = tolerances or about.tolerances or Tolerances()
    return ArmRecording(
        name=bag.path.stem if bag.path.suffix == ".mcap" else bag.path.name,
        source=str(bag.path),
        sha256=digest,
        arm=ArmDescription(role, joints, urdf, about.controller, tool, effective),
        states=signals["joint_states"],
        command=signals.get("command"),
        commanded_effort=signals.get("commanded_effort"),
        torque_enabled=signals.get("torque_enabled"),
        phases=_phases(messages[PHASE], decoded["joint_states"], logged["joint_states"], start),
    )


def _text(messages: dict[str, list[RawMessage]], topic: str, notes: list[str]) -> str | None:
    if not messages[topic]:
        return None
    found = [decode_text(topic, m.data) for m in messages[topic]]
    if len(set(found)) > 1:
        notes.append(f"{topic} was published {len(set(found))} times with different content; the last counts")
    return found[-1]


def moving_joints(urdf: str) -> tuple[str, ...]:
    """Joints of a URDF text that move by themselves. Raises `InputError` if it is no URDF."""
    return tuple(
        str(joint.get("name"))
        for joint in parse_urdf(urdf, "the URDF").findall("joint")
        if joint.get("type") in _MOVING and joint.find("mimic") is None
    )


def chained_joints(urdf: str, joints: Sequence[str]) -> set[str]:
    """Moving joints between the base and some joints or behind these: all whose motion theirs depends on."""
    root = parse_urdf(urdf, "the URDF")
    above: dict[str, tuple[str, str]] = {}  # link -> joint that moves it, link before
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            above[str(child.get("link"))] = str(joint.get("name")), str(parent.get("link"))
    found: set[str] = set()
    for link in above:
        path, at = [], link
        while at in above and len(path) <= len(above):
            name, at = above[at]
            path.append(name)
        if set(path) & set(joints):
            found |= set(path)
    return found & set(moving_joints(urdf))


def _joint_order(
    bag: Bag,
    role: str,
    about: ControllerText,
    moving: tuple[str, ...] | None,
    decoded: dict[str, JointMessages],
    notes: list[str],
) -> tuple[str, ...]:
    """Joints to read, in order; all are in the states, and in the URDF where there is one."""
    states = common_joints(decoded["joint_states"])
    wanted, source = about.joints, "the controller"
    for name in ("command", "commanded_effort"):
        if not wanted:
            wanted, source = common_joints(decoded[name]), f"/cell/{role}/{name}"
    if not wanted and moving is not None:
        wanted, source = tuple(j for j in moving if j in states), "the URDF"
        if not wanted:
            raise InputError(
                f"bag {bag.path}: no joint of /cell/{role}/joint_states {list(states)} is among the URDF's"
                f" moving joints {list(moving)}; wrong URDF, or names to mend"
            )
    wanted, source = (wanted, source) if wanted else (states, "the states")
    if not wanted:
        raise InputError(f"bag {bag.path}: /cell/{role}/joint_states names no joints; fill in `name`")
    if missing := [j for j in wanted if j not in states] if states else []:
        raise InputError(
            f"bag {bag.path}: joints {missing} of {source} {list(wanted)} are not in"
            f" /cell/{role}/joint_states, which has {list(states)}; names must be the same"
        )
    if moving is not None and (missing := [j for j in wanted if j not in moving]):
        raise InputError(
            f"bag {bag.path}: joints {missing} of {source} {list(wanted)} are not among the URDF's moving"
            f" joints {list(moving)}; wrong URDF, or names to mend"
        )
    if extra := [j for j in states if j not in wanted]:
        notes.append(f"joints {', '.join(extra)} of /cell/{role}/joint_states are not the arm's; ignored")
    return wanted


def _start(states: JointMessages, logged: np.ndarray) -> int:
    return int(states.stamp_ns[0] if states.stamp_ns.any() else logged[0])


def _phases(
    marks: list[RawMessage], states: JointMessages, logged: np.ndarray, start: int
) -> tuple[tuple[float, str], ...]:
    """Marks have no stamp of their own: log times, moved to the headers' clock if that is another one."""
    ahead = int(np.median(logged - states.stamp_ns)) if states.stamp_ns.any() else 0
    shift = ahead if abs(ahead) > _EPOCHS_APART_S * 1e9 else 0
    return tuple(((m.log_time_ns - shift - start) * 1e-9, decode_text(PHASE, m.data)) for m in marks)
