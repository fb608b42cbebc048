"""Volts or amperes of motors, of which some joints may have none: their constants are asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import (
    NamedBlock,
    add_source,
    column_alone,
    name_of,
    of_other_length,
    quantity_of,
    shares_rows,
)

_RTDE_CURRENT = "actual_current_{}"  # Universal Robots state no torque constants
TORQUE_CONSTANT = "torque_constant"  # what is asked of a current or voltage beside a command
_OF_LOOP = (
    ". Where the loop's gains are known, state them: a voltage_servo or position_servo has the motor's keys,"
    " too; --effort none leaves the input out"
)
_SUPPLY = frozenset("in input supply battery batt bus".split())
_DUTY = frozenset("duty pwm".split())
_FULL_DUTIES = (1.0, 100.0, 255.0, 1023.0, 4095.0, 32767.0)  # a share, %, and timers of 8 to 16 bits
_WHOLE_DUTIES = _FULL_DUTIES[2:]


def inputs_of_some(
    electric: Sequence[NamedBlock], position: NamedBlock, order: list[str]
) -> list[NamedBlock]:
    """Inputs of fewer motors than there are joints, as of a pendulum behind a servo, in the same rows."""
    return [
        each
        for each in electric
        if shares_rows(each, position)
        and not each.meaning.computed
        and len(each.block.labels) < len(order)
        and (each.block.labels == ("",) or set(each.block.labels) <= set(order))
        and has_both_signs(each)
    ]


def has_both_signs(electric: NamedBlock) -> bool:
    """Whether a motor may be driven by it: what has one sign alone is a supply's (`input_voltage`)."""
    return bool(electric.block.values.min() < 0.0 < electric.block.values.max())


def is_supplys(electric: NamedBlock) -> bool:
    """Whether a name says what a supply gives, such as a VESC's `current_in` and `input_voltage`."""
    return bool(_SUPPLY & set(words_in(electric.block.stem)))


def rank_input(electric: NamedBlock) -> tuple[bool, bool, bool, bool]:
    """How likely it is that a column drives a motor; a duty cycle less than volts or amperes."""
    words = set(words_in(electric.block.stem))
    return not is_supplys(electric), has_both_signs(electric), "d" not in words, not _DUTY & words


def split_supply(found: Sequence[NamedBlock]) -> list[NamedBlock]:
    """With a motor's current and its supply's apart, `current_motor` and `current_in`: they are no joints."""
    out: list[NamedBlock] = []
    for each in found:
        block = each.block
        electric = each.meaning.quantity in ("current", "voltage")
        if not electric or not _SUPPLY & set(block.labels) or len(block.columns) != len(block.labels):
            out.append(each)
            continue
        out += [column_alone(each, k) for k in range(len(block.columns))]
    return out


def currents_of_motors(
    electric: Sequence[NamedBlock], position: NamedBlock, order: list[str]
) -> list[NamedBlock]:
    """Measured currents that torque constants make efforts, those beside the position first."""
    measured = [
        each
        for each in electric
        if each.meaning.quantity == "current"
        and not each.meaning.commanded
        and each.block.stem != _RTDE_CURRENT
    ]
    return _inputs_of_motors(measured, position, order)


def volts_of_motors(
    electric: Sequence[NamedBlock], position: NamedBlock, order: list[str]
) -> list[NamedBlock]:
    """Signed voltages or duty cycles of motors, those in volts first."""
    signed = [each for each in electric if each.meaning.quantity == "voltage" and has_both_signs(each)]
    return _inputs_of_motors(signed, position, order)


def _inputs_of_motors(
    electric: Sequence[NamedBlock], position: NamedBlock, order: list[str]
) -> list[NamedBlock]:
    """Those of the joints' motors, not of a supply; beside the position first, then as likely as they are."""
    there = [
        each
        for each in electric
        if not each.meaning.computed
        and not is_supplys(each)
        and not of_other_length(each, position)
        and (set(order) <= set(each.block.labels) or bool(inputs_of_some([each], position, order)))
    ]
    return sorted(there, key=lambda each: (shares_rows(each, position), rank_input(each)), reverse=True)


def add_motor_current(
    best: NamedBlock, position: NamedBlock, order: list[str], draft: Draft
) -> list[NamedBlock]:
    """A motor's current beside a command as its effort, once the torque constant is stated."""
    same = shares_rows(best, position)
    source = "states" if same else "commanded_effort"
    if not same:
        add_source(best.part, source, draft)
    driven = _driven(best, order)
    quantity = quantity_of(best, [label for label, _ in driven], "N m", draft, source)
    factor = "0.001 * " if best.meaning.unit == "mA" else ""
    formulas = {
        place: f"1.0 * {factor}{formula}"
        for (_, place), formula in zip(driven, quantity["formula"], strict=True)
    }
    quantity["formula"] = [formulas.get(place, 0) for place in range(len(order))]
    draft.channels["commanded_effort"] = {"source": source, "effort": quantity}
    unsigned = "" if has_both_signs(best) else " It has one sign alone: a magnitude is no effort"
    draft.note(
        "channels.commanded_effort.effort",
        f"no efforts were found, but {name_of(best)}: a motor's current",
        "what is each motor's torque constant times gear ratio [N m/A, of what slides N/A]? The factors 1.0"
        f" are placeholders; --effort none leaves the current out.{unsigned}",
        TORQUE_CONSTANT,
    )
    return [best]


