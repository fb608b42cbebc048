"""Which views the camera arm can take: reach, joint limits and coarse clearance."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.geometry import Capsules, clearance, link_shapes
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.chain import link_poses
from samrl_core.cell.tasks.task import Task, ViewRegion
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.common.errors import InputError, ReachError


@dataclass(frozen=True)
class ReachSettings:
    """The grid of views and what counts as free."""

    azimuths: int = 12
    elevations: int = 3
    distances: int = 2
    rolls: tuple[float, ...] = (0.0, math.pi)  # about the optical axis; one of them suffices [rad]
    limit_margin: float = 0.10  # from every joint limit [rad]
    clearance: float = 0.03  # between the camera arm and anything else [m]
    camera_radius: float = 0.05  # sphere about the camera's body and its bracket [m]
    way_points: int = 12  # configurations that are checked along a straight motion in joint space
    way_step: float = 0.02  # of the tool's tip, from one sub-goal that is checked to the next at least [m]


@dataclass(frozen=True, eq=False)
class View:
    """A camera pose that the arm reaches."""

    camera_in_world: Pose
    joint_position: np.ndarray  # of the camera arm (J,) [rad]
    capsules: Capsules  # of the camera arm with its camera, in world


SPEED_SHARE = 0.5  # of the velocity limits, at which the camera arm is taken to move


def motion_seconds(start: np.ndarray, end: np.ndarray, velocity: np.ndarray, share: float) -> float:
    """How long a straight motion in joint space takes at a share of the velocity limits (J,) [rad/s]."""
    return float(np.max(np.abs(end - start) / (share * velocity)))


def bounds_of(region: ViewRegion) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest azimuth [rad], elevation [rad] and distance [m], (3,) each."""
    pairs = (region.azimuth, region.elevation, region.distance)
    return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])


def viewpoint_of(position: np.ndarray, region: ViewRegion) -> np.ndarray:
    """Azimuth [rad], elevation [rad], distance [m] of a camera at (3,) [m], clipped to the region."""
    offset = position - region.target
    distance = float(np.linalg.norm(offset))
    viewpoint = np.array(
        [np.arctan2(offset[1], offset[0]), np.arcsin(offset[2] / max(distance, 1e-9)), distance]
    )
    return np.clip(viewpoint, *bounds_of(region))


def viewpoint_position(viewpoint: np.ndarray, region: ViewRegion) -> np.ndarray:
    """Camera position (3,) in world [m] of a viewpoint: the inverse of `viewpoint_of` within the region."""
    azimuth, elevation, distance = viewpoint
    level = np.cos(elevation)
    towards = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    return region.target + distance * towards


def grid(region: ViewRegion, settings: ReachSettings) -> tuple[tuple[Pose, ...], ...]:
    """Camera poses over the region, one tuple per viewpoint with its rolls, nearest and highest first."""
    low, high = region.azimuth
    # A full circle must not meet itself: there the last step would repeat the first.
    closed = high - low > 2 * math.pi - 1e-6
    azimuths = np.linspace(low, high, settings.azimuths, endpoint=not closed)
    elevations = np.linspace(region.elevation[1], region.elevation[0], settings.elevations)
    distances = np.linspace(region.distance[0], region.distance[1], settings.distances)
    poses = []
    for r, e, a in itertools.product(distances, elevations, azimuths):
        eye = viewpoint_position(np.array([a, e, r]), region)
        poses.append(tuple(look_at(eye, region.target, roll) for roll in settings.rolls))
    return tuple(poses)


