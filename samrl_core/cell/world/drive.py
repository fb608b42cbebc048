"""Between what an arm's controller believes and what its joints do: zeros, torques, friction, delay.

A nominal drive changes no bit of what goes through it.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.observation import ArmCommand

# Below this speed the friction that the torque sensor sees is taken as proportional to it: how much of it
# acts on a joint that stands still the physics does not tell [rad/s].
SLIDING = 0.02


class Drive:
    """One arm's drives and joint sensors.

    Args:
        spec: of the arm.
        role: of the arm.
        instance: whose arms, calibration and timing count.
        period_ns: of the controller [ns].
    """

    def __init__(self, spec: RobotSpec, role: str, instance: CellInstance, period_ns: int) -> None:
        limit, arms = spec.limits.effort, instance.arms
        self._zeros = instance.calibration.zeros(role)
        self._gain = 1.0 + arms.gain(role)
        self._offset = arms.torque_offset(role) * limit
        self._sensor_offset = arms.sensor_offset(role) * limit
        self._friction = arms.friction(role) * limit
        self._delay_ns = round(instance.timing.command_delay * 1e9 / period_ns) * period_ns
        self._on_the_way: deque[tuple[int, ArmCommand]] = deque()

    @property
    def friction(self) -> np.ndarray:
        """Coulomb's, of each joint (J,) [N m]."""
        return self._friction

    def true_position(self, read: np.ndarray) -> np.ndarray:
        """Where the joints are (J,) [rad] when the encoders read `read` (J,) [rad]."""
        return read - self._zeros

    def read_position(self, true: np.ndarray) -> np.ndarray:
        """What the encoders read (J,) [rad], without noise."""
        return true + self._zeros

    def torque(self, effort: np.ndarray) -> np.ndarray:
        """What acts on the joints (J,) [N m] when the controller asks for `effort`, before friction."""
        return effort * self._gain + self._offset

    def read_effort(self, effort: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """What the torque sensors read (J,) [N m], without noise."""
        sliding = self._friction * np.tanh(velocity / SLIDING)
        return self.torque(effort) - sliding + self._sensor_offset

    def send(self, command: ArmCommand, now_ns: int) -> ArmCommand | None:
        """Take a command; returns it if the controller tracks it at once, else None."""
        if self._delay_ns == 0:
            return command
        self._on_the_way.append((now_ns + self._delay_ns, command))
        return None

    def arrived(self, now_ns: int) -> ArmCommand | None:
        """The newest command that has arrived by now and was not told of yet."""
        newest = None
        while self._on_the_way and self._on_the_way[0][0] <= now_ns:
            newest = self._on_the_way.popleft()[1]
        return newest

    def restart(self) -> None:
        """Forget commands on the way."""
        self._on_the_way.clear()
