"""The world that differs: its arm gives way and loses small displacements, its images look otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS, WorldSettings
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError
from samrl_core.studies.episodes.differing_world import differing_cell, differing_world, trained_offset
from samrl_core.studies.episodes.world_plant import WorldPlant

TASK, CELL = task_named("peg_insertion"), cell_named()


def moved(world: SimulatedWorld) -> tuple[np.ndarray, list[float], Observation]:
    """How far the tip goes by itself (3,), in y when sent 1 mm to and fro [m], and an image."""
    plant = WorldPlant(world, TASK, CELL)
    plant.begin(3)
    start = plant.tip()
    image = plant.observe()
    by_itself = plant.tip() - start
    ways = []
    for way in (1e-3, 1e-3, -1e-3, -1e-3):
        before = plant.tip()
        plant.displace_tool(np.array([0.0, way, 0.0]))
        plant.observe()
        ways.append(float((plant.tip() - before)[1] / way))
    world.close()
    return by_itself, ways, image


def test_what_differs() -> None:
    """The nominal world does as it is told; this one gives way, and a turn back is mostly lost."""
    still, exact, clean = moved(PyBulletWorld(TASK, CELL))
    sunk, lost, image = moved(differing_world(TASK, CELL))
    assert np.abs(still).max() < 1e-4
    assert -10e-3 < sunk[2] < -1e-3
    np.testing.assert_allclose(exact, 1.0, atol=0.1)
    assert lost[2] < 0.6  # the turn back
    assert all(-0.2 < way < 1.2 for way in lost)

    height = [o.camera.unproject(o.frame.depth)[..., 2] for o in (clean, image)]
    table = [h[(o.frame.mask == 0) & np.isfinite(h)] for h, o in zip(height, (clean, image), strict=True)]
    spread = [float(np.std(t[np.abs(t) < 0.02])) for t in table]
    assert spread[1] > 2.0 * spread[0] > 0.0
    both = (clean.frame.mask == 1) & (image.frame.mask == 1)
    assert both.sum() > 500
    brighter = image.frame.color[both].astype(float).mean() - clean.frame.color[both].astype(float).mean()
    assert abs(brighter) > 5.0


def test_what_is_known_of_the_cell_stays_nominal() -> None:
    """Only the controller of the tool arm is another, and `cell` itself is left alone."""
    found = differing_cell(CELL)
    assert (found.tool_arm.controller.stiffness < CELL.tool_arm.controller.stiffness).all()
    same = replace(found, tool_arm=replace(found.tool_arm, controller=CELL.tool_arm.controller))
    others = [k for k in vars(CELL) if k not in ("tool_arm", "camera_base_in_world")]
    assert all(getattr(same, k) is getattr(CELL, k) for k in others)
    assert np.array_equal(found.camera_base_in_world.position, CELL.camera_base_in_world.position)


def test_the_calibration_can_be_off() -> None:
    """Then the camera arm really stands elsewhere, and the camera with it; nothing else has moved."""
    offset = (0.003, -0.002, 0.004)
    found = differing_cell(CELL, offset)
    np.testing.assert_allclose(
        found.camera_base_in_world.position - CELL.camera_base_in_world.position, offset, atol=1e-12
    )
    assert np.array_equal(found.camera_base_in_world.rotation, CELL.camera_base_in_world.rotation)
    assert found.tool_base_in_world is CELL.tool_base_in_world
    assert trained_offset({"offset_x": 0.001, "offset_y": 0.002, "offset_z": 0.003}) == (0.001, 0.002, 0.003)
    assert trained_offset({"success": 1.0}) == (0.0, 0.0, 0.0)


def test_friction_is_a_share() -> None:
    with pytest.raises(InputError, match="joint_friction is 1.0"):
        WorldSettings(joint_friction=1.0)


def test_a_calibration_that_is_off_shows_what_is_elsewhere() -> None:
    """The camera's base stands off; who believes the calibration sees the hole off the other way."""
    offset = np.array([0.004, -0.003, 0.0])
    real = differing_cell(CELL, tuple(offset))
    middles = []
    for cell in (CELL, real):
        world = PyBulletWorld(TASK, cell, NOISELESS)
        plant = WorldPlant(world, TASK, CELL)
        plant.begin(3)
        seen = plant.observe()
        points = seen.camera.unproject(seen.frame.depth)[seen.frame.mask == 1]
        middles.append(np.median(points, axis=0))
        world.close()
    np.testing.assert_allclose((middles[1] - middles[0])[:2], -offset[:2], atol=1.5e-3)
