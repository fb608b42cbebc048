"""Next view of one state: gradient ascent of Q over the camera pose, through the renderer (`view_search`)."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import Pose
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate, initial_estimate
from samrl_core.model.real2sim.target_renderer import TargetRenderer
from samrl_core.policy.view.sensing_value import Networks, SensingValue
from samrl_core.policy.view.view_planning import ViewChoice, ViewScore
from samrl_core.policy.view.view_reach import ViewReach, bounds_of
from samrl_core.policy.view.view_search import (
    Answer,
    Request,
    SearchResult,
    ViewAscentSettings,
    ViewSearch,
    camera_poses,
)

__all__ = ["ViewAscent", "ViewAscentSettings", "camera_poses"]


class ViewAscent:
    """Chooses views of one cell and task by its networks."""

    def __init__(
        self,
        model: Model,
        cell: CellSpec,
        task: Task,
        networks: Networks,
        settings: ViewAscentSettings | None = None,
    ) -> None:
        """Builds the kinematic models."""
        self._model, self._cell, self._networks = model, cell, networks
        self._settings = settings or ViewAscentSettings()
        self._region = task.view_region()
        self._reach = ViewReach(cell, task, self._settings.reach)

    def prepare(self) -> None:
        """Solve the reachable views and compile the networks now (seconds) instead of in the first plans.

        torch keeps what it compiled for each number of images, some MB: met one by one in a run, these look
        like a leak for minutes.

        Raises:
            InputError: networks whose answer is not finite.
        """
        _ = self._reach.views
        s, joints = self._settings, self._model.task.start_joints(self._cell)["tool_arm"]
        value = SensingValue(self._model, self._networks, initial_estimate(self._model), joints)
        middle = np.mean(bounds_of(self._region), axis=0)
        asked = [(1, False), (s.initial_views, False), *((count, True) for count in range(1, s.starts + 1))]
        for count, with_gradient in asked:
            self._answer(Request(np.tile(middle, (count, 1)), with_gradient), value)

    def plan(
        self, estimate: Estimate, tool_arm_position: np.ndarray, camera_arm_position: np.ndarray
    ) -> ViewChoice:
        """Choose the next view.

        Renders at most 1 + `initial_views` images without and `starts` (1 + `steps`) with gradient, as many
        passes of either network, and one depth image for the visibility of the present view and of each of
        the best ones until some show enough. The camera does not move.

        Args:
            estimate: of the scene.
            tool_arm_position: where the tool arm will be when the image is taken (J,) [rad].
            camera_arm_position: where the camera arm is (J,) [rad].

        Raises:
            InputError: positions of wrong shape or not finite, or networks whose answer is not finite.
        """
        s = self._settings
        here = np.asarray(camera_arm_position, dtype=np.float64)
        value = SensingValue(self._model, self._networks, estimate, tool_arm_position)
        present_pose = self._reach.camera_at(here)
        with torch.no_grad():
            present = float(value.q(value.view(present_pose))[0])
        obstacles = self._reach.obstacles(tool_arm_position, estimate.values)
        search = ViewSearch(self._cell, self._region, self._reach, s, here, obstacles)

        def visibility(camera_in_world: Pose) -> float:
            camera = Camera(self._cell.intrinsics, camera_in_world)
            renderer = TargetRenderer(self._model, camera, tool_arm_position, others=estimate.values)
            return renderer.visibility(estimate.values[renderer.taken], estimate.colors)

        found = self._run_search(
            search.run(
                present, visibility(present_pose), lambda scored: visibility(scored.view.camera_in_world)
            ),
            value,
        )
        if not found.moves:
            reason = (
                f"stays: of {found.views} views none that is free and shows the target gains "
                f"{s.min_gain:g}; the most is {found.largest_gain:.3f}"
            )
            pose, joints, q = present_pose, here, present
        else:
            best = found.moves[0]
            pose, joints, q = best.view.camera_in_world, best.view.joint_position, best.q
            gain = best.utility - present
            reason = f"the best of {found.views} views gains {gain:.3f} after the price of moving"
        return ViewChoice(
            move=bool(found.moves),
            camera_in_world=pose,
            joint_position=joints,
            score=q,
            present_score=present,
            visibility=visibility(pose),
            candidates=found.views,
            reason=reason,
            scored=tuple(ViewScore(scored.view.camera_in_world, scored.q) for scored in found.scored_views),
        )

    def _run_search(
        self, asking: Generator[Request, Answer, SearchResult], value: SensingValue
    ) -> SearchResult:
        """The search's result; each of its requests is one rendering."""
        try:
            request = next(asking)
            while True:
                request = asking.send(self._answer(request, value))
        except StopIteration as end:
            return end.value

    def _answer(self, request: Request, value: SensingValue) -> Answer:
        viewpoints = torch.from_numpy(request.viewpoints).requires_grad_(request.with_gradient)
        with torch.set_grad_enabled(request.with_gradient):
            image = value.image(camera_poses(viewpoints, self._region.target))
            q, _ = value.q(image, self._settings.through_action)
        gradients = np.zeros(request.viewpoints.shape)
        if request.with_gradient:
            gradients = torch.autograd.grad(q.sum(), viewpoints)[0].numpy()
        return Answer(q.detach().numpy().astype(np.float64), gradients)
