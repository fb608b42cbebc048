"""Which numbers of a push are compared with the model's: the tip while the force acts, and all sightings."""

from __future__ import annotations

import numpy as np

from samrl_core.model.physical_parameters.push_scene import LATENCY, PushScene


class PushComparison:
    """Rows of one push, in units of their noise: M1 of the tip, then M2 of the sightings.

    The readings are those of the moment `latency` after the drive's: to first order position + latency x
    speed.

    Args:
        scene: of the push.
        tip_noise: standard deviation of a reading of the tip [m].
        seen_noise: of a sighting [m].
        tip_period_s: between readings of the tip that are compared [s].
    """

    def __init__(self, scene: PushScene, tip_noise: float, seen_noise: float, tip_period_s: float) -> None:
        push = scene.push
        # Only while the force acts: after that the arm is held, and its position does not depend on the disc.
        every = max(1, round(tip_period_s / push.period_s))
        tip = np.arange(every, push.push_steps, every)
        self._step = np.concatenate([tip, push.seen_step]) * scene.substeps
        # States begin with the blade's position and the disc's, velocities too.
        self._coordinate = np.repeat([0, 1], [len(tip), len(push.seen)])
        self._speed = self._coordinate + scene.coordinates
        self._noise = np.repeat([tip_noise, seen_noise], [len(tip), len(push.seen)])
        self._measured = np.concatenate([push.tip[tip], push.seen])

    def residual(self, states: np.ndarray, latency: float) -> np.ndarray:
        """Model (T + 1, Q + D) less measurement (M,)."""
        return (self._read(states, latency) - self._measured) / self._noise

    def jacobian(self, states: np.ndarray, change: np.ndarray, latency: float) -> np.ndarray:
        """Of the residual (M, P), from those of the states (T + 1, Q + D, P), which know of no latency."""
        rows = self.response(change, latency)
        rows[:, LATENCY] += states[self._step, self._speed] / self._noise
        return rows

    def response(self, change: np.ndarray, latency: float) -> np.ndarray:
        """What a change of the states (T + 1, Q + D, ...) does to the rows (M, ...)."""
        return self._read(change, latency) / self._noise.reshape(-1, *[1] * (change.ndim - 2))

    def _read(self, values: np.ndarray, latency: float) -> np.ndarray:
        return values[self._step, self._coordinate] + latency * values[self._step, self._speed]
