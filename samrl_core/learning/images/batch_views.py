"""Views of many episodes at once: in each the search of `ViewAscent`, their images rendered together."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.learning.images.appearance import Appearances, model_appearances
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.model.model import CameraPose, world_to_camera
from samrl_core.policy.networks.network_image import rendered_image, upright
from samrl_core.policy.view.sensing_value import Networks, value_of
from samrl_core.policy.view.view_reach import ViewReach
from samrl_core.policy.view.view_search import (
    Answer,
    Request,
    SearchResult,
    ViewAscentSettings,
    ViewSearch,
    camera_poses,
)


@dataclass(frozen=True, eq=False)
class ViewScenes:
    """B states, for the renderer and for the camera arm's clearance."""

    values: np.ndarray  # (B, P) in the order of `Task.parameters`
    tip_in_base: np.ndarray  # (B, 3) [m]
    frames: np.ndarray  # (B, F, 12) of `SceneFrames.rows`
    tool_arm_position: np.ndarray  # (B, J) [rad]
    appearances: Appearances | None = None  # of B images; None: the model's own


def model_images(
    renderer: BatchRenderer, scenes: ViewScenes, which: np.ndarray, camera: CameraPose
) -> torch.Tensor:
    """The model's images of states `which` (N,) from N cameras with their top up, in one batch.

    Returns:
        Network images (N, 6, H, W) on the renderer's device, differentiable in the camera.
    """
    appearances = scenes.appearances or model_appearances(renderer.model, len(scenes.values))
    rendered = renderer.render(scenes.frames[which], camera, appearances.rows(which))
    return rendered_image(rendered, camera, scenes.tip_in_base[which], renderer.model.cell)


class BatchViewAscent:
    """Chooses views of one model's states by its networks, on the renderer's device.

    The arm's kinematics and clearances are worked out state by state on the CPU, some 50 ms each: views are
    as continuous, and as surely reached and clear, as those of the single search.
    """

    def __init__(
        self,
        renderer: BatchRenderer,
        networks: Networks,
        reach: ViewReach,
        settings: ViewAscentSettings | None = None,
    ) -> None:
        """Moves nothing.

        Args:
            renderer: of the model.
            networks: on the renderer's device.
            reach: of the model's task and cell; its grid is solved once for all that share it.
            settings: of the search; `reach` has its own.
        """
        self._renderer, self._networks, self._reach = renderer, networks, reach
        self._settings = settings or ViewAscentSettings()
        self._region = renderer.model.task.view_region()

    def plan(self, scenes: ViewScenes, camera_arm_position: np.ndarray) -> list[SearchResult]:
        """Choose the next view of each state.

        Args:
            scenes: B states.
            camera_arm_position: where the camera arm is in each (B, J) [rad].

        Raises:
            InputError: networks whose answer is not finite.
        """
        count = len(scenes.values)
        present = self._present(scenes, camera_arm_position)
        cell = self._renderer.model.cell
        asking: list[Generator[Request, Answer, SearchResult]] = []
        for k, here in enumerate(camera_arm_position):
            obstacles = self._reach.obstacles(scenes.tool_arm_position[k], scenes.values[k])
            search = ViewSearch(cell, self._region, self._reach, self._settings, here, obstacles)
            asking.append(search.run(float(present[k])))
        found: dict[int, SearchResult] = {}
        answers: dict[int, Answer | None] = dict.fromkeys(range(count))
        while answers:
            requests: dict[int, Request] = {}
            for k, answer in answers.items():
                try:
                    requests[k] = next(asking[k]) if answer is None else asking[k].send(answer)
                except StopIteration as end:
                    found[k] = end.value
            answers = self._answers(scenes, requests)
        return [found[k] for k in range(count)]

    def _present(self, scenes: ViewScenes, positions: np.ndarray) -> np.ndarray:
        """Q of the present views (B,)."""
        poses = [self._reach.camera_at(here) for here in positions]
        found = []
        for few in self._chunks(len(poses)):
            cameras = [world_to_camera(poses[k]) for k in few]
            rotation, translation = (torch.stack(part) for part in zip(*cameras, strict=True))
            with torch.no_grad():
                camera = (self._tensor(rotation), self._tensor(translation))
                image = model_images(self._renderer, scenes, few, camera)
                image = upright(image, np.array([poses[k].rotation for k in few]))
                found.append(value_of(self._networks, image)[0].cpu().numpy())
        return np.concatenate(found)

    def _answers(self, scenes: ViewScenes, requests: dict[int, Request]) -> dict[int, Answer | None]:
        answers: dict[int, Answer | None] = {}
        for with_gradient in (False, True):
            some = {k: one for k, one in requests.items() if one.with_gradient == with_gradient}
            if not some:
                continue
            counts = [len(one.viewpoints) for one in some.values()]
            which = np.repeat(np.array(list(some)), counts)
            viewpoints = np.concatenate([one.viewpoints for one in some.values()])
            parts = [
                self._score(scenes, which[f], viewpoints[f], with_gradient)
                for f in self._chunks(len(viewpoints))
            ]
            q, gradients = (np.concatenate(part) for part in zip(*parts, strict=True))
            ends = np.cumsum(counts)[:-1]
            for k, one, gradient in zip(some, np.split(q, ends), np.split(gradients, ends), strict=True):
                answers[k] = Answer(one, gradient)
        return answers

    def _score(
        self, scenes: ViewScenes, which: np.ndarray, viewpoints: np.ndarray, with_gradient: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Q (N,) and its gradients (N, 3) by the viewpoint."""
        variable = self._tensor(torch.from_numpy(viewpoints)).requires_grad_(with_gradient)
        with torch.set_grad_enabled(with_gradient):
            camera = camera_poses(variable, self._region.target)
            image = model_images(self._renderer, scenes, which, camera)
            q, _ = value_of(self._networks, image, self._settings.through_action)
        gradients = np.zeros(viewpoints.shape)
        if with_gradient:
            gradients = torch.autograd.grad(q.sum(), variable)[0].cpu().numpy()
        return q.detach().cpu().numpy().astype(np.float64), gradients

    def _chunks(self, count: int) -> list[np.ndarray]:
        chunk = self._renderer.chunk
        return [np.arange(start, min(start + chunk, count)) for start in range(0, count, chunk)]

    def _tensor(self, values: torch.Tensor) -> torch.Tensor:
        return values.to(self._renderer.device, torch.float64)
