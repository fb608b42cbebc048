"""Channels of a draft: which columns are velocity, command and effort, and of what sources."""

from __future__ import annotations

from collections.abc import Callable
from itertools import takewhile
from typing import Any

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.arm_messages import (
    ARM_MESSAGES,
    CURRENTS_OF_UR,
    is_libfranka,
    is_unitree,
    universal_robots,
)
from samrl_ros.log_import.draft.joints.asked_efforts import (
    asked_of_effort,
    say_how_used,
    without_held,
    without_zeros,
)
from samrl_ros.log_import.draft.joints.commanded import rate_of_command, says_unit, unit_of_command
from samrl_ros.log_import.draft.joints.motor_input import (
    add_motor_current,
    add_motor_input,
    currents_of_motors,
    inputs_of_some,
    rank_input,
    say_supply,
    volts_of_motors,
)
from samrl_ros.log_import.draft.joints.named_sources import (
    NamedBlock,
    add_source,
    name_of,
    of_other_length,
    quantity_of,
    shares_rows,
)
from samrl_ros.log_import.draft.joints.told_by_model import with_minus
from samrl_ros.log_import.draft.joints.unnamed_matrix import is_group

# Arms with torque sensors behind the gears, by how their makers' packages name the joints.
_LINK_SENSORS = ("panda_joint", "fr3_joint", "fer_joint", "iiwa_joint", "lbr_", "lbr_iiwa", "rizon", "gen3_")
_OF_DRIVES = frozenset("motor motors drive drives actuator actuators".split())
_SAME = "in the position's unit, whatever that is"
_JOINT_STATE = "sensor_msgs/msg/JointState"
_RTDE_MODEL = "target_moment_{}"
_FOLLOWS = 0.8  # correlation from which a block is taken as what the arm followed
_MOVES_WITH = 0.98  # correlation from which a block of an unknown name is taken as the command, and asked for


def beside(
    found: list[NamedBlock], position: NamedBlock, order: list[str], quantity: str
) -> list[NamedBlock]:
    """Measured blocks of a quantity in the same part, with the same joints.

    First those that are marked as the position is: a log of `actual` positions may not repeat the word.
    A torque is called measured to tell it from the commanded one, beside plain positions.
    """
    there = [
        c
        for c in found
        if shares_rows(c, position)
        and c.meaning.quantity == quantity
        and not c.meaning.commanded
        and not c.meaning.computed
        and (position.meaning.measured or quantity == "effort" or not c.meaning.measured)
        and set(order) <= set(c.block.labels)
    ]
    stem = position.block.stem
    return sorted(
        there,
        key=lambda c: (
            c.meaning.measured != position.meaning.measured,
            -_alike(stem, c.block.stem),  # of DROID's two states, that of the position
        ),
    )


def _elsewhere(found: list[NamedBlock], position: NamedBlock, order: list[str]) -> list[NamedBlock]:
    """Measured torques of these joints in other topics or files, those named as the position's first."""
    there = [
        c
        for c in found
        if not shares_rows(c, position)
        and not of_other_length(c, position)
        and c.meaning.quantity == "effort"
        and not c.meaning.commanded
        and not c.meaning.computed
        and set(order) <= set(c.block.labels)
    ]
    place = _place(position)
    return sorted(there, key=lambda c: -_alike(place, _place(c)))


def _alike(one: str, other: str) -> int:
    """How many letters two names begin with alike."""
    return sum(1 for _ in takewhile(bool, map(str.__eq__, one, other)))


def _place(each: NamedBlock) -> str:
    return each.part.part or each.part.path.stem


