"""Distributions over a space: a box, a Gaussian that keeps to bounds, and independent parts together."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.space import Space

LOG_2PI = math.log(2.0 * math.pi)
_ENTROPY_DRAWS = 20_000  # of a mixture: about 0.01 nat


class ParameterDistribution(ABC):
    """Where the numbers of a space are sampled from. Implementations are final and immutable."""

    @property
    @abstractmethod
    def space(self) -> Space:
        """What is sampled."""

    @abstractmethod
    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Points (N, P); the same ones for the same generator."""

    @abstractmethod
    def log_density(self, points: np.ndarray) -> np.ndarray:
        """(N,) of points (N, P) [nat]; -inf where nothing is sampled."""

    @abstractmethod
    def entropy(self) -> float:
        """Differential entropy [nat], in the units of the space."""

    @abstractmethod
    def record(self) -> dict[str, Any]:
        """Plain values for JSON, that describe what was sampled."""


@dataclass(frozen=True, eq=False)
class UniformBox(ParameterDistribution):
    """Uniform between bounds of its own.

    Raises:
        InputError: bounds outside the space's, or without width.
    """

    over: Space
    lower: np.ndarray  # (P,)
    upper: np.ndarray  # (P,)

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            self.over.points(getattr(self, name)[None])
        wrong = (self.lower < self.over.lower) | (self.upper > self.over.upper) | (self.lower >= self.upper)
        if wrong.any():
            k = int(np.flatnonzero(wrong)[0])
            d = self.over.dimensions[k]
            raise InputError(
                f"{d.name} is sampled from {self.lower[k]} to {self.upper[k]}; must have width and lie in "
                f"{d.lower} to {d.upper}"
            )

    @staticmethod
    def whole(space: Space) -> UniformBox:
        """All of a space."""
        return UniformBox(space, space.lower, space.upper)

    @property
    def space(self) -> Space:
        """See `ParameterDistribution`."""
        return self.over

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """See `ParameterDistribution`."""
        return rng.uniform(self.lower, self.upper, (count, len(self.over)))

    def log_density(self, points: np.ndarray) -> np.ndarray:
        """See `ParameterDistribution`."""
        x = self.over.points(points)
        inside = ((x >= self.lower) & (x <= self.upper)).all(axis=1)
        return np.where(inside, -self.entropy(), -np.inf)

    def entropy(self) -> float:
        """See `ParameterDistribution`."""
        return float(np.log(self.upper - self.lower).sum())

    def record(self) -> dict[str, Any]:
        """See `ParameterDistribution`."""
        ranges = dict(zip(self.over.names, zip(self.lower, self.upper, strict=True), strict=True))
        return {"kind": "box", "ranges": {k: [float(a), float(b)] for k, (a, b) in ranges.items()}}


@dataclass(frozen=True, eq=False)
class BoundedNormal(ParameterDistribution):
    """A Gaussian z, squashed between the space's bounds: x = lower + (upper - lower) Phi(z).

    With mean 0 and covariance 1 it is the whole box, uniform. A change of coordinates leaves relative
    entropies as they are, so those of z are those of x.

    Raises:
        InputError: shapes that do not fit, or a covariance that is not positive definite.
    """

    over: Space
    mean: np.ndarray  # (P,) of z
    covariance: np.ndarray  # (P, P) of z

    def __post_init__(self) -> None:
        size = len(self.over)
        if self.mean.shape != (size,) or self.covariance.shape != (size, size):
            raise InputError(
                f"mean {self.mean.shape} and covariance {self.covariance.shape} must be of {size} dimensions"
            )
        if not is_definite(self.covariance) or not np.isfinite(self.mean).all():
            raise InputError(f"mean {self.mean}, covariance {self.covariance}: not finite, or not definite")

    @staticmethod
    def whole(space: Space) -> BoundedNormal:
        """All of a space, uniform."""
        return BoundedNormal(space, np.zeros(len(space)), np.eye(len(space)))

    @property
    def space(self) -> Space:
        """See `ParameterDistribution`."""
        return self.over

    @property
    def median(self) -> np.ndarray:
        """(P,) in the space's units."""
        return self._squash(self.mean)

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """See `ParameterDistribution`."""
        root = np.linalg.cholesky(self.covariance)
        return self._squash(self.mean + rng.standard_normal((count, len(self.over))) @ root.T)

    def stretched(self, points: np.ndarray) -> np.ndarray:
        """z (N, P) of points (N, P); infinite on the bounds, NaN outside them."""
        share = (self.over.points(points) - self.over.lower) / (self.over.upper - self.over.lower)
        return ndtri(share)

    def log_density(self, points: np.ndarray) -> np.ndarray:
        """See `ParameterDistribution`."""
        z = self.stretched(points)
        inside = np.asarray(np.isfinite(z).all(axis=1))
        z = np.where(inside[:, None], z, 0.0)
        apart = np.linalg.solve(np.linalg.cholesky(self.covariance), (z - self.mean).T)
        of_z = -0.5 * ((apart**2).sum(axis=0) + len(self.over) * LOG_2PI + self._log_determinant())
        # dx/dz = (upper - lower) phi(z)
        log_width = np.log(self.over.upper - self.over.lower) - 0.5 * (z**2 + LOG_2PI)
        return np.where(inside, of_z - log_width.sum(axis=1), -np.inf)

    def entropy(self) -> float:
        """See `ParameterDistribution`; exact, since log dx/dz is quadratic in z."""
        of_z = 0.5 * (len(self.over) * (1.0 + LOG_2PI) + self._log_determinant())
        square = self.mean**2 + np.diag(self.covariance)
        log_width = np.log(self.over.upper - self.over.lower) - 0.5 * (square + LOG_2PI)
        return float(of_z + log_width.sum())

    def divergence_from(self, other: BoundedNormal) -> float:
        """KL(self || other) [nat] over the same space."""
        inverse = np.linalg.inv(other.covariance)
        apart = self.mean - other.mean
        trace = float(np.trace(inverse @ self.covariance))
        logs = other._log_determinant() - self._log_determinant()
        return 0.5 * (trace + float(apart @ inverse @ apart) - len(self.over) + logs)

    def record(self) -> dict[str, Any]:
        """See `ParameterDistribution`; quantiles are those of each dimension by itself."""
        spread = np.sqrt(np.diag(self.covariance))
        low, high = (self._squash(self.mean + k * spread) for k in (-1.0, 1.0))
        rows = zip(self.over.names, low, self.median, high, strict=True)
        return {
            "kind": "bounded_normal",
            "mean": self.mean.tolist(),
            "covariance": self.covariance.tolist(),
            "quantiles_16_50_84": {name: [float(a), float(b), float(c)] for name, a, b, c in rows},
        }

    def _squash(self, z: np.ndarray) -> np.ndarray:
        """Written from the nearer bound, so that no z within float64 falls onto it too early."""
        width = self.over.upper - self.over.lower
        return np.where(z < 0.0, self.over.lower + width * ndtr(z), self.over.upper - width * ndtr(-z))

    def _log_determinant(self) -> float:
        return float(np.linalg.slogdet(self.covariance)[1])


