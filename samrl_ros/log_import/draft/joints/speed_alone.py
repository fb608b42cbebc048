"""Motors of which a speed was logged and no angle: their position is the speed's integral, from zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of, quantity_of
from samrl_ros.log_import.formulas import integral

_POSITIONS = {
    "rad/s": ("rad", 1.0),
    "deg/s": ("deg", 1.0),
    "rpm": ("rev", 60.0),
    "mm/s": ("mm", 1.0),
}  # unit, speeds in one
_SAME = "its unit is what is asked there"
_FAST = 100.0  # [rad/s] a speed beyond which is rather in rpm


def integrate_speeds(
    found: Sequence[NamedBlock], speed: NamedBlock, order: list[str], time: np.ndarray, draft: Draft
) -> tuple[NamedBlock, str, list[NamedBlock]]:
    """Drafts states, and a command if one was logged, of speeds alone.

    Args:
        found: blocks of the log.
        speed: the measured one.
        order: labels of the joints.
        time: of the log's rows [s].
        draft: what is added to.

    Returns:
        The position as a block, its unit, and the blocks used.
    """
    unit = _unit_of(speed, draft)
    place, count = _POSITIONS[unit]
    states = quantity_of(speed, order, unit, draft, "states")
    draft.note("channels.states.velocity", f"{name_of(speed)}: the name says velocity", if_other=_SAME)
    draft.channels["states"] = {
        "source": "states", "position": _integrals(states["formula"], place, count), "velocity": states,
    }  # fmt: skip
    values = integral(speed.block.values, time[speed.block.rows]) / count
    position = replace(speed, block=replace(speed.block, values=values))
    used = [position]
    commanded = [
        c
        for c in found
        if c.part is speed.part
        and c.meaning.quantity == "velocity"
        and c.meaning.commanded
        and not c.meaning.computed
        and set(order) <= set(c.block.labels)
    ]
    if commanded:
        sent = quantity_of(commanded[0], order, unit, draft, "states")
        draft.note(
            "channels.command.velocity", f"{name_of(commanded[0])}: the name says commanded", if_other=_SAME
        )
        draft.channels["command"] = {
            "source": "states", "position": _integrals(sent["formula"], place, count), "velocity": sent,
        }  # fmt: skip
        used.append(commanded[0])
    return position, place, used


def say_integral(each: NamedBlock, unit: str, draft: Draft) -> str:
    """What makes a joint of an unused column that is a speed, as a wheel's; empty of any other.

    Args:
        each: block of the log that went nowhere.
        unit: of the positions beside it, as formulas of one quantity have one unit.
        draft: whose reasons say of which speeds a position was found.
    """
    told, name = each.meaning, name_of(each)
    if told.quantity != "velocity" or told.commanded or told.computed or len(each.block.columns) != 1:
        return ""
    if any(name in guess.reason for guess in draft.guesses):
        return ""
    words = words_in(each.block.stem)
    own = next((one for one in ("rpm", "rad", "deg", "mm") if one in words), "")
    ratio = evidence.ratio_of(unit, own if own == "rpm" else f"{own}/s")
    factor = f"{ratio:.6g} * " if ratio is not None and ratio != 1.0 else ""
    return (
        f": a speed without a position. If it is a joint's, add that to `joints`, {factor}integral(x, time)"
        f" to the formulas of the position ({unit}) and {factor}x to those of the velocity"
        f"{'' if ratio is not None else ', both in its units'}, x being this column"
    )


def _integrals(formulas: Sequence[str], unit: str, count: float) -> dict[str, object]:
    divided = "" if count == 1.0 else f" / {count:g}"
    return {"formula": [f"integral({formula}, time){divided}" for formula in formulas], "unit": unit}


def _unit_of(speed: NamedBlock, draft: Draft) -> str:
    """Unit of a speed, by its name; asked for where the name does not say it."""
    key, words = "channels.states.position", words_in(speed.block.stem)
    said = (
        "rpm" if "rpm" in words else next((f"{unit}/s" for unit in ("rad", "deg", "mm") if unit in words), "")
    )
    largest = float(np.abs(speed.block.values).max())
    unit = said or ("rpm" if largest > _FAST else "rad/s")
    question = "" if said else f"is {name_of(speed)} in {unit}, and not rad/s, deg/s or rpm?"
    draft.note(key, f"the integral of {name_of(speed)}, in {unit}: no position was logged", question, "speed")
    return unit