def add_velocity(
    found: list[NamedBlock],
    position: NamedBlock,
    order: list[str],
    unit: str,
    time: np.ndarray,
    states: dict[str, Any],
    draft: Draft,
) -> list[NamedBlock]:
    """The measured velocity if it integrates to the position, else its derivative; the blocks used."""
    key = "channels.states.velocity"
    recorded = beside(found, position, order, "velocity")[:1]
    for each in recorded:
        both = each.block.rows & position.block.rows
        fit = evidence.fit_rate(
            time[both],
            position.block.ordered(order)[both[position.block.rows]],
            each.block.ordered(order)[both[each.block.rows]],
        )
        fitting = evidence.velocity_unit(unit, fit)
        if not fitting:
            draft.note(
                key,
                f"derivative of the position: {name_of(each)} is not its rate (correlation"
                f" {fit.correlation:.2f}, ratio {fit.ratio:.3g})",
                if_other=evidence.in_other_units(unit, fit),
            )
            continue
        draft.note(
            key, f"{name_of(each)}: integrates to the position (ratio {fit.ratio:.3g}), so {fitting}",
            if_other=evidence.in_other_units(unit, fit) or _SAME,
        )  # fmt: skip
        states["velocity"] = quantity_of(each, order, fitting, draft, "states")
        return [each]
    if not recorded:
        draft.note(key, "derivative of the position: none was recorded")
    states["velocity"] = "derivative"
    return []


def add_command(
    found: list[NamedBlock],
    position: NamedBlock,
    order: list[str],
    unit: str,
    time: np.ndarray,
    draft: Draft,
) -> list[NamedBlock]:
    """The commanded position, with velocity and acceleration of a ROS topic; the blocks used."""
    commanded = [
        c
        for c in found
        if c.meaning.commanded and not c.meaning.computed and set(order) <= set(c.block.labels)
        and not of_other_length(c, position)
    ]  # fmt: skip
    wanted = [c for c in commanded if c.meaning.quantity == "position" or _moves_unnamed(c)]
    if not wanted:
        return _add_follower(found, position, order, unit, time, draft)
    best = max(wanted, key=lambda c: (c.meaning.quantity == "position", len(c.block.values)))
    key = "channels.command.position"
    same = shares_rows(best, position)
    source = "states" if same else "command"
    other = time if same else add_source(best.part, source, draft)
    near = evidence.follows(
        time[position.block.rows],
        position.block.ordered(order),
        other[best.block.rows],
        best.block.ordered(order),
    )
    question = (
        "" if near >= _FOLLOWS else f"the arm hardly follows {name_of(best)}: is it the commanded position?"
    )
    draft.note(
        key, f"{name_of(best)}: the name says commanded; correlation with the position {near:.2f}", question,
        if_other="" if says_unit(best) else _SAME,
    )  # fmt: skip
    unit = unit_of_command(best, position, order, unit, draft)
    channel = {"source": source, "position": quantity_of(best, order, unit, draft, source)}
    draft.channels["command"] = channel
    used = [best]
    for quantity in ("velocity", "acceleration"):
        more = [c for c in commanded if c.part is best.part and c.meaning.quantity == quantity]
        if more and best.part.ros:
            draft.note(f"channels.command.{quantity}", f"{name_of(more[0])}, in SI units (REP-103)")
            suffix = {"velocity": "rad/s", "acceleration": "rad/s2"}[quantity]
            channel[quantity] = quantity_of(more[0], order, suffix, draft, source)
            used.append(more[0])
        elif quantity == "velocity" and (told := rate_of_command(more, best, order, unit, other)):
            rate, rate_unit, fit = told
            draft.note(
                "channels.command.velocity",
                f"{name_of(rate)}: integrates to the commanded position (ratio {fit.ratio:.3g}),"
                f" so {rate_unit}",
                if_other="" if says_unit(best) else evidence.in_other_units(unit, fit, "that") or _SAME,
            )  # fmt: skip
            channel[quantity] = quantity_of(rate, order, rate_unit, draft, source)
            used.append(rate)
    return used


def _moves_unnamed(each: NamedBlock) -> bool:
    """Whether a block whose name says no quantity changes at all: a `command_id` of zeros is none."""
    return not each.meaning.quantity and bool(np.ptp(each.block.values, axis=0).any())


