"""Camera views in each condition of Table I; every view is one that the camera arm reaches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.batch_views import BatchViewAscent, ViewScenes, model_images
from samrl_core.learning.sim.rollouts import Moment
from samrl_core.policy.planning.expert import label_of
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.policy.view.view_reach import View, ViewReach, motion_seconds, viewpoint_of
from samrl_core.policy.view.view_search import ViewAscentSettings, camera_poses, spread

# A moment and where the camera arms are (B, J) [rad], to the view that each goes to; None: it stays.
Chooser = Callable[[Moment, np.ndarray], Sequence[View | None]]
ONCE = 10**9  # period of a search before the first action only


@dataclass(frozen=True, eq=False)
class ViewSetup:
    """What all episodes of one task share."""

    renderer: BatchRenderer
    reach: ViewReach

    def scenes(self, moment: Moment) -> ViewScenes:
        """The moment's states."""
        m = moment
        return ViewScenes(m.values, m.tip_in_base, m.frames, m.tool_arm_position, m.appearances)

    def free(self, moment: Moment, k: int) -> list[View]:
        """Views of the grid that are clear in the k-th state of a moment."""
        return self.reach.clear_views(self.reach.obstacles(moment.tool_arm_position[k], moment.values[k]))


class MovingCamera:
    """A viewer: cameras stand where their arms have gone, from the task's start view on."""

    def __init__(
        self, bench: ViewSetup, count: int, choose: Chooser, period: int, speed_share: float
    ) -> None:
        """Begins.

        Args:
            bench: of the task.
            count: of episodes.
            choose: asked for a view of each episode at every `period`-th action, the first one included.
            period: in actions.
            speed_share: of the joints' velocity limits, for the time that motions take.
        """
        model = bench.renderer.model
        self._region, self._limits = model.task.view_region(), model.cell.camera_arm.limits
        self._choose, self._period, self._share = choose, period, speed_share
        self._joints = np.tile(model.task.start_joints(model.cell)["camera_arm"], (count, 1))
        viewpoint = viewpoint_of(model.task.start_camera().position, self._region)
        self._views = np.tile([*viewpoint, *self._region.target], (count, 1))
        self.seconds = np.zeros(count)  # of camera motion so far

    def __call__(self, moment: Moment) -> np.ndarray:
        """See `Viewer`."""
        who = moment.episodes
        if moment.step % self._period == 0:
            for k, view in zip(who, self._choose(moment, self._joints[who]), strict=True):
                if view is not None:
                    self._go(k, view)
        return self._views[who]

    def _go(self, k: int, view: View) -> None:
        velocity = self._limits.velocity
        self.seconds[k] += motion_seconds(self._joints[k], view.joint_position, velocity, self._share)
        self._joints[k] = view.joint_position
        self._views[k, :3] = viewpoint_of(view.camera_in_world.position, self._region)


def stays(moment: Moment, joints: np.ndarray) -> list[View | None]:
    """Nobody moves."""
    return [None] * len(joints)


def to_one(view: View) -> Chooser:
    """All go to the same view."""
    return lambda moment, joints: [view] * len(joints)


def at_random(bench: ViewSetup) -> Chooser:
    """Any view of the grid that is clear now."""

    def choose(moment: Moment, joints: np.ndarray) -> list[View | None]:
        found: list[View | None] = []
        for k in range(len(joints)):
            free = bench.free(moment, k)
            found.append(free[moment.rng.integers(len(free))] if free else None)
        return found

    return choose


def by_ascent(bench: ViewSetup, networks: Networks, settings: ViewAscentSettings) -> Chooser:
    """Ours."""
    ascent = BatchViewAscent(bench.renderer, networks, bench.reach, settings)

    def choose(moment: Moment, joints: np.ndarray) -> list[View | None]:
        found = ascent.plan(bench.scenes(moment), joints)
        return [one.moves[0].view if one.moves else None for one in found]

    return choose


def by_true_error(bench: ViewSetup, networks: Networks, count: int) -> Chooser:
    """Of at most `count` clear views of the grid that from which the actor errs the least.

    Its error is that against the expert, who knows the state; the images are the model's, without noise.
    """
    model = bench.renderer.model
    region = model.task.view_region()

    def errors(moment: Moment, k: int, views: list[View]) -> np.ndarray:
        expert = label_of(model.dynamics, model.task, moment.values[k], moment.tip_in_base[k]).action
        viewpoints = np.array([viewpoint_of(view.camera_in_world.position, region) for view in views])
        camera = camera_poses(torch.from_numpy(viewpoints).to(bench.renderer.device), region.target)
        which = np.full(len(views), k)
        with torch.no_grad():
            image = model_images(bench.renderer, bench.scenes(moment), which, camera)
            action = networks.actor(image).to("cpu", torch.float64).numpy()
        return np.linalg.norm(action - expert, axis=1)

    def choose(moment: Moment, joints: np.ndarray) -> list[View | None]:
        found: list[View | None] = []
        for k in range(len(joints)):
            views = spread(bench.free(moment, k), count)
            found.append(views[int(np.argmin(errors(moment, k, views)))] if views else None)
        return found

    return choose
