"""How far hole and tip are believed apart, against truth, with and without the tip's offset.

`python -m tests.model.real2sim.tip_offset_accuracy nominal typical:20` prints a line per cell after
eight images from the view that an episode starts with, on the way to the hole, and root mean squares.
"""

from __future__ import annotations

import sys

import numpy as np
import torch

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Real2Sim, initial_estimate
from samrl_core.model.real2sim.tip_offset import TipOffsetFit
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL, IMAGES, SEED = cell_named(), 8, 5


def measure(instance: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Error (2,) of the hole's place from the tip without and with the offset, and its deviation (2,) [m]."""
    task = task_named("peg_insertion_hard")
    assert isinstance(task, PegInsertion)
    model = Model(task, CELL)
    real2sim, fit = Real2Sim(model), TipOffsetFit(task.scene(CELL).tool, CELL)
    world = PyBulletWorld(task, CELL, instance=instance_named(instance, CELL))
    plant = WorldPlant(world, task, CELL)
    plant.begin(SEED)
    estimate, belief, error = initial_estimate(model), fit.begin(), np.zeros(2)
    for _ in range(IMAGES):
        observation, tip, truth = plant.observe(), plant.tip(), world.truth()
        estimate = real2sim.update(estimate, observation)
        belief = fit.update(belief, observation, tip)
        error = (estimate.values[:2] - tip[:2]) - (true_values(task, truth)[:2] - truth.tip_position[:2])
        hover = np.array([*estimate.values[:2], task.height + 0.02])
        way = hover - belief.offset - tip
        plant.displace_tool(way * min(1.0, 0.01 / max(float(np.linalg.norm(way)), 1e-9)))
    world.close()
    return error, error - belief.offset[:2], np.sqrt(np.diag(belief.covariance))[:2]


if __name__ == "__main__":
    torch.set_num_threads(1)
    np.set_printoptions(precision=2, suppress=True)
    found = []
    for name in sys.argv[1:]:
        found.append(measure(name))
        print(name, *(1e3 * part for part in found[-1]), "mm", flush=True)
    print(
        "root mean square",
        *(1e3 * np.sqrt(np.mean(np.square(one), axis=0)) for one in zip(*found, strict=True)),
    )
