"""Drafts a mapping from a log: each entry with its reason, and a question where the log is no proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder
from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.blocks import Block, LogPart, read_parts
from samrl_ros.log_import.draft.column_names import NameMeaning, meaning, words_in
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.formats.parquet import episodes, is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics, read_text_topic
from samrl_ros.log_import.tables import SUFFIXES
from samrl_ros.recordings.read import moving_joints

# Arms with torque sensors behind the gears, by how their makers' packages name the joints.
_LINK_SENSORS = ("panda_joint", "fr3_joint", "fer_joint", "iiwa_joint", "lbr_", "lbr_iiwa", "rizon", "gen3_")
_FOLLOWS = 0.8  # correlation from which a block is taken as what the arm followed
_MOVES_WITH = 0.98  # correlation from which a block of an unknown name is taken as the command, and asked for
_MOST_EPISODES = 20  # of a dataset, that become recordings
_FULL_TURNS = 4 * np.pi  # [rad] more than a joint of an arm turns: degrees


@dataclass(frozen=True, eq=False)
class _Candidate:
    part: LogPart
    block: Block
    meaning: NameMeaning


def draft_mapping(
    paths: Sequence[Path], urdf: str | None, urdf_file: str | None, effort: Effort = Effort.ask
) -> Draft:
    """Draft a mapping of one recording.

    Args:
        paths: files of one recording, or one folder with them.
        urdf: text of the robot's description, if there is one; else a bag's own is looked for.
        urdf_file: where it lies, as the mapping is to name it.
        effort: what measured efforts are: of a link-side sensor, at the drive's output side before friction,
            nothing to use, or unknown.

    Raises:
        InputError: a log that cannot be read, or in which no position was found.
    """
    files = [file for path in paths for file in _files(path)]
    searched = len(files) > len(paths)  # a folder: what else lies there is no fault
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    if urdf is None:
        urdf = _described(files, draft)
        draft.urdf = urdf
    else:
        draft.urdf = urdf_file
    joints = moving_joints(urdf) if urdf is not None else ()
    parts: list[LogPart] = []
    for file in files:
        try:
            parts += read_parts(file, joints)
        except InputError as error:
            if not searched:
                raise
            draft.unused.append(f"{file.name}: {error}")
    several = len({part.path for part in parts}) > 1
    found = [
        _Candidate(part, block, _meaning(part, block, several)) for part in parts for block in part.blocks
    ]
    position = _measured_position(found, joints, draft)
    order = _joints(position, joints, draft)
    draft.recordings += _recordings(files)
    unit = _position_unit(position, draft)
    time = _add_source(position.part, "states", draft)
    states = {"source": "states", "position": _quantity(position, order, unit, draft, "states")}
    draft.channels["states"] = states
    used = [position]
    used += _add_velocity(found, position, order, unit, time, states, draft)
    used += _add_command(found, position, order, unit, time, draft)
    used += _add_effort(found, position, order, effort, draft)
    for each in found:
        if not any(each.block is one.block for one in used):
            draft.unused.append(_name(each))
    return draft


def _recordings(files: list[Path]) -> list[dict[str, Any]]:
    """One; of a LeRobot dataset one per episode, of which the last is held out."""
    if len(files) == 1 and is_lerobot(files[0]):
        numbers = episodes(files[0])[:_MOST_EPISODES]
        roles = ["fit"] * (len(numbers) - 1) + ["held_out" if len(numbers) > 1 else "fit"]
        return [
            {"name": f"episode_{number}", "role": role, "parts": {"states": number}}
            for number, role in zip(numbers, roles, strict=True)
        ]
    name = files[0].stem if len(files) == 1 else files[0].parent.name
    return [{"name": name or "log", "role": "fit"}]


def _files(path: Path) -> list[Path]:
    if is_bag(path) or is_lerobot(path) or not is_folder(path):
        return [path]
    inside = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    if not inside:
        raise InputError(f"{path} holds no log: no bag, no LeRobot dataset, no {', '.join(SUFFIXES)}")
    return inside


def _described(files: list[Path], draft: Draft) -> str | None:
    """A bag's own robot description."""
    for file in files:
        if is_bag(file):
            for topic in list_topics(file, "the log"):
                named = topic.name.endswith("robot_description") and topic.type == "std_msgs/msg/String"
                text = read_text_topic(file, topic.name, "the log") if named else None
                if text:
                    draft.note("urdf", f"the bag's {topic.name}")
                    return text
    return None


