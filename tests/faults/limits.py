"""Whether the arms were ever led beyond their limits, from the rows of every controller period (1 kHz).

A row's set point is what the impedance controller tracked in that period. Two rows that follow each other
give the speed and the acceleration that the arm was really asked for, whatever the set point's fields say.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from samrl_core.cell.control.guard_settings import GuardSettings
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from tests.faults.watched_world import row_type

GUARD = GuardSettings()
ROUNDING = 1e-6  # of a limit, beside the slack that the guard states
# Of a measured position [rad] and velocity [rad/s]: the simulated sensors' noise, and a tool that bends back.
MEASURED_POSITION, MEASURED_VELOCITY = 0.01, 0.1


@dataclass(frozen=True)
class Extreme:
    """The highest share of a limit over a recording."""

    share: float  # of the limit; above `allowed` is a violation
    allowed: float
    place: str  # arm, joint and time of it

    @property
    def kept(self) -> bool:
        """Whether the limit was kept."""
        return self.share <= self.allowed


def read_rows(file: Path, joints: int = 7) -> np.ndarray:
    """All whole rows of the recordings `FILE.PID`, by process in the order of their first row's file."""
    kind = row_type(joints)
    parts = []
    for path in sorted(file.parent.glob(f"{file.name}.[0-9]*"), key=lambda p: p.stat().st_mtime):
        data = path.read_bytes()
        rows = np.frombuffer(data[: len(data) // kind.itemsize * kind.itemsize], kind).copy()
        if len(rows):
            rows["placed"][0] = 1  # another process is another world
            parts.append(rows)
    return np.concatenate(parts) if parts else np.zeros(0, kind)


def extremes(rows: np.ndarray, cell_name: str = "panda_rizon") -> dict[str, Extreme]:
    """The highest share of each kind of limit over the rows.

    position: distance from the middle of the range over its half. velocity, acceleration: the set point's own
    fields. speed, change of velocity: from row to row, over what the velocity and acceleration limits let
    happen in that time. measured position and velocity: of the arm itself.
    """
    cell = cell_named(cell_name)
    found: dict[str, Extreme] = {}
    time_s = rows["time_ns"] * 1e-9
    follows = (rows["placed"][1:] == 0) & (np.diff(rows["time_ns"]) > 0)
    dt = np.where(follows, np.diff(rows["time_ns"]) * 1e-9, np.inf)[:, None]

    def note(what: str, role: str, shares: np.ndarray, allowed: float, times: np.ndarray) -> None:
        if not shares.size:
            return
        shares = np.where(np.isnan(shares), np.inf, shares)  # no number keeps no limit
        i, j = np.unravel_index(int(np.argmax(shares)), shares.shape)
        worst = float(shares[i, j])
        if what not in found or worst > found[what].share:
            place = f"{cell.arm(role).joint_names[j]} at {times[i]:.3f} s"
            found[what] = Extreme(worst, allowed, place)

    for role in ROLES:
        limits, arm = cell.arm(role).limits, rows[role]
        middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
        note("position", role, np.abs(arm["position"] - middle) / half, 1.0 + ROUNDING, time_s)
        slack = GUARD.slack + ROUNDING
        note("velocity", role, np.abs(arm["velocity"]) / limits.velocity, slack, time_s)
        note("acceleration", role, np.abs(arm["acceleration"]) / limits.acceleration, slack, time_s)
        steps, changes = np.abs(np.diff(arm["position"], axis=0)), np.abs(np.diff(arm["velocity"], axis=0))
        note("speed", role, steps / dt / limits.velocity, GUARD.curve_slack + ROUNDING, time_s[1:])
        note("change of velocity", role, changes / dt / limits.acceleration, 1.0, time_s[1:])
        beyond = (half + MEASURED_POSITION) / half
        measured = np.abs(arm["measured_position"] - middle) / half / beyond
        note("measured position", role, measured, 1.0, time_s)
        measured = np.abs(arm["measured_velocity"]) / (limits.velocity + MEASURED_VELOCITY)
        note("measured velocity", role, measured, 1.0, time_s)
    return found