def say_supply(inputs: Sequence[NamedBlock], used: NamedBlock, draft: Draft) -> None:
    """What is not used beside a motor's input: another of its signals, or its supply's."""
    for each in inputs:
        if each.block is not used.block:
            why = "of the supply, not of the motor" if is_supplys(each) else f"beside {name_of(used)}"
            draft.unused.append(f"{name_of(each)}: {why}")


def add_motor_input(
    best: NamedBlock, position: NamedBlock, order: list[str], draft: Draft
) -> list[NamedBlock]:
    """Volts, a duty cycle or amperes of a motor as what was commanded; its constants are asked for.

    Beside a command a loop has chosen them, which the draft does not know.
    """
    by_current = best.meaning.quantity == "current"
    known = ("A", "mA") if by_current else ("V", "mV")
    unit = best.meaning.unit if best.meaning.unit in known else known[0]
    same, followed = shares_rows(best, position), "command" in draft.channels
    if not same:
        add_source(best.part, "commanded_effort", draft)
    source = "states" if same else "commanded_effort"
    said, question = f"in {unit}", ""
    factor = "0.001 * " if unit.startswith("m") else ""
    if _DUTY & set(words_in(best.block.stem)) and best.meaning.unit not in known:
        full = _full_duty(best)
        factor = f"12.0 / {full:g} * "
        said = f"a duty cycle, up to {np.abs(best.block.values).max():g}"
        question = (
            f"how many volts does the motor get at full scale, and at which number is that? 12 V at {full:g}"
            " are placeholders"
        )
    elif best.meaning.unit not in known:
        said, question = f"taken for {unit}", f"is it in {unit}, signed, and what drives the motor?"
    draft.note(
        "channels.commanded_effort.effort",
        f"{name_of(best)}: a motor's {best.meaning.quantity}, {said}",
        question,
    )
    driven = _driven(best, order)
    quantity = quantity_of(best, [label for label, _ in driven], unit.removeprefix("m"), draft, source)
    quantity["formula"] = [f"{factor}{formula}" for formula in quantity["formula"]]
    formulas = dict(zip((place for _, place in driven), quantity["formula"], strict=True))
    quantity["formula"] = [formulas.get(place, 0) for place in range(len(order))]
    draft.channels["commanded_effort"] = {"source": source, "effort": quantity}
    constants = {"torque_constant": 1.0, "resistance": 1.0, "gear_ratio": 1.0, "rotor_inertia": 0.0}
    zero = {"torque_constant", "rotor_inertia"}  # of a joint without a motor
    if by_current:
        del constants["resistance"]
    draft.controller = {"type": "current_motor" if by_current else "voltage_motor"}
    draft.controller |= {
        key: [value if place in formulas or key not in zero else 0.0 for place in range(len(order))]
        for key, value in constants.items()
    }
    asked = "torque constant [N m/A]" + ("" if by_current else ", resistance [ohm]")
    draft.note(
        "controller",
        f"a motor whose input is recorded, {'beside a command' if followed else 'without a loop'}",
        f"what are {asked}, gear ratio and rotor inertia [kg m2] of the motor? These are placeholders"
        f"{_OF_LOOP if followed else ''}",
        TORQUE_CONSTANT if followed else "",
    )  # fmt: skip
    if len(driven) < len(order):
        names = [draft.joints[place] for _, place in driven]
        others = ", ".join(joint for joint in draft.joints if joint not in names)
        draft.note(
            "controller", f"inputs of {len(driven)} of {len(order)} joints",
            f"does {name_of(best)} drive {', '.join(names)}, and nothing {others}?",
        )  # fmt: skip
    return [best]


def _full_duty(duty: NamedBlock) -> float:
    """The number at which a duty cycle is likely to be full."""
    values, words = duty.block.values, words_in(duty.block.stem)
    largest = float(np.abs(values).max())
    if "%" in duty.block.stem or {"percent", "pct"} & set(words):
        return 100.0
    scales = _WHOLE_DUTIES if (values == np.round(values)).all() else _FULL_DUTIES
    return next((scale for scale in scales if scale >= largest), largest)


def _driven(best: NamedBlock, order: list[str]) -> list[tuple[str, int]]:
    """The input's labels and the places of the joints that they drive; without a label it is the first."""
    labels = best.block.labels
    if len(labels) < len(order) and not set(labels) <= set(order):
        return [(labels[0], 0)]
    return [(label, place) for place, label in enumerate(order) if label in labels]