def _meaning(part: LogPart, block: Block, several: bool) -> NameMeaning:
    """Of the column; what it leaves open, of the part, and of the file where there are several."""
    own = meaning(block.stem)
    for name in (part.part, part.path.stem if several else ""):
        more = meaning(name) if name else NameMeaning()
        decided = own.commanded or own.measured or own.computed
        own = NameMeaning(
            own.quantity or ("" if part.ros else more.quantity),
            own.commanded if decided else more.commanded,
            own.measured if decided else more.measured and not more.commanded,
            own.computed,
            own.unit or more.unit,
        )
    return own


def _measured_position(found: list[_Candidate], joints: Sequence[str], draft: Draft) -> _Candidate:
    wanted = [
        c
        for c in found
        if c.meaning.quantity == "position" and not c.meaning.commanded and not c.meaning.computed
    ]
    reason = "the name says position"
    if not wanted:  # LeRobot's observation.state, q, or a number alone
        wanted = [c for c in found if not c.meaning.quantity and c.meaning.measured]
        reason = "the name says a measured state"
    if not wanted:
        wanted = [c for c in found if words_in(c.block.stem)[:1] in (["q"], ["qm"], ["qj"], ["joint"], ["x"])]
        reason = "named as positions often are"
    if not wanted:
        names = ", ".join(_name(c) for c in found)
        raise InputError(f"no measured position was found among {names}; write the mapping by hand")
    fits = [c for c in wanted if joints and set(c.block.labels) & set(joints)] or wanted
    best = max(
        fits,
        key=lambda c: (
            len(set(c.block.labels) & set(joints)),
            c.part.kind == "sensor_msgs/msg/JointState",
            len(c.block.labels),
            c.meaning.measured,
            len(c.block.values),
        ),
    )
    rivals = [c for c in fits if c.block is not best.block and len(c.block.labels) == len(best.block.labels)]
    standard = best.part.kind == "sensor_msgs/msg/JointState"
    question = ""
    if rivals and not standard:
        question = f"is {_name(best)} the joint's position, and not {' or '.join(map(_name, rivals))}?"
    elif reason != "the name says position":
        question = f"is {_name(best)} the measured position?"
    draft.note("channels.states.position", f"{_name(best)}: {reason}", question)
    return best


def _joints(position: _Candidate, joints: Sequence[str], draft: Draft) -> list[str]:
    """Labels of the log in the order of the recording's joints; sets the recording's names."""
    labels = position.block.labels
    there = [joint for joint in joints if joint in labels]
    if there:
        draft.joints = there
        missing = [joint for joint in joints if joint not in labels]
        question = (
            f"{', '.join(missing)} of the URDF are not in the log; do they stand still?" if missing else ""
        )
        draft.note("joints", "names that log and URDF share, in the URDF's order", question)
        return there
    if joints and len(joints) == len(labels):
        draft.joints = list(joints)
        shown = ", ".join(
            f"{label or position.block.stem} is {j}" for label, j in zip(labels, joints, strict=True)
        )
        draft.note(
            "joints", "the URDF's, as many as the log has columns", f"the log names no joints: {shown}?"
        )
        return list(labels)
    if joints:
        draft.joints = [_joint_name(label, k) for k, label in enumerate(labels)]
        draft.note(
            "joints",
            "the log's names",
            f"the log has {list(labels)}, the URDF moves {list(joints)}: which is which? Take the"
            " URDF's names",
        )
        return list(labels)
    draft.joints = [_joint_name(label, k) for k, label in enumerate(labels)]
    draft.note("joints", "the log's names; there is no URDF")
    return list(labels)


def _joint_name(label: str, number: int) -> str:
    return label if label and not label.isdecimal() else f"joint_{label or number + 1}"


def _position_unit(position: _Candidate, draft: Draft) -> str:
    key, values = "channels.states.position", position.block.values
    if position.part.ros:
        draft.note(key, "ROS messages are in rad and m (REP-103)")
        return "rad"
    if position.meaning.unit in ("rad", "deg", "mm"):
        draft.note(key, f"the name says {position.meaning.unit}")
        return position.meaning.unit
    largest = float(np.abs(values).max())
    if (values == np.round(values)).all() and largest > 100:
        unit = "counts/4096" if values.min() >= 0 and largest < 4096 else "deg"
        draft.note(key, f"whole numbers up to {largest:g}", f"is the unit {unit}? Counts per turn, deg, mm?")
        return unit
    unit = "deg" if largest > _FULL_TURNS else "rad"
    draft.note(key, f"numbers up to {largest:.3g}", f"is the unit {unit}, and not deg, rev, m or mm?")
    return unit


