"""Peg insertion after the paper: translate a round peg into a hole sampled within 10 cm x 10 cm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.instance.parts import Parts
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.hand import TOOL_LABEL
from samrl_core.cell.tasks.peg_insertion.board import board_body
from samrl_core.cell.tasks.peg_insertion.tool import hand_with_peg
from samrl_core.cell.tasks.screen import Screen, bodies_of
from samrl_core.cell.tasks.start import checked_tip, middle_view, require_origin, start_joints
from samrl_core.cell.tasks.task import Ending, EpisodeStart, ParameterSpec, SubGoal, Task, ViewRegion
from samrl_core.cell.types.pose import Pose, rotation_vector
from samrl_core.cell.types.scene import Scene
from samrl_core.common.errors import InputError

BODY = "hole_board"
_STEEPEST = 0.3  # a block leans less than this [rad]


@dataclass(frozen=True)
class PegInsertion(Task):
    """Settings of the task. The paper gives the 10 cm x 10 cm range and 100 actions; the rest is
    ASSUMPTION, chosen so that a scripted expert succeeds and a careless one does not.

    Raises:
        InputError: a length is not positive, or the hole does not fit into the block.
    """

    name: str = "peg_insertion"
    variant_of: str = ""
    usual_policy: str = ""
    max_actions: int = 100
    peg_radius: float = 0.010  # [m]
    peg_length: float = 0.060  # below the fingertip centre [m]
    clearance: float = 0.002  # radial [m]
    outer_radius: float = 0.060  # of the block, to the middle of its outer faces [m]
    height: float = 0.040  # of the block [m]
    friction: float = 0.3  # block and peg [-]
    center_x: float = 0.5  # middle of the range, in the tool arm's base frame [m]
    center_y: float = 0.0  # [m]
    half_range: float = 0.05  # the hole lies within +- this of the middle, in x and y [m]
    start_above: float = 0.10  # tip above the block's top at the start [m]
    hover: float = 0.015  # tip above the block's top before it goes down [m]
    goal_depth: float = 0.025  # tip below the block's top at the end [m]
    success_depth: float = 0.020  # [m]
    done_margin: float = 0.001  # deeper than this beyond `success_depth` before the model says done [m]
    done_slack: float = 0.003  # lateral error beyond the clearance that `is_done` accepts [m]
    success_slack: float = 0.001  # the same for `succeeded` [m]
    free_step: float = 0.010  # largest displacement per action in free space [m]
    fine_step: float = 0.005  # the same near and inside the hole [m]
    board_label: int = 1
    tool_label: int = TOOL_LABEL
    view_elevation: tuple[float, float] = (math.radians(20.0), math.radians(60.0))  # [rad]
    screens: tuple[Screen, ...] = ()  # that stand in the way of some views
    tilt: float = 0.0  # the block leans up to this about x and about y at the start; 0: it never does [rad]
    turn: float = 0.0  # it is turned up to this about its axis, which nobody estimates [rad]
    fits: tuple[float, ...] = ()  # least and largest clearance of parts as made; (): as `clearance` [m]
    force_limit: float = math.inf  # an episode with a larger contact force has failed [N]

    def __post_init__(self) -> None:
        lengths = ("peg_radius", "peg_length", "clearance", "height", "half_range", "free_step", "fine_step")
        for field in lengths:
            if not getattr(self, field) > 0:
                raise InputError(f"{field} is {getattr(self, field)} m, must be positive")
        if self.fits and not (len(self.fits) == 2 and 0 < self.fits[0] <= self.clearance <= self.fits[1]):
            raise InputError(
                f"fits are {self.fits} m, must be two positive clearances about {self.clearance} m, or none"
            )
        if not (0 <= self.tilt < _STEEPEST and 0 <= self.turn < math.inf and self.force_limit > 0):
            raise InputError(
                f"tilt is {self.tilt} rad, turn {self.turn} rad, force_limit {self.force_limit} N; must be "
                f"0 to {_STEEPEST} rad, at least 0 rad, and positive"
            )
        if self.hole_radius >= self.outer_radius:
            raise InputError(
                f"hole radius {self.hole_radius} m does not fit into a block of radius "
                f"{self.outer_radius} m; make the peg or the clearance smaller"
            )

    @property
    def hole_radius(self) -> float:
        """Radius of the circle inside the hole [m]."""
        return self.peg_radius + self.clearance

    @property
    def action_limit(self) -> float:
        """See `Task`."""
        return max(self.free_step, self.fine_step)

    def scene(self, cell: CellSpec) -> Scene:
        """Block at the middle of its range, and hand with peg.

        Raises:
            InputError: the tool arm's base is not at the world's origin; the parameters are given in
                both frames alike.
        """
        require_origin(cell, self.name)
        nominal = np.array([p.nominal for p in self.parameters()])
        body = board_body(
            BODY,
            self.hole_radius,
            self.outer_radius,
            self.height,
            self.body_poses(nominal)[BODY],
            self.board_label,
            self.friction,
        )
        return Scene(
            (body, *bodies_of(self.screens)),
            hand_with_peg(self.peg_radius, self.peg_length, self.friction, self.tool_label),
        )

    def as_made(self, parts: Parts) -> PegInsertion:
        """Another peg, another fit, other friction."""
        clearance = self.clearance * (1.0 + parts.clearance)
        if self.fits:  # the hole is made apart from the peg, and a pair outside the fit is sorted out
            clearance = min(max(clearance - parts.held_size, self.fits[0]), self.fits[1])
        return replace(
            self,
            peg_radius=self.peg_radius + parts.held_size,
            clearance=clearance,
            friction=self.friction * math.exp(parts.friction[0]),
        )

    def parameters(self) -> tuple[ParameterSpec, ...]:
        """Position of the hole's mouth, uniform over the range (its standard deviation is the scale); and how
        the block leans if it may, a rotation vector in the table's plane.
        """
        scale = self.half_range / np.sqrt(3.0)
        mouth = tuple(
            ParameterSpec(name, "m", middle, float(scale), middle - self.half_range, middle + self.half_range)
            for name, middle in (("hole_x", self.center_x), ("hole_y", self.center_y))
        )
        if not self.tilt:
            return mouth
        lean = self.tilt / math.sqrt(3.0)
        return mouth + tuple(
            ParameterSpec(name, "rad", 0.0, lean, -_STEEPEST, _STEEPEST) for name in ("tilt_x", "tilt_y")
        )

    def body_poses(self, values: np.ndarray) -> dict[str, Pose]:
        """The block stands on the table, its origin under the hole; one that leans has its mouth as high."""
        return {BODY: self._block(values, 0.0)}

    def chain_angles(self, values: np.ndarray) -> np.ndarray:
        """None: the tool is rigid."""
        self._checked(values)
        return np.zeros(0)

    def values_at(self, body_in_world: dict[str, Pose], chain_angles: np.ndarray) -> np.ndarray:
        """See `Task`."""
        pose = body_in_world[BODY]
        if not self.tilt:
            return np.array(pose.position[:2])
        axis = pose.rotation[:, 2]
        lever = np.array([-axis[1], axis[0]])  # z cross axis, in the plane
        sine = float(np.linalg.norm(lever))
        lean = lever * (math.atan2(sine, axis[2]) / sine) if sine > 1e-12 else np.zeros(2)
        return np.concatenate([pose.apply(np.array([0.0, 0.0, self.height]))[:2], lean])

    def start_joints(self, cell: CellSpec) -> dict[str, np.ndarray]:
        """Tip above the middle of the range, peg straight down; camera in the middle of its region."""
        tool = hand_with_peg(self.peg_radius, self.peg_length, self.friction, self.tool_label)
        tip = np.array([self.center_x, self.center_y, self.height + self.start_above])
        return start_joints(cell, tool, tip, self.start_camera())

    def start_camera(self) -> Pose:
        """Camera pose in world at the start of an episode."""
        # To the side of the camera arm's base: straight ahead it would fold up.
        return middle_view(self.view_region(), np.pi / 3)

    def view_region(self) -> ViewRegion:
        """Shell about the block: the camera arm reaches 54 of 60 sampled directions at 0.35 m."""
        return ViewRegion(
            target=np.array([self.center_x, self.center_y, 0.08]),
            distance=(0.30, 0.45),
            azimuth=(-np.deg2rad(150.0), np.deg2rad(150.0)),
            elevation=self.view_elevation,
        )

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """`above` the hole, then `inserted`; empty when done.

        Once the tip is aligned below the hovering height, or is inside the hole, `above` is behind it.
        """
        tip = checked_tip(tip_position)
        if self.is_done(values, tip):
            return ()
        block = self._block(values, 0.0)
        along = block.inverse().apply(tip)  # in the block's frame
        lateral = float(np.hypot(along[0], along[1]))
        above = block.apply(np.array([0.0, 0.0, self.height + self.hover]))
        # Half the clearance on arrival leaves the other half for the estimate's error and the descent.
        tolerance = 0.5 * self.clearance
        near = float(np.linalg.norm(tip - above)) < 2 * self.free_step
        goals = (
            SubGoal("above", above, tolerance, self.fine_step if near else self.free_step),
            SubGoal(
                "inserted",
                block.apply(np.array([0.0, 0.0, self.height - self.goal_depth])),
                0.002,
                self.fine_step,
            ),
        )
        inside = along[2] < self.height - 0.001 and lateral < self.clearance + self.done_slack
        # On the way down a little more is allowed, or noise would send the tip up again and again.
        hover = self.height + self.hover
        descending = along[2] < hover - tolerance
        allowed = 0.8 * self.clearance if descending else tolerance
        aligned = along[2] < hover + tolerance and lateral < allowed
        return goals[1:] if inside or aligned else goals

    def is_done(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """Deep enough, and within the clearance and a slack of the estimated axis."""
        tip = self._block(values, 0.0).inverse().apply(checked_tip(tip_position))
        return self._inserted(tip, self.success_depth + self.done_margin, self.done_slack)

    def start_values(self, rng: np.random.Generator) -> np.ndarray:
        """Hole uniform within the range, and the block's lean within its own."""
        offset = rng.uniform(-self.half_range, self.half_range, 2)
        mouth = np.array([self.center_x, self.center_y]) + offset
        if not self.tilt:
            return mouth
        return np.concatenate([mouth, rng.uniform(-self.tilt, self.tilt, 2)])

    @property
    def start_range(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Task`."""
        nominal = np.array([p.nominal for p in self.parameters()])
        spread = np.array([self.half_range, self.half_range, self.tilt, self.tilt])[: len(nominal)]
        return nominal - spread, nominal + spread

    def sample_start(self, rng: np.random.Generator) -> EpisodeStart:
        """See `Task`; the block's turn is the world's own."""
        values = self.start_values(rng)
        turn = rng.uniform(-self.turn, self.turn) if self.turn else 0.0
        return EpisodeStart({BODY: self._block(values, turn)}, self.chain_angles(values))

    def succeeded(self, ending: Ending) -> bool:
        """Deep enough, within the clearance and a smaller slack of the true axis, and gently."""
        tip = ending.body_in_world[BODY].inverse().apply(checked_tip(ending.tip_position))
        gentle = ending.peak_contact_force <= self.force_limit
        return gentle and self._inserted(tip, self.success_depth, self.success_slack)

    def final_error(self, ending: Ending) -> float:
        """Distance of the tip from the part of the true axis at or below the success depth [m]."""
        tip = ending.body_in_world[BODY].inverse().apply(checked_tip(ending.tip_position))
        missing = max(0.0, tip[2] - (self.height - self.success_depth))
        return float(np.linalg.norm([tip[0], tip[1], missing]))

    def shaped_reward(self, ending: Ending) -> float:
        """Less the distance between the peg's end and its place in the hole [m]."""
        return -self.final_error(ending)

    def _inserted(self, tip: np.ndarray, depth: float, slack: float) -> bool:
        """Whether the tip (3,) in the block's frame [m] is that deep, and so near to the axis."""
        deep = tip[2] <= self.height - depth
        return bool(deep and np.hypot(tip[0], tip[1]) < self.clearance + slack)

    def _block(self, values: np.ndarray, turn: float) -> Pose:
        """The block in world, turned about its axis by `turn` [rad]."""
        v = self._checked(values)
        if not self.tilt and not turn:
            return Pose(np.array([v[0], v[1], 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))
        lean = np.array([*v[2:], 0.0]) if self.tilt else np.zeros(3)
        turned = rotation_vector(lean) @ rotation_vector(np.array([0.0, 0.0, turn]))
        mouth = np.array([v[0], v[1], self.height])
        return Pose(mouth - self.height * turned.rotation[:, 2], turned.quat_xyzw)

    def _checked(self, values: np.ndarray) -> np.ndarray:
        v = np.asarray(values, dtype=np.float64)
        if v.shape != (4 if self.tilt else 2,) or not np.isfinite(v).all():
            lean = ", tilt_x and tilt_y [rad]" if self.tilt else ""
            raise InputError(f"peg insertion estimates hole_x and hole_y [m]{lean}, got {values}")
        return v
