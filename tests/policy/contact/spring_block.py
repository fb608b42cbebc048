"""A block with a hole under a tip on three springs: contact without a simulator, in a few lines."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.policy.contact.hole_grid import Forgiveness

STIFFNESS = 1500.0  # of each spring [N/m]
FORGIVEN = Forgiveness.radius  # within which the tip drops in [m]
FREE_FORCE = np.array([1.5, -0.4, -1.2])  # read when nothing is touched [N]


class SpringBlock:
    """The face is at `face` [m], the hole at `hole` (2,) [m]; walls hold the tip inside, nothing jams."""

    def __init__(self, tip: np.ndarray, hole: np.ndarray, face: float) -> None:
        self._commanded, self._hole, self._face = tip.copy(), hole, face
        self.inside, self.largest = False, 0.0
        self.reading = self._read()

    def move(self, displacement: np.ndarray) -> None:
        """Displace the commanded tip (3,) [m]."""
        self._commanded = self._commanded + displacement
        self.reading = self._read()
        self.largest = max(self.largest, float(np.abs(self.reading.force - FREE_FORCE).max()))

    def _read(self) -> TipReading:
        tip = self._commanded.copy()
        if tip[2] < self._face:
            near = float(np.linalg.norm(tip[:2] - self._hole)) < FORGIVEN
            self.inside = self.inside or near
            if self.inside:
                tip[:2] = self._hole
            else:
                tip[2] = self._face
        else:
            self.inside = False
        force = STIFFNESS * (self._commanded - tip)
        return TipReading(tip, FREE_FORCE + force, np.eye(3) / STIFFNESS)
