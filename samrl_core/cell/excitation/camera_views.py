"""A motion that shows camera, clocks and bases: views near and far, rolled, with the tool moving in sight.

Camera and tool move by turns and together, so that a late image differs from a wrong clock of one arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from samrl_core.cell.excitation.clearance import ArmLine
from samrl_core.cell.excitation.signal import from_velocity, minimum_jerk_velocity, sample_times
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.cell.types.pose import Pose, look_at, rotation_vector
from samrl_core.common.errors import InputError, ReachError

ROLL_RAD = 1.3  # about the optical axis, at most
ABOVE_M = (0.05, 0.10)  # tip over the object's top
ASIDE_M, TILT_RAD = 0.07, 0.25  # of the tip from the middle of the scene, and of the tool from straight down
NEAR_M, FAR_M = 0.28, 0.50  # of the camera from what it looks at
ARMS_APART_M = 0.13  # of the arms' middle lines
TRIES = 400
CHOICES = 6  # places within reach, of which the one that tells most is taken
VELOCITY_SHARE = 0.5  # of the arms' limits, at most


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """What both arms are commanded."""

    camera_arm: JointSignal
    tool_arm: JointSignal

    @property
    def time(self) -> np.ndarray:
        """(N,) [s]."""
        return self.camera_arm.time


class Worth(Protocol):
    """What views are worth; joints (J,) [rad] by role."""

    def gain(self, joints: Mapping[str, np.ndarray]) -> float:
        """Of one view more."""
        ...

    def take(self, joints: Mapping[str, np.ndarray]) -> None:
        """It is taken."""
        ...


def camera_motion(
    task: Task, cell: CellSpec, payloads: dict[str, Payload], seed: int, duration_s: float,
    camera_moves: bool = True, tool_moves: bool = True, pause_s: float = 1.5, worth: Worth | None = None,
) -> CameraMotion:  # fmt: skip
    """Plan a motion from the task's start.

    Args:
        task: whose object is looked at.
        cell: as calibrated.
        payloads: of the arms, for what stands out.
        seed: of the views.
        duration_s: length [s].
        camera_moves: whether the camera leaves its start.
        tool_moves: whether the tool does.
        pause_s: from one view to the next [s].
        worth: of places within reach the one that it prefers is taken, else the first.

    Raises:
        InputError: too short a motion, or too few views within reach.
    """
    start, rng = task.start_joints(cell), np.random.default_rng(seed)
    time = sample_times(duration_s, cell.tool_arm.controller.period_s)
    count = int(duration_s / pause_s)
    if count < 3:
        raise InputError(f"a camera motion of {duration_s} s has {count} views; it must have 3 or more")
    places = _Places(task, cell, payloads)
    at = {role: start[role] for role in ("camera_arm", "tool_arm")}
    velocity = {role: np.zeros((len(time), len(q))) for role, q in at.items()}
    moving = [r for r, m in (("camera_arm", camera_moves), ("tool_arm", tool_moves)) if m]
    for k in range(count):
        # Three turns of four: the camera alone, the tool alone, both; then both stand.
        roles = {0: moving[:1], 1: moving[-1:], 2: moving, 3: []}[k % 4] if moving else []
        for role in roles:
            limit = VELOCITY_SHARE * cell.arm(role).limits.velocity
            length = 0.8 * pause_s
            most = limit * length / 1.875
            if worth is None:
                goal = places.next(role, at, rng, most)
            else:
                goals = [places.next(role, at, rng, most) for _ in range(CHOICES)]
                goal = max(goals, key=lambda q, role=role, at=at: worth.gain({**at, role: q}))
            velocity[role] += minimum_jerk_velocity(time, k * pause_s, length, goal - at[role])
            at = {**at, role: goal}
        if worth is not None and roles:
            worth.take(at)
    return CameraMotion(
        from_velocity(time, velocity["camera_arm"], start["camera_arm"]),
        from_velocity(time, velocity["tool_arm"], start["tool_arm"]),
    )


class _Places:
    """Draws joint positions from which the object is seen, or at which the tool is in sight."""

    def __init__(self, task: Task, cell: CellSpec, payloads: dict[str, Payload]) -> None:
        self._cell, self._region, self._tool = cell, task.view_region(), task.scene(cell).tool
        self._arms = {r: ArmModel(cell.arm(r), Pose.identity(), None) for r in ("camera_arm", "tool_arm")}
        self._lines = {
            r: ArmLine(cell.arm(r), payloads[r], cell.base_in_world(r)) for r in ("camera_arm", "tool_arm")
        }
        nominal = np.array([p.nominal for p in task.parameters()])
        (self._object,) = task.body_poses(nominal).values()
        tops = [b.mesh.vertices[:, 2].max() for b in task.scene(cell).bodies[:1]]
        self._top = self._object.position[2] + float(tops[0])

    def next(
        self, role: str, at: dict[str, np.ndarray], rng: np.random.Generator, most: np.ndarray
    ) -> np.ndarray:
        """Joints (J,) of a place that is reached within `most` (J,) [rad] of `at`.

        Raises:
            InputError: none was found.
        """
        other = next(r for r in at if r != role)
        still = self._lines[other].points(at[other])[0]
        for _ in range(TRIES):
            flange = self._camera(rng) if role == "camera_arm" else self._flange(rng)
            base = self._cell.base_in_world(role)
            try:
                goal = solve_ik(self._arms[role], base.inverse() @ flange, at[role])
            except ReachError:
                continue
            if (np.abs(goal - at[role]) > most).any():
                continue
            way = np.linspace(at[role], goal, 8)
            points = np.concatenate([self._lines[role].points(q)[0] for q in way])
            near = np.sqrt(((points[:, None] - still[None]) ** 2).sum(axis=2).min())
            if near > ARMS_APART_M and self._lines[role].clearance(way[1:]).worst > -0.05:
                return goal
        raise InputError(f"{role} finds no further place to look from within reach; try another seed")

    def _camera(self, rng: np.random.Generator) -> Pose:
        region = self._region
        azimuth, elevation = rng.uniform(*region.azimuth), rng.uniform(*region.elevation)
        direction = [
            np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
        ]  # fmt: skip
        aim = region.target + np.array([*rng.uniform(-0.04, 0.04, 2), rng.uniform(-0.05, 0.03)])
        eye = region.target + rng.uniform(NEAR_M, FAR_M) * np.array(direction)
        view = look_at(eye, aim, float(rng.uniform(-ROLL_RAD, ROLL_RAD)))
        return view @ self._cell.camera_in_flange.inverse()

    def _flange(self, rng: np.random.Generator) -> Pose:
        x, y = self._region.target[:2] + rng.uniform(-ASIDE_M, ASIDE_M, 2)
        tip = np.array([x, y, self._top + rng.uniform(*ABOVE_M)])
        down = rotation_vector(rng.uniform(-TILT_RAD, TILT_RAD, 3)) @ Pose(
            np.zeros(3), np.array([1.0, 0, 0, 0])
        )
        return Pose(tip, down.quat_xyzw) @ self._tool.tip_in_flange.inverse()
