"""The rate of a log without a clock, as its velocities tell it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.channels import beside
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of

_ROUND = 0.01  # relative distance from a whole number of Hz up to which the rate is that number


def rate_by_velocity(
    found: Sequence[NamedBlock],
    position: NamedBlock,
    order: list[str],
    unit: str,
    time: np.ndarray,
    draft: Draft,
) -> np.ndarray:
    """Times [s] (N,) at the rate at which a velocity beside the position is its derivative.

    Only where the log has no clock and the draft asks for its rate: robomimic, Isaac Lab, arrays of NumPy.
    The question stays, as the velocity's unit may be another one.

    Args:
        found: blocks of the log.
        position: the measured one.
        order: labels of the joints.
        unit: of the position.
        time: (N,) [s] at the rate that stands in for the unknown one.
        draft: what is added to.
    """
    if not any(guess.asks == "rate" for guess in draft.guesses):
        return time
    for each in beside(list(found), position, order, "velocity")[:1]:
        both = each.block.rows & position.block.rows
        q = position.block.ordered(order)[both[position.block.rows]]
        fit = evidence.fit_rate(time[both], q, each.block.ordered(order)[both[each.block.rows]])
        if fit.correlation < evidence.AGREES or fit.ratio <= 0.0 or each.meaning.unit not in ("", unit):
            continue
        placeholder = draft.sources["states"]["time"]["rate_hz"]
        rate = placeholder / fit.ratio
        rate = float(round(rate)) if abs(rate - round(rate)) < _ROUND * rate else float(f"{rate:.3g}")
        draft.sources["states"]["time"]["rate_hz"] = rate
        draft.ask_anew(
            "rate",
            f"{name_of(each)} in {unit}/s is the derivative of {name_of(position)} at {rate:g} Hz",
            f"is the rate {rate:g} Hz?",
        )
        return time * (placeholder / rate)
    return time
