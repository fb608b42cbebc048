"""Drafts a mapping from a log: each entry with its reason, and a question where the log is no proof."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.blocks import LogBlock, LogPart, read_parts
from samrl_ros.log_import.draft.column_names import SLOT, NameMeaning, meaning, says_commanded, words_in
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints import runs_beside
from samrl_ros.log_import.draft.joints.arm_messages import (
    ARM_MESSAGES,
    labels_of_array,
    numbered_joints,
    unitree_motors,
    universal_robots,
)
from samrl_ros.log_import.draft.joints.channels import add_command, add_effort, add_velocity
from samrl_ros.log_import.draft.joints.joined_by_kind import group_by_kind
from samrl_ros.log_import.draft.joints.letters import read_letters
from samrl_ros.log_import.draft.joints.motor_input import split_supply
from samrl_ros.log_import.draft.joints.named_blocks import (
    as_input_and_output,
    asked_of_still,
    by_one_unit,
    is_output,
    label_by_name,
    nothing_measured,
    without_relative,
    without_tool,
)
from samrl_ros.log_import.draft.joints.named_by_word import group_by_word
from samrl_ros.log_import.draft.joints.named_sources import (
    NamedBlock,
    add_source,
    name_of,
    quantity_of,
    shares_rows,
)
from samrl_ros.log_import.draft.joints.names_beside import name_joints
from samrl_ros.log_import.draft.joints.position_unit import RTDE, position_unit
from samrl_ros.log_import.draft.joints.run_files import (
    files_in,
    recordings_in,
    recordings_of,
    runs_alike,
)
from samrl_ros.log_import.draft.joints.sliding_joints import set_sliding_units
from samrl_ros.log_import.draft.joints.speed_alone import integrate_speeds, say_integral
from samrl_ros.log_import.draft.joints.told_by_model import (
    is_reversed,
    is_without_gravity,
    reverse_torque,
    settle_by_model,
    told_by_model,
)
from samrl_ros.log_import.draft.joints.torque_switch import add_torque_switch
from samrl_ros.log_import.draft.joints.unnamed_matrix import is_group, split_matrix
from samrl_ros.log_import.draft.joints.unnamed_rate import rate_by_velocity
from samrl_ros.log_import.draft.joints.whole_turns import (
    TURNS,
    move_into_limits,
    take_turns_out,
    take_turns_out_beside,
    turn_of,
)
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics, read_text_topic
from samrl_ros.recordings.read import chained_joints, moving_joints

_NAMED = 4  # of columns that may be meant instead, in a question; of files, in a refusal


def draft_mapping(
    paths: Sequence[Path], urdf: str | None, urdf_file: str | None, effort: Effort = Effort.ask
) -> Draft:
    """Draft a mapping of one recording.

    Args:
        paths: files of one recording, or one folder with them; files with the same columns are recordings of
            one machine, one after another, be it in one folder or under one name in a folder each; folders
            may hold a file of what was measured and one of what was commanded each.
        urdf: text of the robot's description, if there is one; else a bag's own is looked for.
        urdf_file: where it lies, as the mapping is to name it.
        effort: what measured efforts are: of a link-side sensor, at the drive's output side before friction,
            nothing to use, or unknown.

    Raises:
        InputError: a log that cannot be read, or in which no position was found.
    """
    files = [file for path in paths for file in files_in(path)]
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
    if searched and not parts:
        told = [f"none of the folder's {len(files)} files can be read as a log", *draft.unused[:_NAMED]]
        raise InputError("; ".join(told))
    runs = runs_alike(parts)
    if runs:
        parts = [part for part in parts if part.path in runs[0].patterns]
    several = len({part.path for part in parts}) > 1
    found = [
        NamedBlock(part, block, _meaning(part, block, several)) for part in parts for block in part.blocks
    ]
    found = read_letters(name_joints(found, draft), draft)
    found = as_input_and_output(without_relative(without_tool(found, draft), draft))
    found = group_by_word(split_supply(split_matrix(found, joints, draft)), joints, draft)
    found = group_by_kind(found, joints, urdf, draft)
    position = _measured_position(found, joints, draft)
    order = _joints(position, joints, urdf, draft)
    found = [label_by_name(each, order) for each in found]
    draft.recordings += recordings_of(runs, draft) if runs else recordings_in(files, draft)
    alone = position.meaning.quantity == "velocity"
    unit = "" if alone else position_unit(position, draft)
    time, turn = add_source(position.part, "states", draft, position.block.stem), 0.0
    if alone:
        speed = position
        position, unit, used = integrate_speeds(found, speed, order, time, draft)
        found = [position if each.block is speed.block else each for each in found]
    else:
        time = rate_by_velocity(found, position, order, unit, time, draft)
        states = {"source": "states", "position": quantity_of(position, order, unit, draft, "states")}
        draft.channels["states"] = states
        if turn := turn_of(position, unit):
            whole = take_turns_out(position, order, turn, states["position"], draft)
            found, position = _replaced(found, position, whole), whole
        if urdf is not None:
            within = move_into_limits(position, order, urdf, states["position"], draft)
            turn = turn or (0.0 if within is position else TURNS[unit])
            found, position = _replaced(found, position, within), within
        used = [position, *add_velocity(found, position, order, unit, time, states, draft)]
    commands = [] if "command" in draft.channels else add_command(found, position, order, unit, time, draft)
    if turn and commands:
        take_turns_out_beside(position, commands[0], order, turn, draft)
    used += commands + add_torque_switch(found, position, order, draft)
    used += add_effort(
        found,
        position,
        order,
        effort,
        draft,
        partial(_leaves_gravity_out, urdf, position, order, unit, time, draft),
    )
    if urdf is not None:
        _ask_model(urdf, position, order, unit, time, used, draft)
        velocity = next(
            (e for e in used[1:] if e.meaning.quantity == "velocity" and not e.meaning.commanded), None
        )
        set_sliding_units(draft, urdf, position, order, unit, velocity, time)
    draft.ask_with_position()
    for each in found:
        name, is_used = name_of(each), any(each.block is one.block for one in used)
        if not is_used and not any(line.startswith(f"{name}: ") for line in draft.unused):
            told = say_integral(each, unit, draft) if len(joints) > len(order) else ""
            draft.unused.append(name + told)
            draft.would_tell += [name + told] if told else []
    if runs:
        patterns = {path.name: pattern for path, pattern in runs[0].patterns.items()}
        for source in draft.sources.values():
            source["file"] = patterns[source["file"]]
    elif (beside := position.part.beside) and len(draft.recordings) == 1:
        draft.recordings = runs_beside.recordings_of(beside, draft.sources)
        apart = ", ".join(each["name"] for each in draft.recordings if each["role"] == "held_out")
        draft.note("recordings", f"{len(beside)} of them side by side in one file; {apart} is held out")
    return draft


def _replaced(found: list[NamedBlock], old: NamedBlock, new: NamedBlock) -> list[NamedBlock]:
    return [new if each.block is old.block else each for each in found]


def _ask_model(
    urdf: str,
    position: NamedBlock,
    order: list[str],
    unit: str,
    time: np.ndarray,
    used: Sequence[NamedBlock],
    draft: Draft,
) -> None:
    """Settle questions of order and units by the model's limits and torques, where there are any.

    Torques that follow the model's with the other sign are taken with a minus, and asked for.
    """
    effort = next((e for e in used if e.meaning.quantity == "effort" and shares_rows(e, position)), None)
    if effort is None and not any(guess.asks for guess in draft.guesses):
        return
    rows = position.block.rows.copy()
    if effort is not None:
        rows &= effort.block.rows
    tau = None if effort is None else effort.block.ordered(order)[rows[effort.block.rows]]
    if tau is not None and is_reversed(draft):
        tau = -tau
    seen = time[rows], position.block.ordered(order)[rows[position.block.rows]], unit
    told = told_by_model(urdf, draft.joints, *seen, tau)
    if told is not None and told.reversed and tau is not None:
        reverse_torque(draft, told)
        told = told_by_model(urdf, draft.joints, *seen, -tau)
    if told is not None:
        settle_by_model(draft, told, unit)


def _leaves_gravity_out(
    urdf: str | None,
    position: NamedBlock,
    order: list[str],
    unit: str,
    time: np.ndarray,
    draft: Draft,
    commanded: NamedBlock,
) -> bool:
    """Whether a commanded torque has no share of gravity: by libfranka's name, or by the model."""
    if words_in(commanded.block.stem)[:3] == ["tau", "j", "d"]:
        return True  # libfranka's RobotState: "without gravity"
    if urdf is None:
        return False
    rows = position.block.rows & commanded.block.rows
    q = position.block.ordered(order)[rows[position.block.rows]]
    tau = commanded.block.ordered(order)[rows[commanded.block.rows]]
    return is_without_gravity(urdf, draft.joints, time[rows], q, unit, tau)


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


