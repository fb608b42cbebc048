"""A commanded position's own unit, and the velocity that was commanded with it."""

from __future__ import annotations

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of

_AS_LARGE = 4.0  # times a measured position's span: beyond, a command without a unit is in another one
_UNITS = ("rad", "deg", "mm")


def unit_of_command(
    command: NamedBlock, position: NamedBlock, order: list[str], unit: str, draft: Draft
) -> str:
    """Unit of a commanded position: its name's, else the measured one's if the numbers are as large."""
    key = "channels.command.position"
    if says_unit(command) and command.meaning.unit != unit:
        draft.note(key, f"{name_of(command)} in {command.meaning.unit}: its name says so")
        return command.meaning.unit
    spans = np.ptp(command.block.ordered(order), axis=0), np.ptp(position.block.ordered(order), axis=0)
    moving = (spans[0] > 0.0) & (spans[1] > 0.0)
    scale = float(np.median(spans[0][moving] / spans[1][moving])) if moving.any() else 1.0
    if not 1.0 / _AS_LARGE < scale < _AS_LARGE:
        draft.note(
            key, f"{name_of(command)} moves {scale:.3g} times as far as {name_of(position)}",
            f"is {name_of(command)} in {unit}, as {name_of(position)} is? It moves {scale:.3g} times as far",
        )  # fmt: skip
    return unit


def says_unit(command: NamedBlock) -> bool:
    """Whether a command's name says its unit, so that it does not rest on the position's."""
    return command.meaning.unit in _UNITS


def rate_of_command(
    rates: list[NamedBlock], command: NamedBlock, order: list[str], unit: str, time: np.ndarray
) -> tuple[NamedBlock, str, evidence.RateFit] | None:
    """The commanded velocity that integrates to the commanded position, its unit and how it fits."""
    for each in rates:
        if not set(order) <= set(each.block.labels) or len(each.block.rows) != len(command.block.rows):
            continue
        both = each.block.rows & command.block.rows
        fit = evidence.fit_rate(
            time[both],
            command.block.ordered(order)[both[command.block.rows]],
            each.block.ordered(order)[both[each.block.rows]],
        )
        if fitting := evidence.velocity_unit(unit, fit):
            return each, fitting, fit
    return None