def _add_follower(
    found: list[NamedBlock],
    position: NamedBlock,
    order: list[str],
    unit: str,
    time: np.ndarray,
    draft: Draft,
) -> list[NamedBlock]:
    """A block beside the position that moves with it, under a name that says nothing."""
    measured_at, measured = time[position.block.rows], position.block.ordered(order)
    for each in found:
        silent = not (each.meaning.quantity or each.meaning.computed or each.meaning.measured)
        beside = shares_rows(each, position) and each.block is not position.block
        if not silent or not beside or len(each.block.labels) != len(order):
            continue
        near = evidence.follows(measured_at, measured, time[each.block.rows], each.block.values)
        scale = float(np.ptp(each.block.values) / max(np.ptp(position.block.values), 1e-12))
        if near > _MOVES_WITH and 0.5 < scale < 2.0:
            draft.note(
                "channels.command.position",
                f"{name_of(each)}: moves with the position (correlation {near:.4f})",
                f"is {name_of(each)} the commanded position?",
                if_other=_SAME,
            )
            labels = list(each.block.labels) if each.block.labels != position.block.labels else order
            quantity = quantity_of(each, labels, unit, draft, "states")
            draft.channels["command"] = {"source": "states", "position": quantity}
            return [each]
    draft.note("channels.command", "no commanded positions were found")
    return []


def add_effort(
    found: list[NamedBlock],
    position: NamedBlock,
    order: list[str],
    effort: Effort,
    draft: Draft,
    leaves_gravity_out: Callable[[NamedBlock], bool],
) -> list[NamedBlock]:
    """Measured efforts where they belong, with a question where nothing says where; the blocks used.

    Args:
        found: blocks of the log.
        position: the measured one.
        order: labels of the joints.
        effort: what measured efforts are.
        draft: what is added to.
        leaves_gravity_out: whether a commanded torque shows that the robot adds gravity's to it.
    """
    if effort is Effort.passive:
        draft.note("channels.commanded_effort.effort", "as stated: nothing drives the joints")
        draft.channels["commanded_effort"] = {"source": "states", "effort": [0.0] * len(order)}
        return []
    found = without_zeros(found, draft)
    currents = [c for c in found if c.meaning.quantity in ("current", "voltage", "pressure")]
    measured = beside(found, position, order, "effort") or _elsewhere(found, position, order)
    measured = without_held(measured, position, draft)
    if not measured and effort is not Effort.none:
        inputs = [c for q in ("voltage", "current") for c in beside(found, position, order, q)]
        electric = [c for c in currents if c.meaning.quantity != "pressure"]
        inputs += [c for c in electric if c.meaning.commanded and set(order) <= set(c.block.labels)]
        inputs.sort(key=rank_input, reverse=True)
        inputs = inputs or inputs_of_some(electric, position, order)
        if inputs and "command" not in draft.channels:
            say_supply(electric, inputs[0], draft)
            return add_motor_input(inputs[0], position, order, draft)
    how_used = [say_how_used(each) for each in currents]
    draft.unused += how_used
    behind = measured and _measure_behind_gears(measured[0], draft)
    link = effort is Effort.link or (effort is Effort.ask and bool(behind))
    if commanded := _add_commanded_effort(found, position, order, draft, leaves_gravity_out):
        if not (measured and link):
            draft.unused += [f"{name_of(each)}: beside the commanded torque" for each in measured]
            return [commanded, *measured[:1], *currents]
    elif not measured or effort is Effort.none:
        if not measured and effort is not Effort.none:
            if motors := currents_of_motors(currents, position, order):
                draft.unused.remove(say_how_used(motors[0]))
                return add_motor_current(motors[0], position, order, draft)
            if motors := volts_of_motors(currents, position, order):
                draft.unused.remove(say_how_used(motors[0]))
                return add_motor_input(motors[0], position, order, draft)
        if not measured:
            left = ", ".join(map(name_of, currents))
            undriven = "command" not in draft.channels and effort is Effort.ask
            question = "what drives the joints, neither command nor effort? If nothing, say --effort passive"
            reason = f"no efforts are used, {left} is left out" if left else "no efforts were found"
            draft.note("channels.states.effort", reason, question if undriven else "")
            draft.would_tell += how_used
        return currents
    best = measured[0]
    source = "states"
    if not shares_rows(best, position):
        source = "effort"
        add_source(best.part, source, draft)
        if order == [""]:  # one joint without a label: any force beside it would do
            where = f"channels.{'states' if link else 'commanded_effort'}.effort"
            draft.note(where, "of another file or topic", f"is {name_of(best)} what drives this joint?")
    unit, is_told = _torque_unit(best)
    unit_question = "" if is_told else f"is {name_of(best)} in N m?"
    if may_be_currents := best.part.kind == _JOINT_STATE and bool(universal_robots(draft.joints)):
        unit_question = f"{CURRENTS_OF_UR}; is {name_of(best)} a torque in N m at the joints?"
    quantity = quantity_of(best, order, unit, draft, source)
    if best.part.kind in ARM_MESSAGES and ARM_MESSAGES[best.part.kind].reaction:
        with_minus(quantity)
        draft.note("channels.states.effort", "these sensors give the reaction, so with a minus")
    if link:
        if source != "states":
            quantity["source"] = source
        reason = "as stated" if effort is Effort.link else "these arms measure torque behind the gears"
        draft.note("channels.states.effort", f"{name_of(best)}: {reason}", unit_question, "torque_unit")
        draft.channels["states"]["effort"] = quantity
        return [best, *([commanded] if commanded else []), *currents]
    is_open = effort is Effort.ask
    draft.note(
        "channels.commanded_effort.effort",
        f"{name_of(best)}: {'what is left' if is_group(best) else 'the name says effort'}",
        asked_of_effort(best, position, may_be_currents) if is_open else unit_question,
        "" if is_open else "torque_unit",
    )
    draft.channels["commanded_effort"] = {"source": source, "effort": quantity}
    return [best, *currents]


