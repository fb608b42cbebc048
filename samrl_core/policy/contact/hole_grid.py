"""Belief of where a hole is, in the plane of its mouth: a grid of places and how likely each is.

Images give a place and a covariance. How well they are calibrated differs from cell to cell, so that the
belief has the tails of Student's t. A peg that is pressed and does not go in says where the hole is not,
which no such shape holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError

REACH = 0.004  # the grid's usual half side [m]
SPACING = 0.00025  # [m]
MOST_PLACES = 41  # along a side; a wider grid is coarser
FREEDOM = 3.0  # degrees of freedom of Student's t: beyond three deviations lie 3 % in place of 0.01 %
APART = 0.0008  # of places that are worth a press each, at least [m]


@dataclass(frozen=True)
class Forgiveness:
    """How far off a pressed peg still goes in.

    Lowered by 1 mm per action in typical cells, all go in from 1.0 mm, half from 1.6 mm
    (msgs_docs/results/tasks.md,
    `tests.policy.contact.forgiven_offsets`); one that slides there is less sure.
    """

    radius: float = 0.0013  # half of the presses at this distance are taken to go in [m]
    width: float = 0.0002  # of the transition [m]
    reliable: float = 0.97  # share of the presses nearer than that which go in [-]

    def entering(self, distance: np.ndarray) -> np.ndarray:
        """Probability that a press at distances [m] from the hole goes in."""
        return self.reliable / (1.0 + np.exp(np.clip((distance - self.radius) / self.width, -50.0, 50.0)))


@dataclass(frozen=True, eq=False)
class HoleGrid:
    """Places and their weights."""

    places: np.ndarray  # (N, 2) by the encoders of the tool arm [m]
    weights: np.ndarray  # (N,), their sum is 1
    stops: np.ndarray  # (M, 2) where a press did not go in [m]

    @staticmethod
    def of(mean: np.ndarray, covariance: np.ndarray, reach: float = REACH) -> HoleGrid:
        """Student's t about a mean (2,) [m] with a covariance (2, 2) [m2] near it, cut off at `reach` [m].

        Raises:
            InputError: the covariance is not positive definite or not finite.
        """
        if not (np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0.0):
            raise InputError(f"covariance {covariance.tolist()} m2 of a hole must be positive definite")
        spacing = max(SPACING, 2.0 * reach / (MOST_PLACES - 1))
        axis = np.arange(-reach, reach + 0.5 * spacing, spacing)
        away = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        distance = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away)  # ty: ignore[no-matching-overload]
        weights = (1.0 + distance / FREEDOM) ** (-0.5 * (FREEDOM + 2.0))
        return HoleGrid(mean + away, weights / weights.sum(), np.zeros((0, 2)))

    def stopped_at(self, place: np.ndarray, forgiveness: Forgiveness) -> HoleGrid:
        """After a press at a place (2,) [m] that did not go in (Bayes' rule)."""
        distance = np.linalg.norm(self.places - place, axis=1)
        weights = self.weights * (1.0 - forgiveness.entering(distance))
        return HoleGrid(self.places, weights / weights.sum(), np.vstack([self.stops, place]))

    def chance(self, place: np.ndarray, forgiveness: Forgiveness) -> float:
        """Probability that a press at a place (2,) [m] goes in."""
        return float(self.weights @ forgiveness.entering(np.linalg.norm(self.places - place, axis=1)))

    def next_place(self, here: np.ndarray, forgiveness: Forgiveness, per_metre: float) -> np.ndarray:
        """Where a press (2,) has the best chance, less `per_metre` [1/m] times the way from `here` (2,).

        Beside a stop, not at it: the same press again would end the same way.
        """
        likely = self.places[self.weights > 1e-4 * self.weights.max()]
        apart = np.linalg.norm(likely[:, None] - self.stops[None], axis=-1).min(axis=1, initial=np.inf)
        if (apart > APART).any():
            likely = likely[apart > APART]
        away = np.linalg.norm(likely[:, None] - self.places[None], axis=-1)
        chance = forgiveness.entering(away) @ self.weights
        way = np.linalg.norm(likely - here, axis=1)
        return likely[int(np.argmax(chance - per_metre * way))]

    @property
    def mean(self) -> np.ndarray:
        """(2,) [m]."""
        return self.weights @ self.places

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviation (2,) along x and y [m]."""
        return np.sqrt(self.weights @ np.square(self.places - self.mean))
