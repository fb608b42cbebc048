"""Volts or amperes of motors without a loop, of which some joints may have none."""

from __future__ import annotations

from collections.abc import Sequence

from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import (
    NamedBlock,
    add_source,
    name_of,
    quantity_of,
    shares_rows,
)


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


def add_motor_input(
    best: NamedBlock, position: NamedBlock, order: list[str], draft: Draft
) -> list[NamedBlock]:
    """Volts or amperes of a motor without a loop as what was commanded; its constants are asked for."""
    by_current = best.meaning.quantity == "current"
    known = ("A", "mA") if by_current else ("V", "mV")
    unit = best.meaning.unit if best.meaning.unit in known else known[0]
    same = shares_rows(best, position)
    if not same:
        add_source(best.part, "commanded_effort", draft)
    source = "states" if same else "commanded_effort"
    said = f"in {unit}" if best.meaning.unit in known else f"taken for {unit}"
    draft.note(
        "channels.commanded_effort.effort", f"{name_of(best)}: a motor's {best.meaning.quantity}, {said}",
        "" if best.meaning.unit in known else f"is it in {unit}, signed, and what drives the motor?",
    )  # fmt: skip
    driven = _driven(best, order)
    quantity = quantity_of(best, [label for label, _ in driven], unit.removeprefix("m"), draft, source)
    if unit.startswith("m"):
        quantity["formula"] = [f"0.001 * {formula}" for formula in quantity["formula"]]
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
        "controller", "a motor whose input is recorded, without a loop",
        f"what are {asked}, gear ratio and rotor inertia [kg m2] of the motor? These are placeholders",
    )  # fmt: skip
    if len(driven) < len(order):
        names = [draft.joints[place] for _, place in driven]
        others = ", ".join(joint for joint in draft.joints if joint not in names)
        draft.note(
            "controller", f"inputs of {len(driven)} of {len(order)} joints",
            f"does {name_of(best)} drive {', '.join(names)}, and nothing {others}?",
        )  # fmt: skip
    return [best]


def _driven(best: NamedBlock, order: list[str]) -> list[tuple[str, int]]:
    """The input's labels and the places of the joints that they drive; without a label it is the first."""
    labels = best.block.labels
    if len(labels) < len(order) and not set(labels) <= set(order):
        return [(labels[0], 0)]
    return [(label, place) for place, label in enumerate(order) if label in labels]