def _add_source(part: LogPart, name: str, draft: Draft) -> np.ndarray:
    """Adds the part as a source; its times [s]."""
    key, table = f"sources.{name}.time", part.table
    source: dict[str, Any] = {"file": part.path.name}
    if part.part:
        source["part"] = part.part
    draft.sources[name] = source
    rows = len(part.blocks[0].rows)
    if table.time is not None:
        draft.note(key, "the header's stamps" if "header.stamp" in table.columns else "the log's own")
        time = table.time
    elif part.times:
        column = part.times[0]
        values = table.numbers(column, "the log")
        said = meaning(column).unit if meaning(column).unit in ("s", "ms", "us", "ns") else ""
        units = evidence.time_unit(np.diff(values))
        unit = said or (units[0] if units else "s")
        question = "" if said or len(units) == 1 else f"is {column!r} in {unit}?"
        why = "its name says so" if said else f"steps of {np.median(np.diff(values)):g}"
        draft.note(key, f"{column!r} in {unit}: {why}", question)
        source["time"] = {"column": column, "unit": unit}
        time = values * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
    elif part.dates:
        draft.note(key, f"{part.dates[0]!r} holds dates")
        source["time"] = {"column": part.dates[0], "iso": True}
        time = table.times(part.dates[0], "the log")
    else:
        draft.note(key, "no column is named as time", "what is the rate [Hz]? 100 is a placeholder")
        source["time"] = {"rate_hz": 100.0}
        time = np.arange(rows) / 100.0
    if "time" in source and (np.diff(time) <= 0).any():
        source["time"] = {**source["time"], "repeated": "drop"}
        draft.note(key, f"{int((np.diff(time) <= 0).sum())} steps do not increase; such rows are left out")
    source["columns"] = {}
    return time


def _quantity(each: _Candidate, order: list[str], unit: str, draft: Draft, source: str) -> dict[str, Any]:
    """A quantity in the order of the joints; its columns are added to the source."""
    block = each.block
    columns: dict[str, str] = draft.sources[source]["columns"]
    prefix = "_".join(word for word in words_in(block.stem) if word.isidentifier())[:24] or "x"
    if not prefix.isidentifier():
        prefix = f"x_{prefix}"
    if not block.rows.all():
        draft.sources[source]["missing"] = "drop_row"
    if len(block.columns) == 1 and len(block.labels) > 1:
        key = _free(columns, prefix)
        columns[key] = block.columns[0]
        return {"formula": [f"{key}[{block.labels.index(label)}]" for label in order], "unit": unit}
    formulas = []
    for number, label in enumerate(order, 1):
        key = _free(columns, f"{prefix}_{number}")
        columns[key] = block.columns[block.labels.index(label)]
        formulas.append(key)
    return {"formula": formulas, "unit": unit}


def _free(columns: dict[str, str], name: str) -> str:
    while name in columns or name == "time":
        name += "_"
    return name


def _beside(
    found: list[_Candidate], position: _Candidate, order: list[str], quantity: str
) -> list[_Candidate]:
    """Measured blocks of a quantity in the same part, with the same joints."""
    return [
        c
        for c in found
        if c.part is position.part
        and c.meaning.quantity == quantity
        and not c.meaning.commanded
        and not c.meaning.computed
        and c.meaning.measured == position.meaning.measured
        and set(order) <= set(c.block.labels)
    ]


def _add_velocity(
    found: list[_Candidate],
    position: _Candidate,
    order: list[str],
    unit: str,
    time: np.ndarray,
    states: dict[str, Any],
    draft: Draft,
) -> list[_Candidate]:
    key = "channels.states.velocity"
    for each in _beside(found, position, order, "velocity"):
        both = each.block.rows & position.block.rows
        place = [each.block.labels.index(label) for label in order]
        own = [position.block.labels.index(label) for label in order]
        fit = evidence.fit_rate(
            time[both],
            position.block.values[both[position.block.rows]][:, own],
            each.block.values[both[each.block.rows]][:, place],
        )
        fitting = evidence.velocity_unit(unit, fit)
        if not fitting:
            draft.note(
                key,
                f"derivative of the position: {_name(each)} is not its rate (correlation"
                f" {fit.correlation:.2f}, ratio {fit.ratio:.3g})",
            )
            break
        draft.note(key, f"{_name(each)}: integrates to the position (ratio {fit.ratio:.3g}), so {fitting}")
        states["velocity"] = _quantity(each, order, fitting, draft, "states")
        return [each]
    else:
        draft.note(key, "derivative of the position: none was recorded")
    states["velocity"] = "derivative"
    return []


