"""Closed-loop episodes of an actor in the model, many at a time, and their returns (eq. 24).

The actor acts on rendered images alone. A view that is held over an episode makes the return depend on the
view: that is what a Q learnt from it knows about sensing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
import torch

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.common.errors import InputError, ReachError
from samrl_core.learning.images.appearance import Appearances, AppearanceSource
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.cell_errors import CellErrors
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.states.explore import Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.state_batch import joined, moved, rows
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics
from samrl_core.policy.view.views import COORDINATES, ViewSettings, sample_views

Actor = Callable[[torch.Tensor], torch.Tensor]  # images (B, 6, H, W) to actions (B, 3) [m]


@dataclass(frozen=True, eq=False)
class Moment:
    """Input of a viewer: the B episodes that go on, before their next action."""

    episodes: np.ndarray  # (B,) their numbers
    step: int  # actions that each of them has taken
    values: np.ndarray  # (B, P) in the order of `Task.parameters`
    tip_in_base: np.ndarray  # (B, 3) [m]
    frames: np.ndarray  # (B, F, 12) float32, as in `StateSamples`
    tool_arm_position: np.ndarray  # (B, J) [rad]
    appearances: Appearances | None  # of B images; None: the model's own
    rng: np.random.Generator


Viewer = Callable[[Moment], np.ndarray]  # gives the views (B, 6) of this step


def held(views: np.ndarray) -> Viewer:
    """One fixed view (E, 6) per episode."""
    return lambda moment: views[moment.episodes]


def new_each_step(region: ViewRegion, settings: ViewSettings | None = None) -> Viewer:
    """A random view for every action."""
    return lambda moment: sample_views(region, moment.rng, len(moment.episodes), settings)


@dataclass(frozen=True)
class RolloutSettings:
    """How episodes are run."""

    max_actions: int = 0  # of an episode; 0 takes the task's
    discount: float = 0.97  # gamma of eq. 24
    action_noise: float = 0.0  # per axis, standard deviation [action limits]
    appearances: AppearanceSource | None = None  # of an episode's colours and light; None: the model's own
    noise: ImageNoiseSettings | None = None  # of the camera; None: clean images, as the model's are in use
    correction: CellCorrection = NO_CORRECTION  # whose posterior an episode's cell is drawn from

    def __post_init__(self) -> None:
        if self.max_actions < 0 or self.action_noise < 0.0:
            raise InputError(
                f"max_actions {self.max_actions} and action_noise {self.action_noise} must be at least 0"
            )
        if not 0.0 < self.discount <= 1.0:
            raise InputError(f"discount is {self.discount}, must be above 0 and at most 1")


@dataclass(frozen=True, eq=False)
class ActorRollouts:
    """M actions of E episodes, in the order of their episodes."""

    values: np.ndarray  # (M, P) before the action
    tip_in_base: np.ndarray  # (M, 3) [m]
    frames: np.ndarray  # (M, F, 12) float32, as in `StateSamples`
    view: np.ndarray  # (M, 6) that the image was taken from, as `sample_views` gives them
    action: np.ndarray  # (M, 3) that was taken [m]
    returns: np.ndarray  # (M,) discount^(actions still to come) of a success, 0 of a failure
    episode: np.ndarray  # (M,) int64
    step: np.ndarray  # (M,) int64 within the episode
    success: np.ndarray  # (E,) bool, by `Task.is_done`
    actions: np.ndarray  # (E,) int64 how many were taken


# Fields with one row per action, as a training keeps them.
PER_ACTION = tuple(f.name for f in fields(ActorRollouts) if f.name not in ("success", "actions"))


def roll_out(
    model: Model,
    renderer: BatchRenderer,
    actor: Actor,
    starts: Starts,
    viewer: Viewer,
    settings: RolloutSettings,
    rng: np.random.Generator,
    dynamics: TaskDynamics | None = None,
) -> ActorRollouts:
    """Episodes side by side until all have ended; the same ones for the same generator.

    An episode succeeds when the task is done in the model. It fails at its last action, where the equations
    of motion are not solved, and where the arm does not reach.

    Args:
        model: moves the scene and decides about success.
        renderer: of the same model.
        actor: acts on images on the renderer's device; longer actions than the task's limit are cut.
        starts: E states at rest.
        viewer: where the camera is, e.g. `held(views)`.
        settings: of the episodes.
        rng: source of everything random.
        dynamics: moves in the model's place, e.g. with other physical parameters.

    Raises:
        InputError: no start, views of a wrong shape, or an action that is not finite.
    """
    moves = dynamics or model.dynamics
    return _Episodes(model, moves, renderer, actor, starts, viewer, settings, rng).run()


class _Episodes:
    def __init__(
        self,
        model: Model,
        dynamics: TaskDynamics,
        renderer: BatchRenderer,
        actor: Actor,
        starts: Starts,
        viewer: Viewer,
        settings: RolloutSettings,
        rng: np.random.Generator,
    ) -> None:
        count = len(starts.values)
        if count == 0:
            raise InputError("no start was given; an episode needs one")
        self._task, self._dynamics = model.task, dynamics
        self._renderer, self._actor, self._viewer = renderer, actor, viewer
        self._settings, self._rng = settings, rng
        self._frames = SceneFrames(model)
        self._generator = torch.Generator(renderer.device).manual_seed(int(rng.integers(2**62)))
        self._appearances = (
            None if settings.appearances is None else settings.appearances.sample(model, rng, count)
        )
        self._errors = CellErrors.draw_cells(settings.correction, rng, count)
        self._states = joined(
            [self._dynamics.start(*pair) for pair in zip(starts.values, starts.tip_in_base, strict=True)]
        )
        self._alive = np.arange(count)  # episode of each state
        self._success = np.zeros(count, dtype=bool)
        self._actions = np.zeros(count, dtype=np.int64)
        self._taken: list[dict[str, np.ndarray]] = []

    def run(self) -> ActorRollouts:
        """All episodes."""
        self._settle(np.ones(len(self._alive), dtype=bool))
        for step in range(self._settings.max_actions or self._task.max_actions):
            observed = self._observe()
            if not len(self._alive):
                break
            action = self._act(observed, step)
            count = len(self._alive)
            number = np.full(count, step, dtype=np.int64)
            self._taken.append({**observed, "action": action, "episode": self._alive.copy(), "step": number})
            self._actions[self._alive] += 1
            self._states, solved = moved(self._dynamics, self._states, action)
            self._settle(solved)
        return self._result()

    def _settle(self, going: np.ndarray) -> None:
        """Ends the episodes that are done, or not going on."""
        for i, q in enumerate(self._states.q.numpy()):
            if going[i] and self._task.is_done(*self._dynamics.read(q)):
                self._success[self._alive[i]] = True
                going[i] = False
        self._keep(going)

    def _keep(self, going: np.ndarray) -> None:
        if not going.all():
            self._states = rows(self._states, np.flatnonzero(going))
            self._alive = self._alive[going]

    def _observe(self) -> dict[str, np.ndarray]:
        """States to render, of every episode that goes on; ends those that the arm cannot reach."""
        found: list[tuple[np.ndarray, ...]] = []
        reached = np.ones(len(self._alive), dtype=bool)
        for i, q in enumerate(self._states.q.numpy()):
            values, tip = self._dynamics.read(q)
            try:
                joints = self._frames.joints(tip)
                frames = self._frames.rows(values, joints)
                found.append((values, tip, frames.astype(np.float32), joints))
            except ReachError:
                reached[i] = False
        self._keep(reached)
        columns = (np.array(column) for column in zip(*found, strict=True))
        names = ("values", "tip_in_base", "frames", "tool_arm_position")
        return dict(zip(names, columns, strict=False))

    def _act(self, observed: dict[str, np.ndarray], step: int) -> np.ndarray:
        """Views, images and actions (B, 3) [m] of one step; the views are added to `observed`."""
        count = len(self._alive)
        appearances = None if self._appearances is None else self._appearances.rows(self._alive)
        moment = Moment(self._alive.copy(), step, **observed, appearances=appearances, rng=self._rng)
        view = np.asarray(self._viewer(moment))
        if view.shape != (count, COORDINATES):
            raise InputError(f"views have shape {view.shape}, must be ({count}, {COORDINATES})")
        observed["view"] = view
        images = self._renderer.images(
            observed["frames"],
            observed["tip_in_base"],
            view,
            appearances,
            self._settings.noise,
            self._generator,
            self._errors.rows(self._alive),
        )
        with torch.no_grad():
            action = self._actor(images).to("cpu", torch.float64).numpy()
        limit = self._task.action_limit
        action = action + self._settings.action_noise * limit * self._rng.standard_normal((count, 3))
        if not np.isfinite(action).all():
            raise InputError(
                "the actor gave an action that is not finite; its weights or its image are broken"
            )
        length = np.linalg.norm(action, axis=1, keepdims=True)
        return action * np.minimum(1.0, limit / np.maximum(length, 1e-12))

    def _result(self) -> ActorRollouts:
        names = [name for name in PER_ACTION if name != "returns"]
        if not self._taken:
            raise InputError("all episodes were done, or out of the arm's reach, before their first action")
        columns = {name: np.concatenate([one[name] for one in self._taken]) for name in names}
        order = np.lexsort((columns["step"], columns["episode"]))
        columns = {name: column[order] for name, column in columns.items()}
        episode = columns["episode"]
        ahead = self._actions[episode] - 1 - columns["step"]
        returns = np.where(self._success[episode], self._settings.discount**ahead, 0.0)
        return ActorRollouts(**columns, returns=returns, success=self._success, actions=self._actions)
