"""A model of peg insertion, and a cell that takes its pictures with it: no simulator, no noise."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import ArmReading, Frame, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate


class ModelPlant:
    """Pictures of the model at values that the agent is not told; the arms go where they are sent."""

    def __init__(self, model: Model, values: np.ndarray) -> None:
        self._model, self._values = model, values
        cell = model.cell
        self._tool = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
        self._camera = ArmModel(cell.camera_arm, cell.camera_base_in_world, None)
        self.joints = dict(model.task.start_joints(cell))
        self.images = 0
        self.displacements: list[np.ndarray] = []

    def observe(self) -> Observation:
        self.images += 1
        stamp, cell = self.images * 100_000_000, self._model.cell
        pose = self._camera.flange_in_world(self.joints["camera_arm"]) @ cell.camera_in_flange
        camera = Camera(cell.intrinsics, pose)
        colors = torch.as_tensor(initial_estimate(self._model).colors)
        with torch.no_grad():
            rendered = self._model.render(
                torch.as_tensor(self._values), colors, camera, self.joints["tool_arm"]
            )
        depth = rendered.depth.numpy().astype(np.float32)
        frame = Frame(
            stamp,
            np.clip(np.round(rendered.color.numpy() * 255.0), 0, 255).astype(np.uint8),
            np.where(np.isfinite(depth), depth, np.float32(np.nan)),
            rendered.label.numpy().astype(np.uint8),
        )
        zeros = np.zeros(7)
        readings = [ArmReading(stamp, self.joints[r], zeros, zeros) for r in ("tool_arm", "camera_arm")]
        return Observation(frame, camera, *readings)

    def move_camera(self, camera_arm_position: np.ndarray) -> None:
        self.joints["camera_arm"] = camera_arm_position

    def displace_tool(self, displacement: np.ndarray) -> None:
        self.displacements.append(displacement)
        flange = self._tool.flange_in_base(self.joints["tool_arm"])
        moved = Pose(flange.position + displacement, flange.quat_xyzw)
        self.joints["tool_arm"] = solve_ik(self._tool, moved, self.joints["tool_arm"])


@pytest.fixture
def plant(model: Model) -> ModelPlant:
    """The hole is 12 mm from where it is thought to be."""
    return ModelPlant(model, np.array([0.51, -0.007]))