class ViewReach:
    """Reach and clearance of the camera arm in one cell; the grid is solved once, on first use."""

    def __init__(self, cell: CellSpec, task: Task, settings: ReachSettings | None = None) -> None:
        """Builds the kinematic models."""
        self._cell, self._task = cell, task
        self.settings = settings or ReachSettings()
        self._camera_arm = ArmModel(cell.camera_arm, cell.camera_base_in_world, None)
        self._tool_arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
        self._camera_shapes = link_shapes(cell.camera_arm)
        self._tool_shapes = link_shapes(cell.tool_arm)
        self._tool = task.scene(cell).tool
        self._views: tuple[View, ...] | None = None

    @property
    def views(self) -> tuple[View, ...]:
        """All reachable views that are clear of table and bodies, whatever the tool arm does."""
        if self._views is None:
            self._views = self._solve()
        return self._views

    def camera_capsules(self, joint_position: np.ndarray) -> Capsules:
        """The camera arm with its camera at a joint position (J,) [rad]."""
        links = self._camera_arm.link_poses_in_world(joint_position)
        arm = Capsules.of_arm(self._camera_shapes, links)
        flange = links[self._cell.camera_arm.flange]
        ends = flange.apply(np.stack([np.zeros(3), self._cell.camera_center_of_mass]))
        camera = Capsules(ends[:1], ends[1:], np.array([self.settings.camera_radius]))
        return Capsules.joined((arm, camera))

    def tool_capsules(self, joint_position: np.ndarray, values: np.ndarray) -> Capsules:
        """The tool arm with its tool at a joint position (J,) [rad], the tool's chain as estimated (P,)."""
        links = self._tool_arm.link_poses_in_world(joint_position)
        flange = links[self._cell.tool_arm.flange]
        chain = self._tool.chain
        hanging = link_poses(chain, flange @ self._tool.tip_in_flange, self._task.chain_angles(values))
        return Capsules.joined(
            (
                Capsules.of_arm(self._tool_shapes, links),
                Capsules.of_parts(self._tool.parts, flange),
                *(Capsules.of_parts(link.parts, pose) for link, pose in zip(chain, hanging, strict=True)),
            )
        )

    def way_capsules(self, joint_position: np.ndarray, values: np.ndarray) -> Capsules:
        """The tool arm on its way through the sub-goals ahead of a joint position (J,) [rad].

        At sub-goals that are `way_step` apart at least; those out of the arm's reach are left out.
        """
        at, flange = joint_position, self._tool_arm.flange_in_base(joint_position)
        lever = flange.rotation @ self._tool.tip_in_flange.position
        tip, found = flange.position + lever, []
        for goal in self._task.sub_goals(values, tip):
            if float(np.linalg.norm(goal.tip_position - tip)) < self.settings.way_step:
                continue
            tip = goal.tip_position
            wanted = Pose(tip - lever, flange.quat_xyzw)
            try:
                at = solve_ik(self._tool_arm, wanted, at, q0=at, iterations=60, tolerance=1e-4)
            except ReachError:
                continue
            found.append(self.tool_capsules(at, values))
        return Capsules.joined(found)

    def body_capsules(self, values: np.ndarray) -> Capsules:
        """The task's bodies where the estimate has them."""
        poses = self._task.body_poses(values)
        bodies = self._task.scene(self._cell).bodies
        return Capsules.joined(Capsules.of_parts(b.parts, poses.get(b.name, b.body_in_world)) for b in bodies)

    def obstacles(self, tool_arm_position: np.ndarray, values: np.ndarray) -> Capsules:
        """Tool arm and bodies as above: all that the camera arm must keep clear of, but for the table."""
        return Capsules.joined((self.tool_capsules(tool_arm_position, values), self.body_capsules(values)))

    def camera_at(self, joint_position: np.ndarray) -> Pose:
        """Camera pose in world for a joint position (J,) [rad]."""
        return self._camera_arm.flange_in_world(joint_position) @ self._cell.camera_in_flange

    def is_clear(self, camera: Capsules, obstacles: Capsules) -> bool:
        """Whether every gap is at least the clearance; the arm's pedestal may stand on the table."""
        return clearance(camera, obstacles) >= self.settings.clearance

    def clear_views(self, obstacles: Capsules) -> list[View]:
        """Views of the grid that are."""
        return [view for view in self.views if self.is_clear(view.capsules, obstacles)]

    def way_is_clear(self, start: np.ndarray, end: np.ndarray, obstacles: Capsules) -> bool:
        """The same along a straight line in joint space, table included; the start itself is not asked."""
        for s in np.linspace(0.0, 1.0, self.settings.way_points)[1:]:
            capsules = self.camera_capsules(start + s * (end - start))
            if not (self._above_table(capsules) and self.is_clear(capsules, obstacles)):
                return False
        return True

    def _above_table(self, capsules: Capsules) -> bool:
        base = self._cell.camera_base_in_world.position
        # The first links cannot but be near the plane that the base stands on.
        away = np.linalg.norm(0.5 * (capsules.start + capsules.end)[:, :2] - base[:2], axis=1) > 0.2
        moving = Capsules(capsules.start[away], capsules.end[away], capsules.radius[away])
        return moving.lowest() >= self.settings.clearance

    def solve_view(
        self,
        rolls: Sequence[Pose],
        obstacles: Capsules,
        near: np.ndarray,
        seeds: Sequence[np.ndarray],
    ) -> View | None:
        """Joint position for a camera pose, clear of table and obstacles; None when there is none.

        Args:
            rolls: camera poses in world that differ by a turn about the optical axis; any of them will do.
            obstacles: what the camera arm must keep clear of.
            near: of several solutions the one nearest to this joint position (J,) is taken [rad].
            seeds: starts of the search (J,) [rad], tried in order until one leads there.
        """
        world_in_base = self._cell.camera_base_in_world.inverse()
        flange_in_camera = self._cell.camera_in_flange.inverse()
        wanted = [world_in_base @ pose @ flange_in_camera for pose in rolls]
        solved = [q for flange in wanted if (q := self._ik(flange, seeds)) is not None]
        for q in sorted(solved, key=lambda q: float(np.abs(q - near).max())):
            capsules = self.camera_capsules(q)
            if self._above_table(capsules) and self.is_clear(capsules, obstacles):
                return View(self.camera_at(q), q, capsules)
        return None

    def _solve(self) -> tuple[View, ...]:
        cell = self._cell
        nominal = self.body_capsules(np.array([p.nominal for p in self._task.parameters()]))
        # Near the start, where the arm's motions to them are short.
        start = self._task.start_joints(cell)["camera_arm"]
        poses = grid(self._task.view_region(), self.settings)
        found = [self.solve_view(rolls, nominal, start, [cell.camera_arm.home, start]) for rolls in poses]
        views = [view for view in found if view is not None]
        if not views:
            raise InputError(
                f"the camera arm reaches no view of task {self._task.name}; move its base or the view region"
            )
        return tuple(views)

    def _ik(self, flange_in_base: Pose, seeds: Sequence[np.ndarray]) -> np.ndarray | None:
        for seed in seeds:
            try:
                return solve_ik(
                    self._camera_arm,
                    flange_in_base,
                    seed,
                    margin_rad=self.settings.limit_margin,
                    iterations=60,
                    tolerance=1e-4,
                )
            except ReachError:
                continue
        return None
