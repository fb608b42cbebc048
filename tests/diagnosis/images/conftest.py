"""Recordings of the cell's camera in PyBullet, made once: another renderer than the model's."""

from __future__ import annotations

import pytest

from samrl_core.cell.excitation.camera_views import camera_motion
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.world import make_world
from samrl_core.cell.world.camera_recording import record_camera

SECONDS = 6.0


@pytest.fixture(scope="session")
def recordings() -> list[ImageRecording]:
    """Two motions in the nominal cell, the block of seed 5."""
    task, cell = task_named("peg_insertion"), cell_named(DEFAULT_CELL)
    tool = task.scene(cell).tool
    loads = nominal_payloads(cell, tool)
    made = []
    for name, seed in (("A", 100), ("C", 101)):
        world = make_world("pybullet", task, cell)
        try:
            world.reset(5)
            motion = camera_motion(task, cell, loads, seed, SECONDS)
            made.append(record_camera(world, task.name, cell, motion, name))
        finally:
            world.close()
    return made
