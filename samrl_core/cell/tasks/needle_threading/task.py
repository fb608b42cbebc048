"""Needle threading after the paper: a thread of 10 links, gripped at its upper end, goes through an eye.

What is unknown is how the thread hangs, 20 joint angles. Where a needle may stand elsewhere than drawn
(`post_range`), its place and turn, the thread's length, and how far the camera shows all beside where the
encoders have it are unknown too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.instance.parts import Parts
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.chain import link_frames
from samrl_core.cell.tasks.hand import TOOL_LABEL
from samrl_core.cell.tasks.needle_threading.eye import needle_body
from samrl_core.cell.tasks.needle_threading.thread import (
    bend_angles,
    crossing_distance,
    crossing_offset,
    hanging_length,
    length_below,
    points_at,
)
from samrl_core.cell.tasks.needle_threading.tool import THREAD_COLOR, hand_with_thread, thread_links
from samrl_core.cell.tasks.needle_threading.unknowns import CAMERA, COUNT, LENGTH, PLACE, TURN, NeedleUnknowns
from samrl_core.cell.tasks.needle_threading.way_in import WayIn
from samrl_core.cell.tasks.screen import Screen, bodies_of
from samrl_core.cell.tasks.start import DOWN, checked_tip, middle_view, require_origin, start_joints
from samrl_core.cell.tasks.task import Ending, ParameterSpec, SubGoal, Task, ViewRegion
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Rgb, Scene, Tool
from samrl_core.common.errors import InputError

NEEDLE = "needle"
ENTER = "enter"  # the sub-goal that takes the thread's end into the eye of a needle that is found
_SURELY_IN = 0.006  # an end that is believed so far below the eye is not above it [m]
_LENGTHS = 0.02  # steps of a thread's length that a physics of its own is built for [-]


@dataclass(frozen=True)
class NeedleThreading(Task):
    """Settings of the task. The paper gives 10 links, two joints between neighbours, +-10 deg each and 100
    actions; 20 angles need the first link to be hinged at the gripper too. The rest is ASSUMPTION, chosen so
    that a scripted expert succeeds.

    Raises:
        InputError: a length is not positive, or the thread does not fit through the eye.
    """

    name: str = "needle_threading"
    variant_of: str = ""
    usual_policy: str = ""
    max_actions: int = 100
    links: int = 10
    link_length: float = 0.010  # [m]
    thread_radius: float = 0.002  # [m]
    link_mass: float = 0.0005  # [kg]
    stiffness: float = 0.02  # of a joint; the thread's own weight bends it by 3 deg at most [N m/rad]
    damping: float = 0.0012  # of a joint; a swing dies away within one turn [N m s/rad]
    thread_friction: float = 0.2  # [-]
    link_colors: tuple[Rgb, ...] = (THREAD_COLOR,)  # of the links in turn, over and over
    half_range: float = math.radians(10.0)  # joints hang within +- this at the start [rad]
    bend_limit: float = math.radians(45.0)  # what an estimate may say of a joint that touches the eye [rad]
    eye_x: float = 0.5  # centre of the eye, in the tool arm's base frame [m]
    eye_y: float = 0.0  # [m]
    eye_z: float = 0.12  # [m]
    eye_radius: float = 0.007  # [m]
    eye_outer_radius: float = 0.012  # [m]
    eye_thickness: float = 0.004  # [m]
    post_width: float = 0.006  # [m]
    eye_friction: float = 0.2  # [-]
    start_above: float = 0.05  # end of a straight thread above the eye's centre at the start [m]
    hover: float = 0.012  # end of the thread above the eye's centre before it goes down [m]
    success_depth: float = 0.020  # end of the thread below the eye's centre [m]
    done_margin: float = 0.002  # deeper than this beyond `success_depth` before the model says done [m]
    thread_step: float = 0.004  # length of thread between two sub-goals [m]
    free_step: float = 0.006  # largest displacement per action in free space [m]
    fine_step: float = 0.004  # the same in the eye [m]
    thread_label: int = 1
    tool_label: int = TOOL_LABEL
    needle_label: int = 5
    view_elevation: tuple[float, float] = (math.radians(20.0), math.radians(60.0))  # [rad]
    screens: tuple[Screen, ...] = ()  # that stand in the way of some views
    post_range: float = 0.0  # the needle stands within +- this of its place, in x and y [m]
    length_range: float = 0.0  # the thread is within +- this share of its drawn length [-]
    stretch: float = 1.0  # of the thread's length over that of its links as drawn; see `as_believed` [-]
    eyes: tuple[float, ...] = ()  # least and largest radius of eyes as made; (): fitted to the thread [m]
    softness: float = 1.0  # times what `Parts` says of the thread's length and stiffness [-]
    force_limit: float = math.inf  # an episode with a larger contact force has failed [N]

    def __post_init__(self) -> None:
        lengths = ("link_length", "thread_radius", "link_mass", "stiffness", "damping", "half_range")
        lengths += ("eye_thickness", "post_width", "thread_step", "free_step", "fine_step")
        for field in lengths:
            if not getattr(self, field) > 0:
                raise InputError(f"{field} is {getattr(self, field)}, must be positive")
        if not self.link_colors:
            raise InputError("link_colors is empty; give the thread one colour at least")
        if self.links < 1:
            raise InputError(f"a thread of {self.links} links hangs nowhere; give it one at least")
        if not self.thread_radius < self.eye_radius < self.eye_outer_radius:
            raise InputError(
                f"thread of radius {self.thread_radius} m, eye of {self.eye_radius} m in a ring of "
                f"{self.eye_outer_radius} m: each must be larger than the one before"
            )
        if self.eyes and not (len(self.eyes) == 2 and self.eyes[0] <= self.eye_radius <= self.eyes[1]):
            raise InputError(f"eyes are {self.eyes} m, must be two radii about {self.eye_radius} m, or none")
        if not (0 <= self.post_range < math.inf and self.softness > 0 and self.force_limit > 0):
            raise InputError(
                f"post_range is {self.post_range} m, softness {self.softness}, force_limit "
                f"{self.force_limit} N; must be at least 0 m, and positive"
            )
        if self.finds_needle and not 0.0 < self.length_range < 0.5:
            raise InputError(f"length_range is {self.length_range}, must be a share between 0 and 0.5")
        if not self.links * self.link_length > self.success_depth + self.done_margin + self.thread_step:
            raise InputError(
                f"thread of {self.links * self.link_length} m is too short to hang {self.success_depth} m "
                f"below the eye"
            )

    @property
    def eye(self) -> np.ndarray:
        """Centre of the eye (3,) in the tool arm's base frame and in world [m]."""
        return np.array([self.eye_x, self.eye_y, self.eye_z])

    @property
    def action_limit(self) -> float:
        """See `Task`."""
        return max(self.free_step, self.fine_step)

    def scene(self, cell: CellSpec) -> Scene:
        """Needle, and hand with thread.

        Raises:
            InputError: the tool arm's base is not at the world's origin.
        """
        require_origin(cell, self.name)
        needle = needle_body(
            NEEDLE,
            self.eye_radius,
            self.eye_outer_radius,
            self.eye_thickness,
            self.post_width,
            Pose(self.eye, np.array([0.0, 0.0, 0.0, 1.0])),
            self.needle_label,
            self.eye_friction,
        )
        return Scene((needle, *bodies_of(self.screens)), self._tool())

    def as_made(self, parts: Parts) -> NeedleThreading:
        """Another thread, longer, thicker and stiffer or not, and another eye."""
        radius = self.thread_radius + parts.held_size
        eye = radius + (self.eye_radius - self.thread_radius) * (1.0 + parts.clearance)
        if self.eyes:  # drilled, whatever the thread; others are sorted out
            eye = min(max(self.eye_radius * (1.0 + parts.clearance), self.eyes[0]), self.eyes[1])
        return replace(
            self,
            link_length=self.link_length * (1.0 + self.softness * parts.size[1]),
            thread_radius=radius,
            link_mass=self.link_mass * (1.0 + parts.mass),
            stiffness=self.stiffness * math.exp(self.softness * parts.stiffness),
            thread_friction=self.thread_friction * math.exp(parts.friction[0]),
            eye_radius=eye,
            eye_friction=self.eye_friction * math.exp(parts.friction[2]),
        )

    def with_needle_at(self, place: np.ndarray) -> NeedleThreading:
        """This task with a needle that is known to stand at `place` (2,), the eye's centre [m]."""
        x, y = np.asarray(place, dtype=np.float64).tolist()
        return replace(self, eye_x=x, eye_y=y, post_range=0.0)

    @property
    def finds_needle(self) -> bool:
        """Whether the needle's place, the thread's length and the camera's error are parameters."""
        return self.post_range > 0.0

    def parameters(self) -> tuple[ParameterSpec, ...]:
        """Angles of all joints about x and y, from the gripper down; uniform at the start.

        Then, if `finds_needle`: the eye's place and the needle's turn, the thread's length over the drawn
        one, and the camera's shift.
        """
        scale = self.half_range / math.sqrt(3.0)
        angles = tuple(
            ParameterSpec(f"thread_{i}_{axis}", "rad", 0.0, scale, -self.bend_limit, self.bend_limit)
            for i in range(self.links)
            for axis in "xy"
        )
        return (*angles, *self._unknowns.specs(self.eye_x, self.eye_y)) if self.finds_needle else angles

    def body_poses(self, values: np.ndarray) -> dict[str, Pose]:
        """The needle's, where it is not known."""
        found = self._found(values)
        if not len(found):
            return {}
        return {NEEDLE: Pose.from_rpy(np.array([*found[PLACE], self.eye_z]), (0.0, 0.0, float(found[TURN])))}

    def chain_angles(self, values: np.ndarray) -> np.ndarray:
        """The first of the values."""
        return self._checked(values)[: 2 * self.links]

    def chain_stretch(self, values: np.ndarray) -> float:
        """See `Task`; of the links as they are drawn in here."""
        found = self._found(values)
        return float(found[LENGTH]) / self.stretch if len(found) else 1.0

    def camera_shift(self, values: np.ndarray) -> np.ndarray:
        """See `Task`."""
        found = self._found(values)
        return found[CAMERA] if len(found) else np.zeros(3)

    def as_believed(self, values: np.ndarray) -> NeedleThreading:
        """Links of another length, to 2 %: 2 mm of a thread."""
        if not self.finds_needle:
            return self
        times = round(self.chain_stretch(values) * self.stretch / _LENGTHS) * _LENGTHS / self.stretch
        return replace(self, link_length=self.link_length * times, stretch=self.stretch * times)

    def eye_at(self, values: np.ndarray) -> np.ndarray:
        """Centre of the eye (3,) in world by the parameters (P,) [m]."""
        found = self._found(values)
        return np.array([*found[PLACE], self.eye_z]) if len(found) else self.eye

    def values_of(self, points: np.ndarray) -> np.ndarray:
        """Angles (2 K,) [rad] of a thread whose joints and end lie at `points` (links + 1, 3) [m]."""
        return bend_angles(points, DOWN)

    def thread_points(self, values: np.ndarray, tip_position: np.ndarray) -> np.ndarray:
        """Joints and end of the thread (links + 1, 3) [m], hanging from a tip that points down."""
        tip = Pose.from_rotation(checked_tip(tip_position), DOWN)
        lengths = [self.link_length * self.chain_stretch(values)] * self.links
        return link_frames(lengths, tip, self.chain_angles(values))[1]

    def values_at(self, body_in_world: dict[str, Pose], chain_angles: np.ndarray) -> np.ndarray:
        """The angles, and the needle's place; of a thread as drawn in here, and a camera without error."""
        if not self.finds_needle:
            return self._checked(chain_angles)
        x, y, _ = body_in_world[NEEDLE].position
        turn = body_in_world[NEEDLE].rotation
        found = self._unknowns.nominal(x, y, self.stretch)
        found[TURN] = math.atan2(turn[1, 0], turn[0, 0])
        return self._checked(np.concatenate([chain_angles, found]))

    def values_from_truth(self, body_in_world: dict[str, Pose], chain_points: np.ndarray) -> np.ndarray:
        """See `Task`; of the camera's error nothing is known."""
        values = self.values_at(body_in_world, self.values_of(chain_points))
        if self.finds_needle:
            length = float(np.linalg.norm(np.diff(chain_points, axis=0), axis=1).mean())
            values[2 * self.links + LENGTH] = length / self.link_length * self.stretch
        return values

    def start_joints(self, cell: CellSpec) -> dict[str, np.ndarray]:
        """A straight thread would end above the eye; camera in the middle of its region."""
        gripped = self.eye + [0.0, 0.0, self.start_above + self.links * self.link_length]
        return start_joints(cell, self._tool(), gripped, self.start_camera())

    def start_camera(self) -> Pose:
        """Camera pose in world at the start of an episode."""
        return middle_view(self.view_region(), np.pi / 3)

    def view_region(self) -> ViewRegion:
        """Shell about the eye and the thread above it."""
        return ViewRegion(
            target=self.eye + [0.0, 0.0, 0.05],
            distance=(0.30, 0.45),
            azimuth=(-np.deg2rad(150.0), np.deg2rad(150.0)),
            elevation=self.view_elevation,
        )

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """`above`: the thread's end over the eye; then `thread_1`, `thread_2`, ...: ever higher points of the
        thread, as it hangs, lie in the eye's centre. Empty when done. Where the needle is unknown, `enter`
        takes the end there first.

        An end that is below the eye but not through it first goes up (`clear`). What is beside the eye by a
        quarter of its height enters all the same where the needle is found, as `enter` goes there aslant.
        """
        tip = checked_tip(tip_position)
        if self.is_done(values, tip):
            return ()
        points, eye = self.thread_points(values, tip), self.eye_at(values)
        end, below = points[-1], length_below(points, self.eye_z)
        numbers = np.arange(1, math.ceil(self._goal_length(points) / self.thread_step) + 1)
        ahead = numbers[numbers * self.thread_step > below + 0.5 * self.thread_step]
        way = WayIn(self.eye_radius - self.thread_radius, self.hover, aslant=self.finds_needle)
        places = tip + eye - points_at(points, ahead * self.thread_step)
        places[ahead == 1] += way.aside_at_first(points_at(points, np.array([self.thread_step]))[0] - end)
        goals = [
            SubGoal(f"thread_{k}", place, 0.0015, self.fine_step)
            for k, place in zip(ahead, places, strict=True)
        ]
        over = eye + [0.0, 0.0, way.height(end[2] - eye[2])] - end
        clear: tuple[SubGoal, ...] = ()
        if below > 0.0:
            if crossing_distance(points, eye) < self.eye_radius:
                return tuple(goals)
            clear = (SubGoal("clear", tip + [0.0, 0.0, over[2]], 0.002, self.free_step),)
        outside = self.finds_needle and float(np.linalg.norm(eye - end)) > 0.0015
        enter = (SubGoal(ENTER, tip + eye - end, 0.0015, self.fine_step),) if outside else ()
        if not clear and way.is_free(end - eye):
            return (*enter, *goals)
        return (*clear, SubGoal("above", tip + over, 0.0015, self.free_step), *enter, *goals)

    def aim(self, values: np.ndarray, tip_position: np.ndarray) -> np.ndarray:
        """From the eye to where the thread passes its plane, or to its end above it, in x and y.

        Of a needle that is known every joint counts, as the trained networks were taught.
        """
        if not self.finds_needle:
            return np.zeros(0)
        return crossing_offset(self.thread_points(values, tip_position), self.eye_at(values))

    def needs_aim(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """Where the end is to enter the eye, or goes aside near it; in the eye the thread is led by it."""
        goals = self.sub_goals(values, tip_position)
        ahead = [g.name for g in goals if np.linalg.norm(g.tip_position - tip_position) > g.tolerance]
        near = bool(self.thread_points(values, tip_position)[-1, 2] < self.eye_z + self.hover + 0.001)
        return ahead[:1] == [ENTER] or (self.finds_needle and near and ahead[:1] == ["above"])

    def held_within(self, values: np.ndarray, tip_position: np.ndarray) -> float:
        """See `Task`: an end that is farther in than heights are known leaves its eye only upwards."""
        points, eye = self.thread_points(values, tip_position), self.eye_at(values)
        inside = self.finds_needle and self._threaded(points, _SURELY_IN, eye)
        return self.eye_radius - self.thread_radius if inside else math.inf

    def is_done(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """By the estimate, the thread is in the eye and its end far enough below."""
        points = self.thread_points(values, tip_position)
        return self._threaded(points, self.success_depth + self.done_margin, self.eye_at(values))

    def start_values(self, rng: np.random.Generator) -> np.ndarray:
        """All joints uniform within their range, and the needle's place within its own."""
        angles = rng.uniform(-self.half_range, self.half_range, 2 * self.links)
        if not self.finds_needle:
            return angles
        x, y = [self.eye_x, self.eye_y] + rng.uniform(-self.post_range, self.post_range, 2)
        return np.concatenate([angles, self._unknowns.nominal(x, y, self.stretch)])

    @property
    def start_range(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Task`."""
        bound = np.full(2 * self.links, self.half_range)
        if not self.finds_needle:
            return -bound, bound
        middle = self._unknowns.nominal(self.eye_x, self.eye_y, self.stretch)
        place = np.zeros(len(middle))
        place[PLACE] = self.post_range
        return np.concatenate([-bound, middle - place]), np.concatenate([bound, middle + place])

    def succeeded(self, ending: Ending) -> bool:
        """The centre line passes the eye's plane in the eye, the end is deep, and nothing was pressed."""
        eye = ending.body_in_world[NEEDLE].position
        gentle = ending.peak_contact_force <= self.force_limit
        return gentle and self._threaded(ending.chain_points, self.success_depth, eye)

    def final_error(self, ending: Ending) -> float:
        """Distance of the thread from hanging in the eye at the depth of success [m]."""
        eye = ending.body_in_world[NEEDLE].position
        missing = max(0.0, float(ending.chain_points[-1, 2]) - (float(eye[2]) - self.success_depth))
        return math.hypot(crossing_distance(ending.chain_points, eye), missing)

    def shaped_reward(self, ending: Ending) -> float:
        """Less the distance between the thread and where it hangs in the eye [m]."""
        return -self.final_error(ending)

    @property
    def _unknowns(self) -> NeedleUnknowns:
        return NeedleUnknowns(self.post_range, length=self.length_range)

    def _found(self, values: np.ndarray) -> np.ndarray:
        """What follows the angles: (7,), or (0,) where the needle is known."""
        return self._checked(values)[2 * self.links :]

    def _checked(self, values: np.ndarray) -> np.ndarray:
        v, count = np.asarray(values, dtype=np.float64), 2 * self.links + COUNT * self.finds_needle
        if v.shape != (count,) or not np.isfinite(v).all():
            more = f", then {COUNT} numbers of needle, length and camera" if self.finds_needle else ""
            raise InputError(f"a thread has {2 * self.links} joint angles [rad]{more}, got {values}")
        return v

    def _threaded(self, points: np.ndarray, depth: float, eye: np.ndarray) -> bool:
        deep = points[-1, 2] <= eye[2] - depth
        return bool(deep and crossing_distance(points, eye) < self.eye_radius)

    def _goal_length(self, points: np.ndarray) -> float:
        """Length of thread below the eye at which its end hangs deep enough, by its present shape [m]."""
        whole = self.links * self.link_length
        if self.finds_needle:
            whole = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return hanging_length(points, self.success_depth + 2 * self.done_margin, self.thread_step, whole)

    def _tool(self) -> Tool:
        inside = (self.link_mass, self.stiffness, self.damping, self.thread_friction)
        shape = (self.links, self.link_colors, self.link_length, self.thread_radius)
        chain = thread_links(*shape, *inside, self.thread_label)
        return hand_with_thread(chain, self.thread_radius, self.thread_friction, self.tool_label)