@dataclass(frozen=True, eq=False)
class Independent(ParameterDistribution):
    """Distributions over spaces of their own, sampled each for itself; their dimensions in order."""

    parts: tuple[ParameterDistribution, ...]

    @property
    def space(self) -> Space:
        """See `ParameterDistribution`."""
        return Space(tuple(d for part in self.parts for d in part.space.dimensions))

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """See `ParameterDistribution`."""
        return np.hstack([part.sample(rng, count) for part in self.parts])

    def log_density(self, points: np.ndarray) -> np.ndarray:
        """See `ParameterDistribution`."""
        x = self.space.points(points)
        ends = np.cumsum([0, *(len(part.space) for part in self.parts)])
        return np.sum(
            [part.log_density(x[:, a:b]) for part, a, b in zip(self.parts, ends[:-1], ends[1:], strict=True)],
            axis=0,
        )

    def entropy(self) -> float:
        """See `ParameterDistribution`."""
        return sum(part.entropy() for part in self.parts)

    def record(self) -> dict[str, Any]:
        """See `ParameterDistribution`."""
        return {"kind": "independent", "parts": [part.record() for part in self.parts]}


@dataclass(frozen=True, eq=False)
class Mixture(ParameterDistribution):
    """One of several distributions over the same space, by weight.

    Raises:
        InputError: no part, parts over different spaces, or weights that are none.
    """

    parts: tuple[ParameterDistribution, ...]
    weights: np.ndarray  # (K,) above 0, sum 1

    def __post_init__(self) -> None:
        if len({part.space for part in self.parts}) != 1:
            raise InputError(f"a mixture needs parts over one space, got {len(self.parts)} parts")
        w = self.weights
        if w.shape != (len(self.parts),) or not (w > 0.0).all() or abs(w.sum() - 1.0) > 1e-9:
            raise InputError(f"weights {w} of {len(self.parts)} parts must be above 0 and sum to 1")

    @property
    def space(self) -> Space:
        """See `ParameterDistribution`."""
        return self.parts[0].space

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """See `ParameterDistribution`."""
        which = rng.choice(len(self.parts), count, p=self.weights)
        points = np.empty((count, len(self.space)))
        for k in np.unique(which):
            points[which == k] = self.parts[k].sample(rng, int((which == k).sum()))
        return points

    def log_density(self, points: np.ndarray) -> np.ndarray:
        """See `ParameterDistribution`."""
        each = [
            np.log(w) + part.log_density(points) for w, part in zip(self.weights, self.parts, strict=True)
        ]
        return np.logaddexp.reduce(each, axis=0)

    def entropy(self) -> float:
        """See `ParameterDistribution`; no closed form: the mean over samples of a seed of its own."""
        points = self.sample(np.random.default_rng(0), _ENTROPY_DRAWS)
        return -float(self.log_density(points).mean())

    def record(self) -> dict[str, Any]:
        """See `ParameterDistribution`."""
        parts = [part.record() for part in self.parts]
        return {"kind": "mixture", "weights": self.weights.tolist(), "parts": parts}


def is_definite(matrix: np.ndarray) -> bool:
    """Whether a symmetric matrix is finite and positive definite."""
    if not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12):
        return False
    return bool(np.linalg.eigvalsh(matrix)[0] > 0.0)


def log_mean_exp(values: Sequence[float] | np.ndarray) -> float:
    """log(mean(exp(values))) without overflow."""
    found = np.asarray(values, dtype=np.float64)
    top = float(found.max())
    return top + math.log(float(np.exp(found - top).mean()))
