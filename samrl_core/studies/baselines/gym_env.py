"""The simulated cell as a Gymnasium environment, for learners that know no model (SAM-RL, section IV-C).

They see what SAM-RL's residual sees, from one fixed view: the RGB-XYZ image and the tip. Reward and success
come from evaluation, as theirs do in the paper; no observation holds any of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.evaluation import evaluate_now
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.tool_motion import ToolMotion
from samrl_core.common.errors import InputError, ReachError
from samrl_core.policy.agent.exploration import clip_norm
from samrl_core.policy.agent.policies import DEFAULT_POLICY
from samrl_core.policy.networks.network_image import (
    CHANNELS,
    COLOR_CENTER,
    COLOR_UNIT,
    XYZ_CLIP,
    observed_image,
)
from samrl_core.studies.episodes.cell_driver import CellDriver
from samrl_core.studies.episodes.differing_world import differing_cell, differing_settings
from samrl_core.studies.episodes.residual_episodes import EpisodeSite

PERIOD_S = 0.1  # of an action [s]
TIP_LIMIT = 2.0  # no tip is farther from its arm's base, per axis [m]


class CellEnv(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """One task in PyBullet, with the camera where the task's episodes start.

    Observation: `image` (6, H, W) float32, see `network_image`, and `tip` (3,) float32 in the tool
    arm's base frame [m]. Action: displacement of the tip (3,) in the same frame [m]; the action space is a
    cube, as these learners take it, and an action longer than the task's limit is shortened to it, so that
    nobody moves faster than SAM-RL's nominal actions. Reward: the paper's, in
    metres (`Task.shaped_reward`); an episode terminates in success, is truncated after `max_actions`.
    `info` has `success`, `final_error` [m] and `refused`, true where the arm cannot reach what was asked for
    and stood still.

    Raises:
        InputError: there is no such task.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / PERIOD_S)}  # noqa: RUF012 (Gymnasium's)

    def __init__(
        self,
        task: str,
        settings: WorldSettings | None = None,
        render_mode: str | None = None,
        real_cell: CellSpec | None = None,
        max_actions: int = 0,
    ) -> None:
        """Build the world.

        Args:
            task: its name.
            settings: physics and noise of the world.
            render_mode: None or "rgb_array".
            real_cell: the cell as it is in the world, which no observation contains; those are made by the
                calibration of `cell_named`.
            max_actions: of an episode, 0 for the task's.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode is {render_mode!r}, must be None or 'rgb_array'")
        if max_actions < 0:
            raise InputError(f"max_actions is {max_actions}, must be at least 0")
        self.render_mode = render_mode
        self._task, self._cell = task_named(task), cell_named()
        self._max_actions = max_actions or self._task.max_actions
        self._world = PyBulletWorld(self._task, real_cell or self._cell, settings)
        self._motion = ToolMotion(self._world, self._task, self._cell, PERIOD_S)
        self._driver = CellDriver(self._world, self._cell, self._task.scene(self._cell).tool)
        self._color = np.zeros(0, dtype=np.uint8)  # of the newest observation
        self._actions = 0
        k = self._cell.intrinsics
        paint = max(COLOR_CENTER, 1.0 - COLOR_CENTER) / COLOR_UNIT
        bound = np.full((CHANNELS, k.height, k.width), XYZ_CLIP, dtype=np.float32)
        bound[:3] = paint
        limit = self._task.action_limit
        self.action_space = spaces.Box(-limit, limit, (3,), np.float32)
        # Any: Gymnasium types a Dict space by its spaces, an Env's by what they contain.
        observed: Any = spaces.Dict(
            {
                "image": spaces.Box(-bound, bound, dtype=np.float32),
                "tip": spaces.Box(-TIP_LIMIT, TIP_LIMIT, (3,), np.float32),
            }
        )
        self.observation_space = observed

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Lay the scene anew; every episode samples its own from the seed that was given last."""
        super().reset(seed=seed)
        self._world.reset(int(self.np_random.integers(2**31)))
        self._motion.begin()
        self._actions = 0
        return self._observe(), self._evaluate(refused=False)[1]

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Displace the tip.

        Raises:
            InputError: the action is outside the action space.
        """
        wanted = np.asarray(action, dtype=np.float32)
        if not self.action_space.contains(wanted):
            raise InputError(
                f"action {action} is not three numbers within +-{self._task.action_limit} m; rescale it"
            )
        refused = False
        try:
            self._motion.displace(clip_norm(wanted.astype(np.float64), self._task.action_limit))
        except ReachError:
            refused = True
            self._motion.rest()
        self._actions += 1
        reward, info = self._evaluate(refused)
        truncated = self._actions >= self._max_actions and not info["success"]
        return self._observe(), reward, info["success"], truncated, info

    def render(self) -> np.ndarray | None:
        """The newest colour image (H, W, 3) uint8 with render_mode "rgb_array", else None."""
        return self._color.copy() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Release the world; twice is harmless."""
        self._world.close()

    def _observe(self) -> dict[str, np.ndarray]:
        observation, tip = self._driver.observe(), self._motion.tip()
        self._color = observation.frame.color
        image = observed_image(observation, tip, self._cell).numpy()
        return {"image": image, "tip": tip.astype(np.float32)}

    def _evaluate(self, refused: bool) -> tuple[float, dict[str, Any]]:
        outcome = evaluate_now(self._world, self._task)
        info = {"success": outcome.success, "final_error": outcome.final_error, "refused": refused}
        return outcome.reward, info


def differing_env(task: str, offset: Sequence[float], render_mode: str | None = None) -> CellEnv:
    """The environment of the experiment `sample_efficiency`: its world, and episodes of the same length.

    Args:
        task: its name.
        offset: (3,) how far off the camera arm's base stands, in world [m]; `sample_efficiency.json` has it
            under the task's `gap`.
        render_mode: of `CellEnv`.

    Raises:
        InputError: there is no such task, or the offset is not three finite numbers.
    """
    if np.shape(offset) != (3,) or not np.isfinite(offset).all():
        raise InputError(f"offset is {offset}, must be three finite numbers [m]")
    world = EpisodeSite(task, DEFAULT_POLICY, None, (offset[0], offset[1], offset[2]))
    real = differing_cell(cell_named(), world.offset)
    return CellEnv(task, differing_settings(), render_mode, real, world.max_actions)