def _meaning(part: LogPart, block: LogBlock, several: bool) -> NameMeaning:
    """Of the column; what it leaves open, of the part, and of the file where there are several."""
    if part.kind in ARM_MESSAGES:
        return ARM_MESSAGES[part.kind].meaning(block.stem)
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


def _measured_position(found: list[NamedBlock], joints: Sequence[str], draft: Draft) -> NamedBlock:
    found = [c for c in found if np.ptp(c.block.values, axis=0).any()] or found  # no switch is a position
    wanted = [
        c
        for c in found
        if c.meaning.quantity == "position" and not c.meaning.commanded and not c.meaning.computed
    ]
    reason = "the name says position"
    if wanted and all(is_output(c) and meaning(c.block.stem).quantity == "" for c in wanted):
        reason = "named as a system's output is, with an input `u` beside it"
    if wanted and all(is_group(c) for c in wanted):  # asked for already
        reason = ""
    if not wanted:  # LeRobot's observation.state, q, or a number alone
        wanted = [c for c in found if not c.meaning.quantity and c.meaning.measured]
        reason = "the name says a measured state"
    if not wanted:
        wanted = [c for c in found if words_in(c.block.stem)[:1] in (["q"], ["qm"], ["qj"], ["joint"], ["x"])]
        reason = "named as positions often are"
    if not wanted and joints:  # Baxter's joint_recorder: time,left_s0,left_s1,...
        wanted = [c for c in found if c.block.stem == SLOT and set(c.block.labels) <= set(joints)]
        reason = "its columns are named as the URDF's joints are"
    if not wanted:
        wanted = [c for c in found if c.meaning.quantity == "velocity" and not c.meaning.computed]
        wanted = [c for c in wanted if not c.meaning.commanded]
        reason = ""
    if not wanted:
        raise InputError(nothing_measured(found))
    fits = [c for c in wanted if joints and set(c.block.labels) & set(joints)] or wanted
    best = max(
        fits,
        key=lambda c: (
            len(set(c.block.labels) & set(joints)),
            c.part.kind == "sensor_msgs/msg/JointState",
            bool(np.ptp(c.block.values, axis=0).any()),
            # Joints beyond the URDF's, such as fingers, are worth nothing; a broadcaster's 1 kHz is.
            *((c.meaning.measured, len(c.block.values)) if joints else ()),
            len(c.block.labels),
            c.meaning.measured,
            len(c.block.values),
            not says_commanded(c.block.stem),  # of a state that an action repeats
        ),
    )
    rivals = [c for c in fits if c.block is not best.block and len(c.block.labels) == len(best.block.labels)]
    best, rivals = by_one_unit(best, rivals, draft)
    standard = best.part.kind == "sensor_msgs/msg/JointState"
    question = ""
    if rivals and not standard:
        others = list(dict.fromkeys(map(name_of, rivals)))
        more = f" or {len(others) - _NAMED} more" if len(others) > _NAMED else ""
        question = f"is {name_of(best)} the joint's position, and not {' or '.join(others[:_NAMED])}{more}?"
    elif best.block.stem == SLOT:
        question = (
            "are the columns that are named as joints their positions, and not speeds, torques or goals?"
        )
    elif reason not in ("", "the name says position"):
        question = f"is {name_of(best)} the measured position?"
    if reason or question:
        draft.note("channels.states.position", f"{name_of(best)}: {reason}", question)
    return best