def _add_command(
    found: list[_Candidate],
    position: _Candidate,
    order: list[str],
    unit: str,
    time: np.ndarray,
    draft: Draft,
) -> list[_Candidate]:
    wanted = [
        c
        for c in found
        if c.meaning.commanded and not c.meaning.computed and c.meaning.quantity in ("position", "")
        and set(order) <= set(c.block.labels)
    ]  # fmt: skip
    if not wanted:
        return _add_follower(found, position, order, unit, time, draft)
    best = max(wanted, key=lambda c: (c.meaning.quantity == "position", len(c.block.values)))
    key = "channels.command.position"
    same = best.part is position.part
    source = "states" if same else "command"
    other = time if same else _add_source(best.part, source, draft)
    own = [position.block.labels.index(label) for label in order]
    place = [best.block.labels.index(label) for label in order]
    near = evidence.follows(
        time[position.block.rows],
        position.block.values[:, own],
        other[best.block.rows],
        best.block.values[:, place],
    )
    question = (
        "" if near >= _FOLLOWS else f"the arm hardly follows {_name(best)}: is it the commanded position?"
    )
    draft.note(
        key, f"{_name(best)}: the name says commanded; correlation with the position {near:.2f}", question
    )
    channel = {"source": source, "position": _quantity(best, order, unit, draft, source)}
    draft.channels["command"] = channel
    used = [best]
    for quantity in ("velocity", "acceleration"):
        more = [
            c
            for c in found
            if c.part is best.part and c.meaning.quantity == quantity and c.meaning.commanded
            and not c.meaning.computed and set(order) <= set(c.block.labels)
        ]  # fmt: skip
        if more and best.part.ros:
            draft.note(f"channels.command.{quantity}", f"{_name(more[0])}, in SI units (REP-103)")
            suffix = {"velocity": "rad/s", "acceleration": "rad/s2"}[quantity]
            channel[quantity] = _quantity(more[0], order, suffix, draft, source)
            used.append(more[0])
    return used


def _add_follower(
    found: list[_Candidate],
    position: _Candidate,
    order: list[str],
    unit: str,
    time: np.ndarray,
    draft: Draft,
) -> list[_Candidate]:
    """A block beside the position that moves with it, under a name that says nothing."""
    rows, own = position.block.rows, [position.block.labels.index(label) for label in order]
    for each in found:
        silent = not (each.meaning.quantity or each.meaning.computed or each.meaning.measured)
        beside = each.part is position.part and each.block is not position.block
        if not silent or not beside or len(each.block.labels) != len(order):
            continue
        near = evidence.follows(
            time[rows], position.block.values[:, own], time[each.block.rows], each.block.values
        )
        scale = float(np.ptp(each.block.values) / max(np.ptp(position.block.values), 1e-12))
        if near > _MOVES_WITH and 0.5 < scale < 2.0:
            draft.note(
                "channels.command.position",
                f"{_name(each)}: moves with the position (correlation {near:.4f})",
                f"is {_name(each)} the commanded position?",
            )
            labels = list(each.block.labels) if each.block.labels != position.block.labels else order
            quantity = _quantity(each, labels, unit, draft, "states")
            draft.channels["command"] = {"source": "states", "position": quantity}
            return [each]
    draft.note("channels.command", "no commanded positions were found")
    return []


def _add_effort(
    found: list[_Candidate], position: _Candidate, order: list[str], effort: Effort, draft: Draft
) -> list[_Candidate]:
    currents = [c for c in found if c.meaning.quantity in ("current", "voltage")]
    for each in currents:
        draft.unused.append(
            f"{_name(each)}: multiply by torque constant and gear ratio, then use it as effort"
        )
    measured = _beside(found, position, order, "effort")
    if not measured or effort is Effort.none:
        if not measured:
            draft.note("channels.states.effort", "no efforts were found")
        return currents
    best = measured[0]
    link = effort is Effort.link or (
        effort is Effort.ask and all(name.startswith(_LINK_SENSORS) for name in draft.joints)
    )
    unit = "N m" if best.part.ros or not best.meaning.unit else best.meaning.unit
    unit_question = "" if best.part.ros or best.meaning.unit else f"is {_name(best)} in N m?"
    quantity = _quantity(best, order, unit, draft, "states")
    if link:
        reason = "as stated" if effort is Effort.link else "these arms measure torque behind the gears"
        draft.note("channels.states.effort", f"{_name(best)}: {reason}", unit_question)
        draft.channels["states"]["effort"] = quantity
        return [best, *currents]
    question = unit_question
    if effort is Effort.ask:
        question = (
            f"is {_name(best)} the drive's torque times gear ratio (commanded_effort, as drafted), of a"
            " sensor behind the gears (then states.effort), or a current (then multiply it)? --effort says it"
        )
    draft.note("channels.commanded_effort.effort", f"{_name(best)}: the name says effort", question)
    draft.channels["commanded_effort"] = {"source": "states", "effort": quantity}
    return [best, *currents]


def _name(each: _Candidate) -> str:
    place = f"{each.part.part}: " if each.part.part else ""
    file = "" if each.part.part else f"{each.part.path.name}: "
    return f"{file}{place}{each.block.stem}"
