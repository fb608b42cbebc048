"""Spatula flipping after the paper: get under a pancake, lift it and turn it over, by translation alone.

How a spatula that cannot turn flips anything the paper leaves open. Here a low lip stops the pancake: the
blade goes under it, then its edge travels on an arc about the lip, until the pancake stands past upright and
falls over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.instance.parts import Parts
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.hand import TOOL_LABEL
from samrl_core.cell.tasks.screen import Screen, bodies_of
from samrl_core.cell.tasks.spatula_flipping.arc import Arc
from samrl_core.cell.tasks.spatula_flipping.pancake import (
    lip_body,
    numbers_of_pose,
    pancake_body,
    pose_of_numbers,
    require_room,
    require_rounding,
    slide_when_shaken,
)
from samrl_core.cell.tasks.spatula_flipping.tool import hand_with_spatula
from samrl_core.cell.tasks.start import checked_tip, middle_view, require_origin, start_joints
from samrl_core.cell.tasks.task import Ending, ParameterSpec, Slide, SubGoal, Task, ViewRegion, camera_specs
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Scene, Tool
from samrl_core.common.errors import InputError

PANCAKE = "pancake"
LIP = "lip"
_SIZES = 0.04  # steps of a pancake's size that a physics of its own is built for [-]
_ACROSS = 0.15  # its centre is believed within +- this of the middle, in y [m]
_POSITIVE = "pancake_radius pancake_thickness pancake_mass blade_length blade_width blade_thickness".split()
_POSITIVE += "free_step push_step arc_radius arc_step".split()
_TURNED_OVER = Pose.from_rotation(np.zeros(3), np.diag([1.0, -1.0, -1.0]))


@dataclass(frozen=True)
class SpatulaFlipping(Task):
    """Settings of the task. The paper gives the 2 cm x 2 cm range and 200 actions; the rest is ASSUMPTION,
    chosen so that a scripted expert succeeds.

    Raises:
        InputError: a length is not positive, or the pancake may lie in the lip or beyond its ends.
    """

    name: str = "spatula_flipping"
    variant_of: str = ""
    usual_policy: str = ""
    max_actions: int = 200
    pancake_radius: float = 0.050  # [m]
    pancake_thickness: float = 0.012  # [m]
    pancake_rounding: float = 0.004  # radius of its edges; a sharp rim would jam against the blade [m]
    pancake_mass: float = 0.080  # [kg]
    pancake_friction: float = 0.45  # [-]
    blade_length: float = 0.090  # [m]
    blade_width: float = 0.080  # [m]
    blade_thickness: float = 0.002  # [m]
    blade_tilt: float = math.radians(20.0)  # [rad]
    blade_friction: float = 0.05  # coated, PTFE has 0.05 to 0.10 [-]
    edge_ahead: float = 0.050  # leading edge ahead of the flange's axis [m]
    edge_below: float = 0.100  # and below the fingertip centre [m]
    lip_x: float = 0.580  # its near face, in the tool arm's base frame [m]
    lip_size: tuple[float, float, float] = (0.006, 0.240, 0.012)  # [m]
    lip_friction: float = 0.30  # [-]
    center_x: float = 0.510  # middle of the pancake's range, in the tool arm's base frame [m]
    center_y: float = 0.0  # [m]
    half_range: tuple[float, float] = (0.010, 0.010)  # it lies within +- these of the middle, in x and y [m]
    start_behind: float = 0.110  # edge behind the middle of the range at the start [m]
    start_height: float = 0.020  # of the edge [m]
    low: float = 0.0012  # height of the edge on its way under: its lower corner just above the table [m]
    clear_height: float = 0.080  # of the edge where it passes over a lying pancake [m]
    gap: float = 0.030  # between the edge and the rim where it comes down [m]
    under: float = 0.055  # the edge stops so far before the lip [m]
    aside: float = 0.004  # so far beside the pancake's middle it stays under it [m]
    turn_aside: float = 0.0  # so far beside the pancake's middle it stays while it turns it [m]
    arc_radius: float = 0.055  # of the edge's way about the foot of the lip [m]
    arc_end: float = 1.9  # angle above the table at which the arc ends [rad]
    arc_step: float = 0.10  # angle between two sub-goals [rad]
    upright: tuple[float, float] = (0.0, 0.0)  # of the arc: there it stands by itself [rad]
    success_axis: float = -0.9  # z of the pancake's axis at most [-]
    success_height: float = 0.030  # its centre was higher than this [m]
    success_speed: float = 0.020  # at the end [m/s]
    done_height: float = 0.022  # of the estimated centre at most; it may lie half on the lip [m]
    beyond: float = math.inf  # so far behind the lip's near face lies only what has fallen over it [m]
    free_step: float = 0.010  # largest displacement per action in free space [m]
    push_step: float = 0.006  # the same under the pancake and while turning it [m]
    pancake_label: int = 1
    tool_label: int = TOOL_LABEL
    lip_label: int = 5
    view_elevation: tuple[float, float] = (math.radians(20.0), math.radians(60.0))  # [rad]
    screens: tuple[Screen, ...] = ()  # that stand in the way of some views
    small_radius: float = 0.0  # of the other size that a pancake may have; 0: there is one size [m]
    camera_deviation: float = 0.0025  # how far the camera shows all beside its place, where sizes differ [m]
    size: float = 1.0  # `pancake_radius` over the drawn one; see `as_believed` [-]
    surface: float = 0.0  # height of the table's top [m]
    surface_deviation: float = 0.0  # of what it may be in a cell, 0: it is as drawn [m]
    shaken: bool = False  # somebody shakes what the pancake lies on, once, before the blade is under it
    slide: float = 0.0  # that it slides by then; as made [m]
    force_limit: float = math.inf  # an episode with a larger contact force has failed [N]

    def __post_init__(self) -> None:
        for field in _POSITIVE:
            if not getattr(self, field) > 0:
                raise InputError(f"{field} is {getattr(self, field)}, must be positive")
        if not 0.0 <= self.upright[0] <= self.upright[1] < self.arc_end:
            raise InputError(f"upright is {self.upright} rad, must rise from 0 to below {self.arc_end} rad")
        if len(self.half_range) != 2 or not all(0 < half < math.inf for half in self.half_range):
            raise InputError(f"half_range is {self.half_range} m, must be two positive lengths, in x and y")
        require_rounding(self.pancake_rounding, self.pancake_thickness)
        if not (0 <= self.small_radius < self.pancake_radius and self.force_limit > 0 and self.size > 0):
            raise InputError(
                f"small_radius is {self.small_radius} m, force_limit {self.force_limit} N, size {self.size}; "
                f"must be below {self.pancake_radius} m, 0 for one size, and positive"
            )
        room = self.lip_x - self.center_x, min(0.5 * self.lip_size[1], _ACROSS)
        require_room(self.half_range, self.pancake_radius, room)

    @property
    def action_limit(self) -> float:
        """See `Task`."""
        return max(self.free_step, self.push_step, self._arc.step_across)

    @property
    def surface_height(self) -> float:
        """See `Task`."""
        return self.surface

    def scene(self, cell: CellSpec) -> Scene:
        """Pancake in the middle of its range, lip, and hand with spatula.

        Raises:
            InputError: the tool arm's base is not at the world's origin.
        """
        require_origin(cell, self.name)
        pose = self.body_poses(np.array([p.nominal for p in self.parameters()]))[PANCAKE]
        made = self.pancake_radius, self.pancake_thickness, self.pancake_rounding, self.pancake_mass, pose
        pancake = pancake_body(PANCAKE, *made, self.pancake_label, self.pancake_friction)
        depth, _, height = self.lip_size
        place = np.array([self.lip_x + 0.5 * depth, self.center_y, self.surface + 0.5 * height])
        there = Pose.from_rotation(place, np.eye(3))
        lip = lip_body(LIP, self.lip_size, there, self.lip_label, self.lip_friction)
        return Scene((pancake, lip, *bodies_of(self.screens)), self._tool())

    def as_made(self, parts: Parts) -> SpatulaFlipping:
        """Another pancake, of either size where there are two, other friction of all, and a table of another
        height where that is unknown.
        """
        across, thick = parts.size
        small = self.small_radius > 0.0 and parts.either < 0.0
        radius = self.small_radius if small else self.pancake_radius
        return replace(
            self,
            pancake_radius=radius * (1.0 + across),
            small_radius=0.0 if small else self.small_radius,
            pancake_thickness=self.pancake_thickness * (1.0 + thick),
            pancake_mass=self.pancake_mass * (1.0 + parts.mass),
            pancake_friction=self.pancake_friction * math.exp(parts.friction[0]),
            blade_friction=self.blade_friction * math.exp(parts.friction[1]),
            lip_friction=self.lip_friction * math.exp(parts.friction[2]),
            surface=self.surface + (parts.surface if self.surface_deviation > 0.0 else 0.0),
            slide=parts.slide if self.shaken else 0.0,
        )

    def parameters(self) -> tuple[ParameterSpec, ...]:
        """Pose of the pancake but for the spin about its own axis, which does not show: its centre, and the
        rotation vector, which lies in the table's plane, from lying as at the start to its pose. Bounds hold
        over a whole episode, scales are those of a start and of a pancake that lies flat.

        Then, if `finds_size`: its radius over the drawn one, between two sizes or near one of them, and the
        camera's shift, without which its place would pass for as well known as the image shows it. A table
        that is higher than drawn is to the camera what a shift upwards is.
        """
        along, across = (half / math.sqrt(3.0) for half in self.half_range)
        x, y, z = self.center_x, self.center_y, self.surface + 0.5 * self.pancake_thickness
        pose = (
            ParameterSpec("pancake_x", "m", x, along, x - 0.10, x + 0.30),
            ParameterSpec("pancake_y", "m", y, across, y - _ACROSS, y + _ACROSS),
            ParameterSpec("pancake_z", "m", z, 0.002, self.surface, self.surface + 0.15),
            ParameterSpec("pancake_tilt_x", "rad", 0.0, 0.05, -math.pi, math.pi),
            ParameterSpec("pancake_tilt_y", "rad", 0.0, 0.05, -math.pi, math.pi),
        )
        if not self.finds_size:
            return pose
        small, large = self._sizes
        middle, half = 0.5 * (large + small), 0.5 * (large - small)
        far = 2.5 * half  # one that is a tenth larger or smaller than either is still within
        size = ParameterSpec("pancake_size", "-", middle, half, middle - far, middle + far, "constant")
        return (*pose, size, *camera_specs(self.camera_deviation, self.surface_deviation))

    @property
    def finds_size(self) -> bool:
        """Whether the pancake's size and the camera's error are parameters."""
        return self.small_radius > 0.0

    def body_scales(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """See `Task`: the pancake's radius; how thick it is does not show."""
        if not self.finds_size:
            return {}
        across = self._radius(self._values(values)) / self.pancake_radius
        return {PANCAKE: np.array([across, across, 1.0])}

    def camera_shift(self, values: np.ndarray) -> np.ndarray:
        """See `Task`."""
        return self._values(values)[6:] if self.finds_size else np.zeros(3)

    def as_believed(self, values: np.ndarray) -> SpatulaFlipping:
        """A pancake of another size, to 4 %: 2 mm of its radius."""
        if not self.finds_size:
            return self
        size = round(float(self._values(values)[5]) / _SIZES) * _SIZES
        times = size / self.size
        return replace(
            self,
            pancake_radius=self.pancake_radius * times,
            small_radius=self.small_radius * times,
            size=size,
        )

    def body_poses(self, values: np.ndarray) -> dict[str, Pose]:
        """The pancake, turned about an axis in the table's plane."""
        return {PANCAKE: pose_of_numbers(self._values(values)[:5])}

    def values_of(self, pancake_in_world: Pose) -> np.ndarray:
        """The parameters (P,) of a pose; its spin about the pancake's own axis is left out, its size is the
        one in here.
        """
        found = [self.size, 0.0, 0.0, 0.0] if self.finds_size else []
        return np.concatenate([numbers_of_pose(pancake_in_world), found])

    def look_alikes(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """The pancake turned over where it is."""
        turned = self.values_of(self.body_poses(values)[PANCAKE] @ _TURNED_OVER)
        turned[5:] = self._values(values)[5:]
        return (turned,)

    def is_possible(self, values: np.ndarray) -> bool:
        """The lip stops a pancake: beyond it lies only one that has fallen over it."""
        v = self._values(values)
        return bool(v[0] < self.lip_x + self.beyond or math.cos(math.hypot(v[3], v[4])) < 0.0)

    def chain_angles(self, values: np.ndarray) -> np.ndarray:
        """None: the tool is rigid."""
        self._values(values)
        return np.zeros(0)

    def values_at(self, body_in_world: dict[str, Pose], chain_angles: np.ndarray) -> np.ndarray:
        """See `Task`."""
        return self.values_of(body_in_world[PANCAKE])

    def start_joints(self, cell: CellSpec) -> dict[str, np.ndarray]:
        """Edge behind the pancake, low; camera in the middle of its region."""
        edge = np.array([self.center_x - self.start_behind, self.center_y, self.start_height])
        return start_joints(cell, self._tool(), edge, self.start_camera())

    def start_camera(self) -> Pose:
        """Camera pose in world at the start of an episode."""
        return middle_view(self.view_region(), np.pi / 3)

    def view_region(self) -> ViewRegion:
        """Shell about the place where the pancake turns."""
        return ViewRegion(
            target=np.array([0.53, 0.0, 0.04]),
            distance=(0.30, 0.45),
            azimuth=(-np.deg2rad(150.0), np.deg2rad(150.0)),
            elevation=self.view_elevation,
        )

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """`behind` the pancake, `under` it, and along the arc `turn_1`, `turn_2`, ...; empty when done.

        A tip that is neither behind the pancake nor under it nor on the arc first goes up (`clear`) and back
        over it (`over`).
        """
        tip = checked_tip(tip_position)
        if self.is_done(values, tip):
            return ()
        v = self._values(values)
        y = float(v[1])
        behind_x, low, clear_z = self.behind_x(v), self._low, self.surface + self.clear_height
        if left := self._arc.left(y, tip):
            return left
        ahead = tip[0] - (self.lip_x - self.under)
        under = SubGoal("under", np.array([self.lip_x - self.under, y, low]), 0.003, self.push_step)
        behind = SubGoal("behind", np.array([behind_x, y, low]), 0.002, self.free_step)
        rest = tuple(goal for _, goal in self._arc.goals(y))
        is_low = tip[2] < low + 0.004  # and before the rim nothing stands in its way
        free_x = behind_x + (0.5 * self.gap if is_low else 0.004)
        aside = 0.004 if tip[0] < free_x else self.aside
        if is_low and abs(tip[1] - y) < aside and tip[0] > behind_x - 0.004 and ahead < 0.0:
            return (under, *rest)
        if tip[0] < free_x:
            return (behind, under, *rest)
        over = SubGoal("over", np.array([behind_x, y, clear_z]), 0.004, self.free_step)
        if tip[2] > clear_z - 0.004:
            return (over, behind, under, *rest)
        clear = SubGoal("clear", np.array([tip[0], tip[1], clear_z]), 0.004, self.free_step)
        return (clear, over, behind, under, *rest)

    def is_done(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """The pancake's axis points down, and its centre is no higher than that of a lying one."""
        checked_tip(tip_position)
        v = self._values(values)
        low = v[2] < self.surface + self.done_height
        return bool(math.cos(math.hypot(v[3], v[4])) < self.success_axis and low)

    def start_values(self, rng: np.random.Generator) -> np.ndarray:
        """The pancake lies flat, uniform within its range, as large as it is in here."""
        half, nominal = np.array(self.half_range), np.array([p.nominal for p in self.parameters()])
        nominal[:2] += rng.uniform(-half, half)
        nominal[5:6] = self.size
        return nominal

    def sample_slides(self, rng: np.random.Generator) -> tuple[Slide, ...]:
        """The pancake, where its pan is shaken."""
        return (slide_when_shaken(PANCAKE, self.slide, rng),) if self.slide else ()

    @property
    def stands_still(self) -> bool:
        """See `Task`: not where what it lies on is shaken."""
        return not self.shaken

    @property
    def start_range(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Task`: where it lies varies, that it lies flat does not."""
        nominal = np.array([p.nominal for p in self.parameters()])
        nominal[5:6] = self.size
        spread = np.zeros(len(nominal))
        spread[:2] = self.half_range
        return nominal - spread, nominal + spread

    def succeeded(self, ending: Ending) -> bool:
        """It lies on its other face, was lifted on the way, has come to rest, and nothing was pressed."""
        turned = ending.body_in_world[PANCAKE].rotation[2, 2] < self.success_axis
        lifted = ending.body_peak_height[PANCAKE] > self.success_height
        gentle = ending.peak_contact_force <= self.force_limit
        return bool(turned and lifted and gentle and ending.body_speed[PANCAKE] < self.success_speed)

    def final_error(self, ending: Ending) -> float:
        """Way that the rim has still to go about the centre until the other face is up [m]."""
        cosine = float(np.clip(-ending.body_in_world[PANCAKE].rotation[2, 2], -1.0, 1.0))
        return self.pancake_radius * math.acos(cosine)

    def shaped_reward(self, ending: Ending) -> float:
        """Height of the pancake's centre [m]."""
        return float(ending.body_in_world[PANCAKE].position[2])

    def _tool(self) -> Tool:
        return hand_with_spatula(
            (self.blade_length, self.blade_width, self.blade_thickness),
            self.blade_tilt,
            self.edge_ahead,
            self.edge_below,
            self.blade_friction,
            self.tool_label,
        )

    @property
    def _arc(self) -> Arc:
        foot, turn = (self.lip_x, self._low), (self.arc_radius, self.arc_end, self.arc_step)
        return Arc(foot, self.under, *turn, self.push_step, self.upright, self.turn_aside)

    def _values(self, values: np.ndarray) -> np.ndarray:
        v = np.asarray(values, dtype=np.float64)
        if v.shape != (9 if self.finds_size else 5,) or not np.isfinite(v).all():
            more = ", size [-], camera x, y, z [m]" if self.finds_size else ""
            raise InputError(f"{self.name} estimates x, y, z [m], tilt_x, tilt_y [rad]{more}, got {values}")
        return v

    def behind_x(self, values: np.ndarray) -> float:
        """Where the edge comes down behind the pancake, in the tool arm's base frame [m]."""
        v = self._values(values)
        return float(v[0]) - self._radius(v) - self.gap

    @property
    def edge_height(self) -> float:
        """Of the edge's middle over a surface that its lower corner touches [m]."""
        return 0.5 * self.blade_thickness * math.cos(self.blade_tilt)

    @property
    def _low(self) -> float:
        """Height of the edge on its way under, in world [m]."""
        return self.surface + self.low

    @property
    def _sizes(self) -> tuple[float, float]:
        """The small and the large radius over the drawn one [-]."""
        return self.small_radius / self.pancake_radius, 1.0

    def _radius(self, values: np.ndarray) -> float:
        """Of the pancake by checked values [m]."""
        return self.pancake_radius / self.size * float(values[5]) if self.finds_size else self.pancake_radius
