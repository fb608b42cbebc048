"""How far the hard thread's end is from the needle's eye by images of one view, against truth.

`python -m tests.model.real2sim.needle_gap_accuracy nominal/3 typical:20/0 ...` prints a line per cell
"""

from __future__ import annotations

import sys

import numpy as np

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NEEDLE
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Real2Sim, initial_estimate
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.studies.episodes.world_plant import WorldPlant

IMAGES = 3


def main() -> None:
    """A line per cell, then root mean squares."""
    cell, task = cell_named(), task_named("needle_threading_hard")
    model = Model(task, cell, ModelSettings(threads=1))
    real2sim, rows = Real2Sim(model), []
    for instance, seed in (one.split("/") for one in sys.argv[1:]):
        world = PyBulletWorld(task, cell, instance=instance_named(instance, cell))
        plant, estimate = WorldPlant(world, task, cell), initial_estimate(model)
        plant.begin(int(seed))
        for _ in range(IMAGES):
            seen = plant.observe()
            estimate = real2sim.update(estimate, seen)
        tip = model.tip_in_base(seen.tool_arm.position).position
        truth = world.truth()
        error = task.aim(estimate.values, tip) - (truth.chain_points[-1] - truth.body_position[NEEDLE])[:2]
        world.close()
        steps = 1e-6 * np.eye(len(estimate.values))
        ends = [task.aim(estimate.values + h, tip) - task.aim(estimate.values - h, tip) for h in steps]
        jacobian = np.array(ends).T / 2e-6
        covariance = jacobian @ estimate.covariance @ jacobian.T
        across = seen.camera.camera_in_world.rotation[:2, 0]
        turn = np.array([across, [-across[1], across[0]]])
        stated = np.sqrt(np.diag(turn @ covariance @ turn.T))
        rows.append([*(turn @ error), *stated, float(error @ np.linalg.solve(covariance, error))])
        print(instance, seed, estimate.why_stopped, np.round(1e3 * np.array(rows[-1][:4]), 2), flush=True)
    found = np.array(rows)
    square = 1e3 * np.sqrt(np.mean(found[:, :4] ** 2, axis=0))
    print("root mean square [mm]: across, along; stated: across, along:", np.round(square, 2))
    print("mean squared error in stated deviations, 2 if honest:", round(float(found[:, 4].mean()), 2))


if __name__ == "__main__":
    main()
