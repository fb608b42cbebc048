"""Poses of all that moves in a state: computed once, stored with the state, used by the renderer.

Kinematics of the arm run on one core, an image is rendered in a fraction of their time on a GPU.
"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.tasks.chain import link_frames
from samrl_core.cell.tasks.start import DOWN
from samrl_core.cell.types.pose import Pose
from samrl_core.model.model import Model


class SceneFrames:
    """Frames of one model, in a fixed order: rendered links of the tool arm, bodies that the parameters move,
    links of the tool's chain. What else is rendered stands still.
    """

    def __init__(self, model: Model) -> None:
        """Builds the arm's kinematics."""
        self._task, self._cell = model.task, model.cell
        self._arm = ArmModel(model.cell.tool_arm, model.cell.tool_base_in_world, None)
        scene = model.task.scene(model.cell)
        self._tool, self._lengths = scene.tool, [link.length for link in scene.tool.chain]
        self._home = model.task.start_joints(model.cell)["tool_arm"]
        nominal = np.array([p.nominal for p in model.task.parameters()])
        self._bodies = tuple(model.task.body_poses(nominal))
        rendered = {piece.frame for piece in model.mesh.pieces}
        self._links = tuple(name for name in self._arm.link_poses_in_world(self._home) if name in rendered)
        self.names: tuple[str, ...] = (*self._links, *self._bodies, *(link.name for link in scene.tool.chain))

    @property
    def start_tip(self) -> np.ndarray:
        """Tool tip (3,) at the start of an episode, in the tool arm's base frame [m]."""
        return (self._arm.flange_in_base(self._home) @ self._tool.tip_in_flange).position

    def joints(self, tip_in_base: np.ndarray) -> np.ndarray:
        """Joint positions (J,) [rad] that put the tip (3,) [m] there, pointing down, near the start's.

        Raises:
            ReachError: the arm does not get there.
        """
        flange = Pose.from_rotation(tip_in_base, DOWN) @ self._tool.tip_in_flange.inverse()
        return solve_ik(self._arm, flange, self._home)

    def rows(self, values: np.ndarray, tool_arm_position: np.ndarray) -> np.ndarray:
        """Rotation by rows and position in world of every frame, (F, 12) [m].

        Args:
            values: (P,) in the order of `Task.parameters`.
            tool_arm_position: joint positions (J,) [rad].

        Raises:
            InputError: wrong shapes or non-finite numbers.
        """
        links = self._arm.link_poses_in_world(tool_arm_position)
        bodies = self._task.body_poses(values)
        poses = [links[name] for name in self._links] + [bodies[name] for name in self._bodies]
        rows = np.array([[*pose.rotation.ravel(), *pose.position] for pose in poses])
        if not self._lengths:
            return rows
        tip = links[self._cell.tool_arm.flange] @ self._tool.tip_in_flange
        turns, points = link_frames(self._lengths, tip, self._task.chain_angles(values))
        return np.concatenate([rows, np.hstack([turns.reshape(-1, 9), points[:-1]])])
