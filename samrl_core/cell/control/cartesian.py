"""Straight lines of the tool as joint waypoints."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, LimitError

InverseKinematics = Callable[[Pose, np.ndarray], np.ndarray]  # flange in base, seed (J,) -> (J,) [rad]
LONGEST_DISPLACEMENT = 0.02  # default limit of the tool's displacement in one action [m]
LEASH = 0.02  # the commanded tip stays this near to the measured one: no wind-up in contact [m]
HORIZON_S = 0.04  # commands are stamped so far ahead of the readings that they answer [s]
ACTION_S = 0.1  # the tip moves, with minimal jerk where a model or a script says how [s]
MAX_JOINT_STEP = 0.2  # between waypoints [rad]: more means that the solution has jumped to another branch


def straight_line(
    solve: InverseKinematics, start: Pose, displacement: np.ndarray, seed: np.ndarray, spacing: float
) -> list[np.ndarray]:
    """Waypoints (J,) [rad] along a displacement (3,) [m] of the flange, orientation fixed.

    Args:
        solve: inverse kinematics near a seed.
        start: flange in base where the line begins.
        displacement: in the base frame [m].
        seed: joint positions at the start (J,) [rad].
        spacing: of the waypoints at most [m].

    Raises:
        ReachError: a waypoint is out of reach (from `solve`).
        LimitError: joints would jump between two waypoints.
        InputError: the displacement is not three finite numbers, or the spacing is not positive.
    """
    displacement = np.asarray(displacement, dtype=np.float64)
    if displacement.shape != (3,) or not np.isfinite(displacement).all():
        raise InputError(f"displacement {displacement} must be three finite numbers [m]")
    if not (spacing > 0.0 and math.isfinite(spacing)):
        raise InputError(f"spacing of waypoints is {spacing} m, must be positive and finite")
    count = max(1, math.ceil(float(np.linalg.norm(displacement)) / spacing))
    waypoints, previous = [], seed
    for k in range(1, count + 1):
        q = solve(Pose(start.position + displacement * (k / count), start.quat_xyzw), previous)
        step = float(np.abs(q - previous).max())
        if not step <= MAX_JOINT_STEP:  # so that NaN is refused
            raise LimitError(
                f"waypoint {k} of {count} needs a joint step of {step:.3f} rad, limit {MAX_JOINT_STEP} rad; "
                "the arm is near a singularity: choose another direction"
            )
        waypoints.append(q)
        previous = q
    return waypoints
