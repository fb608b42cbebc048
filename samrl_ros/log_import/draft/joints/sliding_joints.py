"""Sliding joints of a described machine: their columns are in m or mm, beside angles in deg or rad."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from samrl_core.diagnosis.recordings.units import joint_kinds
from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock

_LENGTHS = {"m": ("", 1.0), "mm": ("0.001 * ", 1e-3)}  # unit: factor in a formula, in numbers
_ANGLES = {"rad": ("", 1.0), "deg": ("pi / 180 * ", np.pi / 180.0), "rev": ("2 * pi * ", 2.0 * np.pi)}
_RATES = {"rad/s": ("", 1.0), "deg/s": ("pi / 180 * ", np.pi / 180.0), "rpm": ("pi / 30 * ", np.pi / 30.0)}
_RATES["rev/s"] = _ANGLES["rev"]
_SAME_RATE = {"rad": "rad/s", "deg": "deg/s", "rev": "rev/s"}
_RATIOS = (1.0, 1000.0, 0.001)  # of a length's rate to a speed: the same unit, or mm beside m/s
_NAMED = re.compile(r"[\[(]\s*(mm?)\s*[\])]$|_(mm?)$")
_SLACK = 0.1  # of a joint's travel or turn, beyond its limits, that zeros and soft stops may account for
_USES = 0.1  # of its travel: less is a joint at rest, or numbers in a unit that is too small
_NEAR = 0.15  # by which the ratio of a velocity to its position's rate may miss one of those


def set_sliding_units(
    draft: Draft,
    urdf: str,
    position: NamedBlock,
    order: Sequence[str],
    unit: str,
    velocity: NamedBlock | None,
    time: np.ndarray,
) -> None:
    """Give turning and sliding joints a unit of their own; without a sliding joint nothing changes.

    Of m and mm, that which keeps a sliding joint within its limits is taken, and asked for where none does;
    ROS messages are in m. One unit alone that keeps the turning joints within theirs is asked for no more.

    Args:
        draft: whose quantities become rad and m.
        urdf: text.
        position: measured, in the log's units.
        order: labels of the joints, as the formulas and the draft's joints are.
        unit: of angles, as drafted so far.
        velocity: the measured one, if the draft uses one.
        time: (N,) [s] of the position's rows.
    """
    kinds = joint_kinds(urdf)
    described = [kinds.get(joint) for joint in draft.joints]
    slides = [kind is not None and kind.prismatic for kind in described]
    if not any(slides) or unit not in _ANGLES or position.part.ros:
        return
    moving = [k for k in range(len(order)) if slides[k]]
    names = ", ".join(draft.joints[k] for k in moving)
    if unit == "rev":
        question = (
            f"{names} slide: what is their travel for each turn [m], and of which motors? Multiply by it"
        )
        draft.note("channels.states.position", "turns, and the URDF has sliding joints", question)
        return
    values = position.block.ordered(list(order))
    named = [_named_at(position, order[k]) for k in moving]
    lengths = [said or _length(values[:, k], described[k]) for k, said in zip(moving, named, strict=True)]
    open_ones = [draft.joints[k] for k, length in zip(moving, lengths, strict=True) if not length]
    lengths = [length or "m" for length in lengths]
    draft.note(
        "channels.states.position",
        f"the URDF lets {names} slide; {_by(named)} in {', '.join(lengths)}",
        f"is {', '.join(open_ones)} in m? It slides" if open_ones else "",
    )
    fits = [
        [name for name, (_, factor) in _ANGLES.items() if _within(values[:, k] * factor, described[k])]
        for k in range(len(order))
    ]
    turning = [fits[k] for k in range(len(order)) if not slides[k]]
    if turning and [each for each in _ANGLES if all(each in fit for fit in turning)] == [unit]:
        draft.settle("unit", f"{unit}: in any other unit the joints leave the URDF's limits")
    elif not turning and not open_ones:
        draft.settle("unit", "all joints slide")
    units = [_LENGTHS[lengths[moving.index(k)]] if slides[k] else _ANGLES[unit] for k in range(len(order))]
    for channel in ("states", "command"):
        if isinstance(quantity := draft.channels.get(channel, {}).get("position"), dict):
            _rescale(quantity, [text for text, _ in units], "rad")
    states, command = draft.channels["states"], draft.channels.get("command", {})
    if isinstance(measured := states.get("velocity"), dict) and velocity is not None:
        rates = velocity.block.ordered(list(order))
        ratios = [_ratio(time, values[:, k], rates[:, k]) if slides[k] else 1.0 for k in range(len(order))]
        if None in ratios:
            draft.note(
                "channels.states.velocity", "derivative of the position: a sliding joint's is not its rate"
            )
            states["velocity"] = "derivative"
        else:
            turning_rate = _RATES[measured["unit"]][0]
            texts = [
                _times(units[k][1] * ratio) if slides[k] else turning_rate
                for k, ratio in enumerate(ratios) if ratio is not None
            ]  # fmt: skip
            _rescale(measured, texts, "rad/s")
    if isinstance(wanted := command.get("velocity"), dict):
        if wanted["unit"] == _SAME_RATE[unit]:
            _rescale(wanted, [text for text, _ in units], "rad/s")
        else:
            del command["velocity"]
            draft.unused.append(
                "commanded velocity: of another unit than the position's, and some joints slide"
            )


def named_length(column: str) -> str:
    """Unit of a length at the end of a column's name, `x [mm]` or `x_m`; empty where there is none."""
    told = _NAMED.search(column)
    return (told[1] or told[2]) if told else ""


def _named_at(position: NamedBlock, label: str) -> str:
    columns, labels = position.block.columns, position.block.labels
    return named_length(columns[labels.index(label)]) if len(columns) == len(labels) else ""


def _by(named: Sequence[str]) -> str:
    return "by name" if all(named) else "by name or its limits" if any(named) else "by its limits"


def _ratio(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> float | None:
    """Position's rate over velocity, 1 or a thousand or its part; None where it is another."""
    fit = evidence.fit_rate(time, position[:, None], velocity[:, None])
    near = [ratio for ratio in _RATIOS if abs(fit.ratio / ratio - 1.0) < _NEAR]
    return near[0] if near and fit.correlation >= evidence.AGREES else None


def _times(factor: float) -> str:
    return "" if factor == 1.0 else f"{factor:g} * "


def _length(values: np.ndarray, kind: Any) -> str:
    """Unit of a sliding joint's numbers (N,); empty where its limits tell none.

    Numbers that the limits allow as m are in m; in mm they also have to use some of the travel.
    """
    if _within(values, kind):
        return "m"
    used = np.ptp(values) * 1e-3 > _USES * (kind.upper - kind.lower)
    return "mm" if used and _within(values * 1e-3, kind) else ""


def _within(values: np.ndarray, kind: Any) -> bool:
    """Whether a joint (N,) [rad or m] keeps its limits; one without limits does."""
    travel = kind.upper - kind.lower if kind is not None else np.inf
    if not np.isfinite(travel):
        return True
    slack = _SLACK * travel
    return bool(kind.lower - slack <= values.min() and values.max() <= kind.upper + slack)


def _rescale(quantity: dict[str, Any], texts: Sequence[str], unit: str) -> None:
    quantity["formula"] = [
        f"{text}({formula})" if text and set(str(formula)) & set("+-") else f"{text}{formula}"
        for text, formula in zip(texts, quantity["formula"], strict=True)
    ]
    quantity["unit"] = unit
