"""In place of Real2Sim where the renderer is not the subject: a body's pose, with noise."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError


class PoseSensor:
    """Sightings of one body. White noise, the same along each axis.

    Raises:
        InputError: the noise is negative or not finite, or there is no such body.
    """

    def __init__(self, world: SimulatedWorld, body: str, noise_std: float, rng: np.random.Generator) -> None:
        if not (np.isfinite(noise_std) and noise_std >= 0):
            raise InputError(f"noise {noise_std} m must be at least 0 and finite")
        if body not in (found := world.truth().body_position):
            raise InputError(f"no body is called {body!r}; there are: {', '.join(found)}")
        self._world, self._body, self._noise, self._rng = world, body, noise_std, rng

    def read(self) -> np.ndarray:
        """Place of its origin in world now, (3,) [m]."""
        place = self._world.truth().body_position[self._body]
        return place + self._noise * self._rng.standard_normal(3)
