"""Zeros of encoders that were diagnosed: off readings, onto commands, and the world stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.instance.cell_instance import CellInstance, instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.corrected_world import CorrectedWorld, corrected_world
from samrl_core.cell.world.mock_world import MockWorld
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError, SamrlError
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL, TASK = cell_named(), task_named("peg_insertion")
ZERO = 0.02  # [rad] of the tool arm's second joint: 10 to 15 mm at the tip


def harmed() -> CellInstance:
    """The nominal cell, but for one encoder."""
    nominal = instance_named("nominal", CELL)
    zeros = np.zeros(len(CELL.tool_arm.joint_names))
    zeros[1] = ZERO
    calibration = replace(nominal.calibration, tool_arm_zeros=zeros)
    return replace(nominal, name=replace(nominal.name, level="typical"), calibration=calibration)


FOUND = CellCorrection(encoder_zeros={"tool_arm": {CELL.tool_arm.joint_names[1]: ZERO}})


@pytest.mark.parametrize(("correction", "off"), [(NO_CORRECTION, True), (FOUND, False)])
def test_a_corrected_arm_is_where_it_says_also_after_a_motion(correction: CellCorrection, off: bool) -> None:
    world = PyBulletWorld(TASK, CELL, instance=harmed())
    try:
        plant = WorldPlant(world, TASK, CELL, correction=correction)
        plant.begin(0)
        before, said = world.truth().tip_position, plant.tip()
        assert (np.linalg.norm(said - before) > 5e-3) == off
        for _ in range(3):
            plant.displace_tool(np.array([0.0, 0.01, 0.0]))
        plant.observe()
        after = world.truth().tip_position
        assert (np.linalg.norm(plant.tip() - after) > 5e-3) == off
        np.testing.assert_allclose(after[1] - before[1], 0.03, atol=1.5e-3)
    finally:
        world.close()


def test_the_other_arm_stays_and_what_is_read_back_is_what_was_commanded() -> None:
    raw = MockWorld(TASK, CELL)
    world = CorrectedWorld(raw, FOUND, CELL)
    raw.reset(0)
    there, here = raw.read_arm("tool_arm").position, world.read_arm("tool_arm").position
    np.testing.assert_allclose((there - here)[[0, 1, 2]], [0.0, ZERO, 0.0])
    np.testing.assert_array_equal(raw.read_arm("camera_arm").position, world.read_arm("camera_arm").position)
    with pytest.raises(SamrlError, match="no truth"):
        world.truth()
    assert corrected_world(raw, NO_CORRECTION, CELL) is raw


def test_a_correction_of_another_cell_is_refused() -> None:
    foreign = CellCorrection(encoder_zeros={"tool_arm": {"elbow": 0.01}})
    with pytest.raises(InputError, match="elbow.*use the correction of this cell"):
        corrected_world(MockWorld(TASK, CELL), foreign, CELL)