def _joints(position: NamedBlock, joints: Sequence[str], urdf: str | None, draft: Draft) -> list[str]:
    """Labels of the log in the order of the recording's joints; sets the recording's names."""
    labels = position.block.labels
    there = [joint for joint in joints if joint in labels]
    if there:
        draft.joints = there
        chained = set() if urdf is None else chained_joints(urdf, there)
        missing = [joint for joint in joints if joint not in labels and joint in chained]
        question = (
            f"{', '.join(missing)} of the URDF are not in the log; do they stand still?" if missing else ""
        )
        draft.note("joints", "names that log and URDF share, in the URDF's order", question)
        return there
    if position.part.kind in ARM_MESSAGES and len(joints) >= len(labels) == len(
        arms := [label for label in labels_of_array(len(labels), joints) if label in joints]
    ):
        draft.joints = arms
        draft.note("joints", "the message counts the joints from the base to the flange")
        return list(labels)
    if position.block.stem in RTDE and set(labels) == set("012345") and (arms := universal_robots(joints)):
        draft.joints = list(arms)
        draft.note("joints", "Universal Robots' RTDE counts the joints from the base to wrist 3")
        return list("012345")
    if motors := unitree_motors(position.block.stem, labels, joints):
        draft.joints = list(motors)
        draft.note("joints", "Unitree counts its motors by leg, FR FL RR RL, and from hip to calf")
        return list(motors.values())
    numbered = numbered_joints(len(labels), joints)
    if numbered and sorted(labels) == sorted(str(k + 1) for k in range(len(labels))):
        draft.joints = list(numbered)
        draft.note("joints", "the log's numbers are those that the URDF's joints end with")
        return [str(k + 1) for k in range(len(labels))]
    if joints and len(joints) == len(labels):
        draft.joints = list(joints)
        shown = ", ".join(
            f"{label or position.block.stem} is {j}" for label, j in zip(labels, joints, strict=True)
        )
        # One column and one joint are each other's; which way it turns shows as a gap, if it is wrong.
        question = f"the log names no joints: {shown}?" if len(joints) > 1 else ""
        draft.note("joints", f"the URDF's, as many as the log has columns: {shown}", question, "order")
        return list(labels)
    if joints:
        draft.joints = [_joint_name(label, k) for k, label in enumerate(labels)]
        draft.note(
            "joints",
            "the log's names",
            f"the log has {', '.join(label or name_of(position) for label in labels)}, the URDF moves"
            f" {', '.join(joints)}: which is which? Take the URDF's names",
        )
        return list(labels)
    draft.joints = [_joint_name(label, k) for k, label in enumerate(labels)]
    draft.note("joints", "the log's names; there is no URDF", asked_of_still(position))
    return list(labels)


def _joint_name(label: str, number: int) -> str:
    return label if label and not label.isdecimal() else f"joint_{label or number + 1}"
