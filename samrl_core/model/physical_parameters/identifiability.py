"""Which parameters the data determine, and which only in combination, from the Fisher information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.statistics import NORMAL_95

DETERMINED = 0.5  # the data must leave less than this share of the prior's standard deviation
NOT_SEPARATED = 5.0  # the worst combination of mass and friction is that much less known than the best
PAIR = ("mass", "table_friction")


@dataclass(frozen=True)
class PhysicalParameter:
    """One number with its 95 % interval; all of them are positive, so intervals are those of logarithms."""

    name: str
    value: float  # mass [kg], stiffness [N/m], the rest [-]
    lower: float
    upper: float
    shrink: float  # standard deviation that is left, as a share of the prior's

    @property
    def determined(self) -> bool:
        """Whether the number comes from the data; otherwise it is the prior's."""
        return self.shrink < DETERMINED

    @property
    def half_width(self) -> float:
        """Half the interval, as a share of the value."""
        return 0.5 * (self.upper - self.lower) / self.value


@dataclass(frozen=True)
class Combination:
    """mass^a x table_friction^b, the exponents of length 1: one axis of what is left open."""

    mass_power: float
    friction_power: float
    std: float  # of its logarithm, about its relative error


def parameters_of(
    names: Sequence[str], theta: np.ndarray, covariance: np.ndarray, prior_std: np.ndarray
) -> tuple[PhysicalParameter, ...]:
    """Values and intervals of the first parameters, which are logarithms.

    Args:
        names: of the first P' parameters.
        theta: parameters (P,), P at least P'.
        covariance: (P, P).
        prior_std: (P,).

    Raises:
        InputError: the covariance has a variance that is not positive.
    """
    variance = np.diag(covariance)
    if not (np.isfinite(variance).all() and np.all(variance > 0)):
        raise InputError(
            f"covariance has variances {variance}, must be positive; give every parameter a prior"
        )
    std = np.sqrt(variance)
    return tuple(
        PhysicalParameter(
            name,
            float(np.exp(theta[i])),
            float(np.exp(theta[i] - NORMAL_95 * std[i])),
            float(np.exp(theta[i] + NORMAL_95 * std[i])),
            float(std[i] / prior_std[i]),
        )
        for i, name in enumerate(names)
    )


def combinations_of(covariance: np.ndarray, names: Sequence[str]) -> tuple[Combination, Combination]:
    """Axes of the joint uncertainty of mass and friction, the best determined first.

    Exponents (0.7, 0.7) mean that the product is known, (0.7, -0.7) the ratio, (1, 0) the mass itself.
    """
    columns = [list(names).index(name) for name in PAIR]
    variances, axes = np.linalg.eigh(covariance[np.ix_(columns, columns)])
    best, worst = (_combination(axis, v) for v, axis in zip(variances, axes.T, strict=True))
    return best, worst


def _combination(axis: np.ndarray, variance: float) -> Combination:
    mass_power, friction_power = (float(a) for a in axis * np.sign(axis[np.argmax(np.abs(axis))]))
    return Combination(mass_power, friction_power, float(np.sqrt(variance)))


def describe_parameters(
    parameters: Sequence[PhysicalParameter], combinations: Sequence[Combination]
) -> tuple[str, ...]:
    """What is known and what is not, in sentences."""
    lines = [
        f"{a.name} is {a.value:.3g}, 95 % interval {a.lower:.3g} to {a.upper:.3g}"
        for a in parameters
        if a.determined
    ]
    open_names = [a.name for a in parameters if not a.determined]
    if open_names:
        lines.append(f"not determined, the values are the priors': {', '.join(open_names)}")
    best, worst = combinations
    lines.append(
        f"mass^{best.mass_power:.2f} x friction^{best.friction_power:.2f} is known to {100 * best.std:.1f} %"
        f", mass^{worst.mass_power:.2f} x friction^{worst.friction_power:.2f} to {100 * worst.std:.1f} %"
        + (": mass and friction are not separated" if worst.std > NOT_SEPARATED * best.std else "")
    )
    return tuple(lines)
