"""A simulated world as a corrected driver offers it: joints without the zero errors that were diagnosed.

Only the border changes. The world keeps its truth, its encoders their errors; whoever reads joints here or
commands them has both less what the correction says they read too much.
"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.calibration.cell_correction import CellCorrection
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.world.world import SimulatedWorld, Truth
from samrl_core.common.errors import SamrlError


class CorrectedWorld(SimulatedWorld):
    """See `SimulatedWorld`; images pass as they are, `CellCorrection.frame` corrects them."""

    def __init__(self, world: SimulatedWorld, correction: CellCorrection, cell: CellSpec) -> None:
        """Stand before a world whose arms are those of `cell`.

        Raises:
            InputError: the correction names a joint that the cell's arm lacks.
        """
        correction.require_joints(cell)
        self._world, self._correction, self._cell = world, correction, cell

    @property
    def time_ns(self) -> int:
        """See `SimulatedWorld`."""
        return self._world.time_ns

    @property
    def camera_latency_ns(self) -> int:
        """See `SimulatedWorld`."""
        return self._world.camera_latency_ns

    def reset(self, seed: int) -> None:
        """See `SimulatedWorld`."""
        self._world.reset(seed)

    def advance(self) -> None:
        """See `SimulatedWorld`."""
        self._world.advance()

    def truth(self) -> Truth:
        """Refuse: what acts on a corrected world has nothing to do with truth; evaluation asks the world.

        Raises:
            SamrlError: always.
        """
        raise SamrlError("a corrected world tells no truth; evaluation asks the world itself")

    def read_arm(self, role: str) -> ArmReading:
        """See `World`, corrected."""
        return self._correction.reading(self._world.read_arm(role), self._cell.arm(role).joint_names, role)

    def read_camera(self) -> Frame:
        """See `World`."""
        return self._world.read_camera()

    def command(self, role: str, command: ArmCommand) -> None:
        """See `World`; a joint that reads too much is sent as much further."""
        names = self._cell.arm(role).joint_names
        self._world.command(role, self._correction.command(command, names, role))

    def commanded_effort(self, role: str) -> np.ndarray:
        """See `World`."""
        return self._world.commanded_effort(role)

    def close(self) -> None:
        """See `World`."""
        self._world.close()


def corrected_world(world: SimulatedWorld, correction: CellCorrection, cell: CellSpec) -> SimulatedWorld:
    """The world itself where no joint's zero is corrected. Raises InputError as `CorrectedWorld`."""
    return CorrectedWorld(world, correction, cell) if correction.encoder_zeros else world
