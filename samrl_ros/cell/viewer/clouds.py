"""Point clouds for viewers: of the camera's depth, and of the model seen from the same place."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
import torch

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.model.model import Model
from samrl_ros.conversions import from_message, to_message
from samrl_ros.conversions.model_state import from_state

FRAME = "camera_color_optical_frame"
STRIDE = 2  # of pixels, in both directions: a quarter of the points
SLOP_NS = 20_000_000  # between an image and the joint states that are taken for it


def depth_points(depth: np.ndarray, colors: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """Points of a depth image as rows x, y, z [m], packed rgb (N, 4), in the optical frame.

    Args:
        depth: (H, W) [m]; what is not finite is left out.
        colors: (H, W, 3) uint8.
        intrinsics: of both.
    """
    v, u = np.mgrid[0 : depth.shape[0] : STRIDE, 0 : depth.shape[1] : STRIDE]
    z = depth[v, u]
    seen = np.isfinite(z) & (z > 0)
    u, v, z = u[seen] + 0.5, v[seen] + 0.5, z[seen]
    x, y = (u - intrinsics.cx) / intrinsics.fx * z, (v - intrinsics.cy) / intrinsics.fy * z
    rgb = to_message.packed_rgb(colors[::STRIDE, ::STRIDE][seen])
    return np.column_stack([x, y, z, rgb]).astype(np.float32)


def cloud(points: np.ndarray, stamp_ns: int) -> Any:
    """`depth_points` as sensor_msgs/PointCloud2."""
    return to_message.cloud(points, ("x", "y", "z", "rgb"), stamp_ns, FRAME)


class Nearest:
    """Messages of the last seconds by their stamps."""

    def __init__(self, count: int) -> None:
        """Args: count: how many are kept."""
        self._count = count
        self._kept: OrderedDict[int, Any] = OrderedDict()

    def add(self, stamp_ns: int, value: Any) -> None:
        """Keep a value."""
        self._kept[stamp_ns] = value
        if len(self._kept) > self._count:
            self._kept.popitem(last=False)

    def at(self, stamp_ns: int, slop_ns: int = 0) -> Any:
        """The value nearest to a stamp, None if none is within `slop_ns`."""
        if stamp_ns in self._kept:
            return self._kept[stamp_ns]
        best = min(self._kept, key=lambda s: abs(s - stamp_ns), default=None)
        return self._kept[best] if best is not None and abs(best - stamp_ns) <= slop_ns else None


class ModelCloud:
    """Draws the model of a task's cell where the camera was when its state was updated."""

    def __init__(self, task: str, cell: str) -> None:
        """Nothing is built before the first cloud is asked for."""
        self._task, self._cell = task, cell
        self._made: Model | None = None

    def points(
        self, state: Any, tool: np.ndarray, camera_arm: np.ndarray, camera_in_flange: Pose
    ) -> np.ndarray:
        """See `depth_points`.

        Args:
            state: samrl_msgs/ModelState.
            tool: joint positions of the tool arm at the state's stamp (J,) [rad].
            camera_arm: of the camera arm (J,) [rad].
            camera_in_flange: hand-eye.
        """
        if self._made is None:
            self._made = Model(task_named(self._task), cell_named(self._cell))
        model, estimate = self._made, from_state(state)
        camera = camera_of(model.cell, camera_arm, camera_in_flange)
        with torch.no_grad():
            drawn = model.render(
                torch.as_tensor(estimate.values), torch.as_tensor(estimate.colors), camera, tool
            )
        pixels = np.clip(np.round(drawn.color.numpy() * 255.0), 0, 255).astype(np.uint8)
        return depth_points(drawn.depth.numpy(), pixels, model.cell.intrinsics)


def camera_of(cell: CellSpec, joints: np.ndarray, camera_in_flange: Pose) -> Camera:
    """The cell's camera at joint positions of its arm (J,) [rad]."""
    flange = ArmModel(cell.camera_arm, cell.camera_base_in_world, None).flange_in_world(joints)
    return Camera(cell.intrinsics, flange @ camera_in_flange)


def positions_of(message: Any, names: tuple[str, ...]) -> np.ndarray:
    """Joint positions (J,) [rad] of a sensor_msgs/JointState, in the order of `names`."""
    return from_message.arm_reading(message, names).position
