"""The border to the real cell: a world is read and commanded, and cannot be asked for the truth.

`SimulatedWorld` adds what only a simulator can do. Drivers of a hardware cell either publish the same
topics as `sim_bridge`, or subclass `World` for a vendor library.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame


@dataclass(frozen=True, eq=False)
class Truth:
    """What really is in the simulated world. Only evaluation may hold one."""

    stamp_ns: int  # [ns]
    body_position: dict[str, np.ndarray]  # per body (3,) [m] in world
    body_quat_xyzw: dict[str, np.ndarray]  # per body (4,)
    body_speed: dict[str, float]  # per body, of its origin [m/s]
    body_peak_height: dict[str, float]  # per body, highest z of its origin so far in this episode [m]
    tip_position: np.ndarray  # (3,) tool tip in world [m]
    chain_points: np.ndarray  # (K + 1, 3) joints of the tool's chain and its end in world, (0, 3) without [m]
    first_contact_ns: int  # stamp of the first tool contact in this episode, -1 when none yet [ns]
    peak_contact_force: float  # largest normal force on the tool so far in this episode [N]


class World(ABC):
    """What a driver offers. Roles are `tool_arm` and `camera_arm`."""

    @abstractmethod
    def read_arm(self, role: str) -> ArmReading:
        """Newest joint reading of an arm."""

    @abstractmethod
    def read_camera(self) -> Frame:
        """Take an RGB-D reading now."""

    @abstractmethod
    def command(self, role: str, command: ArmCommand) -> None:
        """Set what an arm's impedance controller tracks from now on."""

    @abstractmethod
    def commanded_effort(self, role: str) -> np.ndarray:
        """Torque that the controller sent to the drives last, gravity included, (J,) [N m]."""

    @abstractmethod
    def close(self) -> None:
        """Release everything; calling it twice is harmless."""


class SimulatedWorld(World):
    """A world with a clock that can be advanced and a scene that can be laid anew."""

    @property
    @abstractmethod
    def time_ns(self) -> int:
        """Simulated time [ns]; never goes back, not even on reset."""

    @property
    def camera_latency_ns(self) -> int:
        """From a reading of the camera until its driver hands it out [ns]."""
        return 0

    @abstractmethod
    def reset(self, seed: int) -> None:
        """Lay the scene anew, arms at home and at rest, sampled from `seed`."""

    @abstractmethod
    def advance(self) -> None:
        """One controller period (1 ms): control law, then physics."""

    @abstractmethod
    def truth(self) -> Truth:
        """For evaluation only; `tests/architecture/test_truth.py` lists who calls it."""
