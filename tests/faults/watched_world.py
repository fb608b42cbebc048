"""A simulated world that writes down what its arms track, and where they are, in every controller period.

Evaluation only: it stands between the bridge's command guard and the world, where nothing comes after the
guard, so that a row is what the arm's controller tracked in that period of 1 ms.
"""

from __future__ import annotations

import mmap
import os
import struct
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.world.world import SimulatedWorld, Truth

PARTS = ("position", "velocity", "acceleration", "measured_position", "measured_velocity")
CONTACT_PERIOD = 10  # steps between two looks for contact
STATE = struct.Struct("dd?")  # simulated time [s], fastest joint of the tool arm's set point [rad/s], contact


def row_type(joints: int) -> np.dtype:
    """One controller period: time, whether the arms were placed anew before it, and both arms."""
    arm = [(part, "<f8", (joints,)) for part in PARTS]
    return np.dtype([("time_ns", "<i8"), ("placed", "<i8"), *((role, arm) for role in ROLES)])


class WatchedWorld(SimulatedWorld):
    """Passes everything on. The rows go to `FILE.PID`, the newest state to `FILE.state`."""

    def __init__(self, inner: SimulatedWorld, file: str) -> None:
        self._inner = inner
        self._file = os.open(f"{file}.{os.getpid()}", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        self._state = StateFile(Path(f"{file}.state"), create=True)
        self._row = np.zeros((), row_type(len(inner.read_arm(ROLES[0]).position)))
        self._row["placed"] = 1
        self._steps, self._contact = 0, False

    @property
    def time_ns(self) -> int:
        return self._inner.time_ns

    def read_arm(self, role: str) -> ArmReading:
        return self._inner.read_arm(role)

    def read_camera(self) -> Frame:
        return self._inner.read_camera()

    def commanded_effort(self, role: str) -> np.ndarray:
        return self._inner.commanded_effort(role)

    def truth(self) -> Truth:
        return self._inner.truth()

    def reset(self, seed: int) -> None:
        self._inner.reset(seed)
        self._row["placed"], self._contact = 1, False

    def command(self, role: str, command: ArmCommand) -> None:
        arm = self._row[role]
        for part in PARTS[:3]:
            arm[part] = getattr(command, part)
        self._inner.command(role, command)

    def advance(self) -> None:
        self._inner.advance()
        for role in ROLES:
            reading, arm = self._inner.read_arm(role), self._row[role]
            arm["measured_position"], arm["measured_velocity"] = reading.position, reading.velocity
        self._row["time_ns"] = self._inner.time_ns
        os.write(self._file, self._row.tobytes())  # not buffered: a kill loses nothing
        self._row["placed"] = 0
        self._steps += 1
        if self._steps % CONTACT_PERIOD == 0:
            self._contact = self._contact or self._inner.truth().first_contact_ns >= 0
        speed = float(np.abs(self._row["tool_arm"]["velocity"]).max())
        self._state.write(self._inner.time_ns * 1e-9, speed, self._contact)

    def close(self) -> None:
        self._inner.close()


class StateFile:
    """The newest state, shared between the world's process and the bench."""

    def __init__(self, path: Path, create: bool = False) -> None:
        if create and not path.exists():  # a bridge that was started again goes on in its predecessor's file
            path.write_bytes(bytes(STATE.size))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), STATE.size)

    def write(self, time_s: float, speed: float, contact: bool) -> None:
        self._map[:] = STATE.pack(time_s, speed, contact)

    def read(self) -> tuple[float, float, bool]:
        """Simulated time [s], speed of the tool arm's set point [rad/s], whether its tool has touched."""
        return STATE.unpack(self._map[:])