def _torque_unit(best: NamedBlock) -> tuple[str, bool]:
    """Unit of a torque, and whether the log tells it: messages of ROS by their type, others by the name."""
    known = best.part.ros or is_unitree(best.block.stem)
    known = known or is_libfranka([block.stem for block in best.part.blocks])
    unit = "" if known else best.meaning.unit
    return unit or "N m", bool(known or unit)


def _measure_behind_gears(torque: NamedBlock, draft: Draft) -> bool:
    """Whether the message, or the joints' names, are those of arms with torque sensors at the links.

    A torque that is called a motor's is not that of a sensor.
    """
    if torque.part.kind in ARM_MESSAGES:
        return True
    of_drive = bool(_OF_DRIVES & set(words_in(torque.block.stem)))
    return not of_drive and all(name.startswith(_LINK_SENSORS) for name in draft.joints)


def _add_commanded_effort(
    found: list[NamedBlock],
    position: NamedBlock,
    order: list[str],
    draft: Draft,
    leaves_gravity_out: Callable[[NamedBlock], bool],
) -> NamedBlock | None:
    """A torque whose name says that it was commanded; None where there is none, or one without gravity."""
    there = [
        c
        for c in found
        if shares_rows(c, position)
        and c.meaning.quantity == "effort"
        and c.meaning.commanded
        and not c.meaning.computed
        and set(order) <= set(c.block.labels)
    ]
    if not there:
        return None
    best = there[0]
    if best.block.stem == _RTDE_MODEL:
        draft.unused.append(f"{name_of(best)}: by RTDE's guide of the robot's own model, which no drive gave")
        return None
    if leaves_gravity_out(best):
        draft.unused.append(
            f"{name_of(best)}: commanded without the gravity that the robot adds itself; add that, then use"
            " it as commanded_effort"
        )
        return None
    unit, is_told = _torque_unit(best)
    question = "" if is_told else f"is {name_of(best)} in N m, at the joints, with gravity's share?"
    if rivals := [name_of(each) for each in there[1:] if each.block.labels == best.block.labels]:
        question = f"{question} Is it what the drives were asked for, and not {' or '.join(rivals)}?".strip()
    reason = f"{name_of(best)}: the name says a commanded torque"
    draft.note("channels.commanded_effort.effort", reason, question, "torque_unit")
    quantity = quantity_of(best, order, unit, draft, "states")
    draft.channels["commanded_effort"] = {"source": "states", "effort": quantity}
    return best
