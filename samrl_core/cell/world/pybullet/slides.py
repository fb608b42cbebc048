"""Bodies that slide once in an episode, as what they lie on is shaken."""

from __future__ import annotations

import math

import numpy as np
import pybullet

from samrl_core.cell.tasks.task import Slide
from samrl_core.cell.types.scene import Body
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.table import TABLE_FRICTION


class Slides:
    """Those of an episode that are still to come.

    A pan that is shaken comes back to its place. What was loose on it goes on, at the speed that friction
    stops after the way that is asked for.

    Args:
        client: physics client.
        bodies: as built, for their friction.
        index: their numbers in the client.
        settings: of the world.
    """

    def __init__(
        self, client: int, bodies: tuple[Body, ...], index: dict[str, int], settings: WorldSettings
    ) -> None:
        self._client, self._index = client, index
        self._friction = {body.name: math.sqrt(body.friction * TABLE_FRICTION) for body in bodies}
        self._gravity = -settings.gravity[2]
        self.begin((), np.zeros(3))

    @property
    def waiting(self) -> bool:
        """Whether any is still to come."""
        return bool(self._slides)

    def begin(self, slides: tuple[Slide, ...], tip: np.ndarray) -> None:
        """Wait for another episode's, whose tip (3,) starts there in world [m]."""
        self._slides, self._start = slides, tip

    def start_those_due(self, tip: np.ndarray) -> None:
        """Let go what is to slide when the tip (3,) is there in world [m]."""
        distance = float(np.linalg.norm(tip - self._start))
        for slide in self._slides:
            if distance >= slide.after:
                self._let_go(slide)
        self._slides = tuple(slide for slide in self._slides if distance < slide.after)

    def _let_go(self, slide: Slide) -> None:
        way = float(np.linalg.norm(slide.way))
        speed = math.sqrt(2.0 * self._friction[slide.body] * self._gravity * way)
        velocity = [*(speed / way * slide.way), 0.0]
        pybullet.resetBaseVelocity(self._index[slide.body], velocity, physicsClientId=self._client)
