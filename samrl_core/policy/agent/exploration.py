"""Exploration of the residual: noise that is correlated in time.

The next nominal action undoes white noise: it returns the tip to where the model wants it, so hardly any new
state is visited. Noise that stays much the same over an episode tries a correction as a whole (Eberhard et
al. 2023, "Pink noise is all you need"; here of first order, as in Uhlenbeck and Ornstein 1930).
"""

from __future__ import annotations

import numpy as np

from samrl_core.common.errors import InputError


class Exploration:
    """Noise of one cell, episode by episode.

    Raises:
        InputError: a value outside its limits.
    """

    def __init__(self, deviation: float, memory: float, rng: np.random.Generator) -> None:
        """Standard deviation per axis [m], and correlation of an action's noise with the next one's."""
        if deviation < 0.0 or not 0.0 <= memory <= 1.0:
            raise InputError(
                f"exploration's deviation is {deviation} m, must not be negative; its memory {memory}, must "
                f"lie within 0..1"
            )
        self._deviation, self._memory, self._rng = deviation, memory, rng
        self.begin()

    def begin(self) -> None:
        """Starts an episode with new noise."""
        self._noise = self._sample()

    def next(self) -> np.ndarray:
        """Noise (3,) of the next action [m]."""
        noise, memory = self._noise, self._memory
        self._noise = memory * noise + np.sqrt(1.0 - memory**2) * self._sample()
        return noise

    def _sample(self) -> np.ndarray:
        return self._deviation * self._rng.standard_normal(3)


def clip_norm(vector: np.ndarray, limit: float) -> np.ndarray:
    """A vector (3,), scaled to the length `limit` where it is longer."""
    return vector * min(1.0, limit / max(float(np.linalg.norm(vector)), 1e-12))


def within_reach(nominal: np.ndarray, residual: np.ndarray, longest: float) -> np.ndarray:
    """The residual (3,) [m], scaled so that the action is not longer than `longest`.

    Raises:
        InputError: the nominal action alone is longer.
    """
    length = float(np.linalg.norm(nominal))
    if length > longest:
        raise InputError(
            f"nominal action of {length:.4f} m is longer than the {longest:.4f} m that the tool may move; "
            f"shorten the task's steps or allow longer ones"
        )
    if np.linalg.norm(nominal + residual) <= longest:
        return residual
    # |nominal + s residual| = longest has one root within 0..1.
    a, b, c = float(residual @ residual), float(nominal @ residual), length**2 - longest**2
    share = (-b + np.sqrt(b * b - a * c)) / a
    return (1.0 - 1e-9) * share * residual
