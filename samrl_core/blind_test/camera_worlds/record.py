"""Makes a world's recordings and keeps them in a folder: two motions of both arms, images and joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from samrl_core.blind_test.camera_worlds.plan import NOTHING, CameraWorld, instance_of
from samrl_core.blind_test.camera_worlds.tiles import tile_changes
from samrl_core.cell.excitation.camera_views import CameraMotion, camera_motion
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.world import make_world
from samrl_core.cell.world.camera_recording import record_camera
from samrl_core.common.array_file import write_arrays

TASK = "peg_insertion"
ARRAYS = (
    "time", "color", "depth", "mask", "camera_joint_time", "camera_joints", "tool_joint_time", "tool_joints",
)  # fmt: skip
MOTIONS = (("A", 100), ("C", 101))  # name and seed: fitted, held out
SECONDS = 6.0


class CameraRecorder:
    """Records worlds with motions that are planned once."""

    def __init__(self, duration_s: float = SECONDS) -> None:
        self.task: Task = task_named(TASK)
        self.cell: CellSpec = cell_named(DEFAULT_CELL)
        tool = self.task.scene(self.cell).tool
        loads = nominal_payloads(self.cell, tool)
        self._motions: list[tuple[str, CameraMotion]] = [
            (name, camera_motion(self.task, self.cell, loads, seed, duration_s)) for name, seed in MOTIONS
        ]

    def recordings(self, world: CameraWorld, folder: Path) -> list[ImageRecording]:
        """Of a world; read from `folder` where they are already."""
        return [self._one(world, name, motion, folder) for name, motion in self._motions]

    def recorded(self, world: CameraWorld) -> list[ImageRecording]:
        """Of a world, made anew."""
        return [self._made(world, name, motion) for name, motion in self._motions]

    def changed_tiles(self, world: CameraWorld, caused: ImageRecording) -> dict[str, np.ndarray]:
        """What the cause changes in the first recording, tile by tile; nothing where there is none."""
        if world.cause == NOTHING:
            return {}
        name, motion = self._motions[0]
        return tile_changes(caused, self._made(replace(world, cause=NOTHING), name, motion))

    def _made(self, world: CameraWorld, name: str, motion: CameraMotion) -> ImageRecording:
        instance, _ = instance_of(world, self.cell)
        simulated = make_world("pybullet", self.task, self.cell, instance=instance)
        try:
            simulated.reset(world.seed)
            return record_camera(simulated, TASK, self.cell, motion, name)
        finally:
            simulated.close()

    def _one(self, world: CameraWorld, name: str, motion: CameraMotion, folder: Path) -> ImageRecording:
        path = folder / f"{world.name}_{name}.npz"
        cell = self.cell
        if not path.is_file():
            made = self._made(world, name, motion)
            write_arrays(path, {key: getattr(made, key) for key in ARRAYS})
        with np.load(path) as kept:
            arrays = {key: kept[key] for key in ARRAYS}
        return ImageRecording(
            name, str(path), "", TASK, cell.name, cell.intrinsics, cell.camera_in_flange,
            cell.camera_base_in_world, cell.tool_base_in_world, **arrays,
        )  # fmt: skip
