"""Next view by expected information, through the renderer (Algorithm 1, lines 6 and 10).

The paper ascends a learned Q. This score needs no training: the Fisher information that the next image would
add about the task's parameters, occlusion by the tool and its arm included.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from samrl_core.cell.robots.geometry import Capsules
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.information import ImageNoise, TargetImage, view_information
from samrl_core.model.real2sim.part_fit import PartSettings
from samrl_core.model.real2sim.pose_fit import PoseFitSettings, acts_together
from samrl_core.model.real2sim.prediction import CameraErrors, seen_from_elsewhere
from samrl_core.model.real2sim.real2sim import Estimate, Real2SimSettings
from samrl_core.model.real2sim.target_renderer import TargetRenderer
from samrl_core.model.real2sim.thread_line import line_equations
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.policy.view.view_reach import SPEED_SHARE, ReachSettings, View, ViewReach, motion_seconds

STRATEGIES = ("best", "fixed", "random")


@dataclass(frozen=True)
class ViewPlanningSettings:
    """Error model, penalty for moving, and how many views are rendered in full."""

    noise: ImageNoise = field(default_factory=ImageNoise)
    parts: PartSettings = field(default_factory=PartSettings)  # of targets with several labels
    reach: ReachSettings = ReachSettings()
    coarse_scale: int = 2  # the first images of all views are this many times smaller
    finalists: int = 4  # views that are rendered in full
    jacobian_step: float = Real2SimSettings.jacobian_step  # half span of the differences [parameter's scale]
    min_gain: float = 0.15  # least gain over the present view, the motion's penalty subtracted [nat]
    time_penalty: float = 0.03  # of camera motion [nat/s]
    enough: float = 0.0006  # standard deviation of a task's aim below which the camera stays [m]
    camera: CameraErrors = CameraErrors()  # that a view elsewhere has
    speed_share: float = SPEED_SHARE  # of the joints' velocity limits, for the time of a motion


@dataclass(frozen=True, eq=False)
class ViewScore:
    """A view that was considered, and its score before the penalty for moving."""

    camera_in_world: Pose  # optical frame
    score: float  # as of `ViewChoice`


@dataclass(frozen=True, eq=False)
class ViewChoice:
    """The answer: move there, or stay."""

    move: bool
    camera_in_world: Pose  # optical frame
    joint_position: np.ndarray  # (J,) of the camera arm [rad]
    score: float  # expected log det of information in units of the parameters' scales [nat]; or Q, 0..1
    present_score: float  # the same from the present view [nat]
    visibility: float  # expected visible share of the target's surface that faces the camera, 0..1
    candidates: int  # views that were scored
    reason: str
    scored: tuple[ViewScore, ...] = ()  # these views, the present one left out


@dataclass(frozen=True, eq=False)
class _Scored:
    camera_in_world: Pose
    joint_position: np.ndarray
    score: float
    utility: float  # score less the penalty of the motion


class ViewPlanner:
    """Chooses among the reachable views of one cell and task."""

    def __init__(
        self, model: Model, cell: CellSpec, task: Task, settings: ViewPlanningSettings | None = None
    ) -> None:
        """Builds a second, smaller renderer for the first comparison."""
        self._model, self._cell = model, cell
        self._settings = s = settings or ViewPlanningSettings()
        k, c = cell.intrinsics, s.coarse_scale
        small = Intrinsics(k.width // c, k.height // c, k.fx / c, k.fy / c, k.cx / c, k.cy / c)
        self._small_model = Model(task, replace(cell, intrinsics=small), ModelSettings())
        self._reach = ViewReach(cell, task, s.reach)

    @property
    def camera_errors(self) -> CameraErrors:
        """That a view elsewhere is believed to have."""
        return self._settings.camera

    def believing(self, errors: CameraErrors) -> ViewPlanner:
        """The same planner, its reachable views included, for a camera of other errors."""
        other = copy(self)
        other._settings = replace(self._settings, camera=errors)
        return other

    def prepare(self) -> None:
        """Solve the reachable views now (seconds) instead of in the first plan."""
        _ = self._reach.views

    def plan(
        self,
        estimate: Estimate,
        tool_arm_position: np.ndarray,
        camera_arm_position: np.ndarray,
        strategy: str = "best",
        rng: np.random.Generator | None = None,
    ) -> ViewChoice:
        """Choose the next view.

        Args:
            estimate: of the scene, with its covariance.
            tool_arm_position: where the tool arm will be when the image is taken (J,) [rad].
            camera_arm_position: where the camera arm is (J,) [rad].
            strategy: "best" by score; "fixed" stays; "random" takes any reachable and clear view.
            rng: for "random".

        Raises:
            InputError: unknown strategy, "random" without `rng`, or positions of wrong shape or not finite.
        """
        if strategy not in STRATEGIES:
            raise InputError(f"no view strategy is named {strategy!r}; there are: {', '.join(STRATEGIES)}")
        here = np.asarray(camera_arm_position, dtype=np.float64)
        scorer = ViewScorer(
            self._model, self._small_model, self._settings, estimate, tool_arm_position,
            self._reach.camera_at(here),
        )  # fmt: skip
        present = scorer.score(scorer.present)
        stay = _Scored(scorer.present, here, present, present)
        if strategy == "fixed":
            return self._choice(stay, stay, [], scorer, "fixed view")
        if strategy == "best" and scorer.is_aim_known():
            return self._choice(stay, stay, [], scorer, "stays: sees enough")
        obstacles = self._reach.obstacles(tool_arm_position, estimate.values)
        free = self._reach.clear_views(obstacles)
        free, stay = self._lasting(free, stay, self._reach.way_capsules(tool_arm_position, estimate.values))
        if strategy == "random":
            if rng is None:
                raise InputError("strategy 'random' needs a generator; hand in np.random.default_rng(seed)")
            return self._random(free, obstacles, stay, scorer, rng)
        return self._best(free, obstacles, stay, scorer)

    def _lasting(self, free: list[View], stay: _Scored, coming: Capsules) -> tuple[list[View], _Scored]:
        """Views that the tool arm's way to its sub-goals leaves free too, if there are any, and to stay.

        A camera beside that way sees best, until the arm comes before it and no way leads out.
        """
        lasting = [view for view in free if self._reach.is_clear(view.capsules, coming)]
        if not lasting:
            return free, stay
        here = self._reach.camera_capsules(stay.joint_position)
        return lasting, stay if self._reach.is_clear(here, coming) else replace(stay, utility=-np.inf)

    def _best(self, free: list[View], obstacles: Capsules, stay: _Scored, scorer: ViewScorer) -> ViewChoice:
        s = self._settings
        seen = [self._scored(view, stay, scorer.score_coarsely(view.camera_in_world)) for view in free]
        order = sorted(range(len(free)), key=lambda i: -seen[i].utility)
        finalists: list[_Scored] = []
        for i in order:
            if len(finalists) == s.finalists:
                break
            if self._reach.way_is_clear(stay.joint_position, free[i].joint_position, obstacles):
                seen[i] = self._scored(free[i], stay, scorer.score(free[i].camera_in_world))
                finalists.append(seen[i])
        if not finalists:
            reason = f"stays: none of {len(free)} views can be reached without collision"
            return self._choice(stay, stay, seen, scorer, reason)
        best = max(finalists, key=lambda f: f.utility)
        gain = best.utility - stay.utility
        if gain <= s.min_gain:
            reason = f"stays: the best of {len(free)} views gains {gain:.2f} nat, below {s.min_gain:.2f}"
            return self._choice(stay, stay, seen, scorer, reason)
        reason = f"the best of {len(free)} views gains {gain:.2f} nat after the price of its motion"
        if not np.isfinite(stay.utility):
            reason = f"the best of {len(free)} views: the tool arm's way leads through the present one"
        return self._choice(best, stay, seen, scorer, reason)

    def _random(
        self,
        free: list[View],
        obstacles: Capsules,
        stay: _Scored,
        scorer: ViewScorer,
        rng: np.random.Generator,
    ) -> ViewChoice:
        for i in rng.permutation(len(free)):
            if self._reach.way_is_clear(stay.joint_position, free[i].joint_position, obstacles):
                sampled = self._scored(free[i], stay, scorer.score(free[i].camera_in_world))
                return self._choice(sampled, stay, [sampled], scorer, f"drawn among {len(free)} views")
        reason = f"stays: none of {len(free)} views can be reached without collision"
        return self._choice(stay, stay, [], scorer, reason)

    def _scored(self, view: View, stay: _Scored, score: float) -> _Scored:
        s, velocity = self._settings, self._cell.camera_arm.limits.velocity
        seconds = motion_seconds(stay.joint_position, view.joint_position, velocity, s.speed_share)
        return _Scored(view.camera_in_world, view.joint_position, score, score - s.time_penalty * seconds)

    def _choice(
        self, view: _Scored, stay: _Scored, seen: list[_Scored], scorer: ViewScorer, reason: str
    ) -> ViewChoice:
        return ViewChoice(
            move=view is not stay,
            camera_in_world=view.camera_in_world,
            joint_position=view.joint_position,
            score=view.score,
            present_score=stay.score,
            visibility=scorer.visibility(view.camera_in_world),
            candidates=len(seen),
            reason=reason,
            scored=tuple(ViewScore(s.camera_in_world, s.score) for s in seen),
        )


class ViewScorer:
    """What the next image would tell from a view, of one estimate and with the tool arm in one place."""

    def __init__(
        self,
        model: Model,
        small_model: Model,
        settings: ViewPlanningSettings,
        estimate: Estimate,
        tool: np.ndarray,
        present: Pose,
    ) -> None:
        """`tool` (J,) [rad] is where the arm will be; `present` the view that the estimate is from."""
        self.present = present
        self._model, self._small_model, self._settings = model, small_model, settings
        self._estimate, self._tool = estimate, tool
        self._scale = np.array([p.scale for p in model.task.parameters()])
        self._aim = self._aim_jacobian()

    def score(self, camera_in_world: Pose) -> float:
        """log det of the information after an image from there, in units of the parameters' scales [nat].

        Where the task has an aim, the information about that, in millimetres.
        """
        return self._score(camera_in_world, self._model, 1)

    def score_coarsely(self, camera_in_world: Pose) -> float:
        """The same by a smaller image, in less time."""
        return self._score(camera_in_world, self._small_model, self._settings.coarse_scale)

    def visibility(self, camera_in_world: Pose) -> float:
        """Visible share of the target's surface that faces a camera there, 0..1."""
        camera, estimate = Camera(self._model.cell.intrinsics, camera_in_world), self._estimate
        target = TargetRenderer(self._model, camera, self._tool, others=estimate.values)
        return target.visibility(estimate.values[target.taken], estimate.colors)

    def is_aim_known(self) -> bool:
        """Whether the task has an aim, and what it is known by already is enough."""
        if not len(self._aim):
            return False
        spread = np.linalg.eigvalsh(self._aim @ self._estimate.covariance @ self._aim.T).max()
        return float(np.sqrt(spread)) < self._settings.enough

    def _score(self, camera_in_world: Pose, model: Model, scale: int) -> float:
        """With images of a model that are `scale` times smaller than the camera's."""
        way = float(np.linalg.norm(camera_in_world.position - self.present.position))
        turn = camera_in_world.angle_to(self.present)
        specs = model.task.parameters()
        there = seen_from_elsewhere(self._estimate, specs, way, turn, self._settings.camera)
        total = np.linalg.inv(there.covariance) + self._information(model, camera_in_world, there, scale)
        if len(self._aim):
            return -float(np.linalg.slogdet(1e6 * self._aim @ np.linalg.inv(total) @ self._aim.T)[1])
        return float(np.linalg.slogdet(total * np.outer(self._scale, self._scale))[1])

    def _aim_jacobian(self) -> np.ndarray:
        """How the task's aim changes with the values (A, P), by differences of a thousandth of a scale."""
        task, values = self._model.task, self._estimate.values
        tip = self._model.tip_in_base(self._tool).position
        steps = np.diag(1e-3 * self._scale)
        ends = [(task.aim(values + h, tip), task.aim(values - h, tip)) for h in steps]
        return np.array([a - b for a, b in ends]).T.reshape(-1, len(values)) / (2e-3 * self._scale)

    def _information(self, model: Model, camera_in_world: Pose, there: Estimate, scale: int) -> np.ndarray:
        """(P, P) of an image of the estimate as seen from there, over all parts of the target."""
        matrix = np.zeros((len(self._scale), len(self._scale)))
        camera = Camera(model.cell.intrinsics, camera_in_world)
        for part in range(len(model.parts)):
            renderer = TargetRenderer(model, camera, self._tool, part=part, others=there.values)
            at = renderer.taken
            matrix[np.ix_(at, at)] += self._information_of_part(model, renderer, there, scale)
        return matrix

    def _information_of_part(
        self, model: Model, renderer: TargetRenderer, there: Estimate, scale: int
    ) -> np.ndarray:
        """(T, T) of the values that move the part which a renderer draws."""
        s, colors = self._settings, there.colors
        values, several = there.values[renderer.taken], len(model.parts) > 1
        if several and renderer.thin:
            seen = renderer.image(values, colors).mask
            cover = seen.astype(np.float64)
            return line_equations(renderer, values, cover, seen, s.parts.line, 1.0 / scale).information
        step = s.jacobian_step * scale * self._scale[renderer.taken]
        if acts_together(model.task):  # a parameter's scale hardly determines how far it moves the picture
            step = renderer.pixel_steps(values, PoseFitSettings.jacobian_pixels)
        noise = s.parts.noise if several else s.noise

        def image(at: np.ndarray) -> TargetImage:
            return renderer.image(at, colors)

        return view_information(image, values, step, noise, 1.0 / scale, central=scale == 1).matrix
