"""What the numbers themselves say: which block is another's rate, which follows it, in which unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_WINDOW_S = 0.1  # over which increments are compared; noise averages out, motion does not
AGREES = 0.9  # correlation from which increments are taken as those of one motion
_MOVES = 1e-6  # of a block's own size: less is a joint at rest
_RATIOS = {  # position's unit over that of the velocity [1/s]
    ("rad", "rad/s"): 1.0,
    ("deg", "deg/s"): 1.0,
    ("deg", "rad/s"): 180 / np.pi,
    ("rad", "deg/s"): np.pi / 180,
    ("rad", "rpm"): np.pi / 30,
    ("deg", "rpm"): 6.0,
    ("rev", "rev/s"): 1.0,
    ("rev", "rpm"): 1.0 / 60.0,
    ("rev", "rad/s"): 0.5 / np.pi,
    ("rev", "deg/s"): 1.0 / 360.0,
    ("mm", "mm/s"): 1.0,
    ("mm", "m/s"): 1000.0,
    ("m", "m/s"): 1.0,
    ("m", "mm/s"): 0.001,
}
_BACK, _ON = 0.1, 0.5  # of the steps: that a clock may go back, and that it goes on in most rows
_NEAR = 0.15  # relative error of a ratio up to which it is that of the units
_MOVING = 0.5  # of rows in which a position changes, from which a torque that does not is held
_FEW_RUNS = 20  # values in a log, too few to say at which rate they come
_HELD = 3  # rows from which a value is held; twice is a cycle that was missed
_ALIKE = 0.8  # of values that are held for as many rows


@dataclass(frozen=True)
class RateFit:
    """How the increments of a position compare with the integral of what may be its velocity."""

    correlation: float
    ratio: float  # position over integral


def fit_rate(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> RateFit:
    """Compares increments over windows of about 0.1 s.

    Args:
        time: (N,) [s].
        position: (N, J).
        velocity: (N, J) in units of its own.
    """
    steps = np.diff(time)
    step = float(np.median(steps))
    window = max(1, round(_WINDOW_S / step)) if step > 0 else 1
    integral = np.vstack(
        [
            np.zeros(velocity.shape[1]),
            np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * steps[:, None], axis=0),
        ]
    )
    moved = (position[window:] - position[:-window]).ravel()
    expected = (integral[window:] - integral[:-window]).ravel()
    scale = float(np.sqrt((moved @ moved) * (expected @ expected)))
    if not scale:
        return RateFit(0.0, 0.0)
    return RateFit(float(moved @ expected) / scale, float(moved @ expected) / float(expected @ expected))


def velocity_unit(position_unit: str, fit: RateFit) -> str:
    """Unit of a velocity whose ratio to the position's rate is known; empty where none fits."""
    if fit.correlation < AGREES:
        return ""
    for (one, other), ratio in _RATIOS.items():
        if one == position_unit and abs(fit.ratio / ratio - 1.0) < _NEAR:
            return other
    return ""


def ratio_of(position_unit: str, velocity_unit: str) -> float | None:
    """How many of a position's unit per second a unit of velocity is; None where they differ in kind."""
    return _RATIOS.get((position_unit, velocity_unit))


def in_other_units(position_unit: str, fit: RateFit, of: str = "the position") -> str:
    """Units of a velocity by those that its position may have instead; empty where none fits."""
    others = dict.fromkeys(one for one, _ in _RATIOS if one != position_unit)
    told = [f"{unit} if in {one}" for one in others if (unit := velocity_unit(one, fit))]
    return ", ".join(told).replace("if in", f"if {of} is in", 1)


def follows(time: np.ndarray, position: np.ndarray, other_time: np.ndarray, other: np.ndarray) -> float:
    """Correlation of two blocks over their common time, of joints that move; 0 where none does."""
    low, high = max(time[0], other_time[0]), min(time[-1], other_time[-1])
    inside = (time >= low) & (time <= high)
    if inside.sum() < 10:
        return 0.0
    there = np.column_stack([np.interp(time[inside], other_time, column) for column in other.T])
    here = position[inside]
    here, there = here - here.mean(axis=0), there - there.mean(axis=0)
    moving = (np.ptp(here, axis=0) > _MOVES * (1 + np.abs(here).max())) & (np.ptp(there, axis=0) > 0)
    if not moving.any():
        return 0.0
    products = (here * there).sum(axis=0)[moving]
    return float(np.median(products / np.sqrt((here**2).sum(axis=0) * (there**2).sum(axis=0))[moving]))


def rows_held(values: np.ndarray, beside: np.ndarray) -> int:
    """For how many rows each of some readings (N, J) is held while others (N, K) change; 1 if it is not.

    A reading of a slower topic that stands in each row of a faster one is late by half of that on average. Of
    coarse steps no two last alike, and at rest nothing changes beside them.
    """
    moving = np.flatnonzero((np.diff(beside, axis=0) != 0).any(axis=1))
    if len(moving) < _MOVING * (len(beside) - 1) or len(values) != len(beside):
        return 1
    new = np.flatnonzero((np.diff(values, axis=0) != 0).any(axis=1))
    if len(new) < _FEW_RUNS:
        return 1
    lasts = np.diff(new)
    usual = int(np.median(lasts))
    alike = np.mean(np.abs(lasts - usual) <= max(1, usual // 8))
    return usual if usual >= _HELD and alike > _ALIKE else 1


def runs_on(values: np.ndarray) -> int:
    """Whether numbers (N,) can be a clock's: 2 if they grow, 1 if they grow in some steps, else 0.

    A latency in ms goes up and down, and a still column tells no row from the next. Where runs stand below
    each other a clock goes back now and then.
    """
    steps = np.diff(values[np.isfinite(values)])
    if not len(steps) or (steps < 0).mean() > _BACK or not (steps > 0).any():
        return 0
    return 2 if (steps > 0).mean() > _ON else 1


def time_unit(steps: np.ndarray) -> list[str]:
    """Units in which a clock with these steps would run at 5 to 5,000 Hz, the likeliest first."""
    step = float(np.median(steps))
    rates = {"s": 1.0 / step, "ms": 1e3 / step, "us": 1e6 / step, "ns": 1e9 / step} if step > 0 else {}
    plausible = {unit: rate for unit, rate in rates.items() if 5.0 <= rate <= 5000.0}
    return sorted(plausible, key=lambda unit: abs(np.log(plausible[unit] / 200.0)))
