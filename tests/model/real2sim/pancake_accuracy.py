"""Where the hard pancake is and how large by images of the view that an episode starts with, against truth.

`python -m tests.model.real2sim.pancake_accuracy 4 typical:0/0 typical:1/5 ...` prints a line per image: the
first number is how many images each cell takes, behind a cell's name stands the episode's place
"""

from __future__ import annotations

import sys

import numpy as np

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.streams import DEVELOPMENT, seed_of
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Real2Sim, initial_estimate
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.studies.episodes.world_plant import WorldPlant

# The drawn radius is 50 mm.
UNIT = np.array([1e3, 1e3, 1e3, np.degrees(1.0), np.degrees(1.0), 50.0])


def main() -> None:
    """A line per image, then root mean squares after each image."""
    cell, task = cell_named(), task_named("spatula_flipping_hard")
    model = Model(task, cell, ModelSettings(threads=1))
    real2sim, rows, images = Real2Sim(model), [], int(sys.argv[1])
    for instance, place in (one.split("/") for one in sys.argv[2:]):
        drawn = instance_named(instance, cell)
        world = PyBulletWorld(task, cell, instance=drawn)
        made = task.as_made(drawn.parts)
        assert isinstance(made, SpatulaFlipping) and isinstance(task, SpatulaFlipping)
        plant, estimate = WorldPlant(world, task, cell), initial_estimate(model)
        plant.begin(seed_of(int(place), "episode", DEVELOPMENT, task.name))
        truth = np.array(
            [*world.truth().body_position[PANCAKE], 0.0, 0.0, made.pancake_radius / task.pancake_radius]
        )
        for _ in range(images):
            estimate = real2sim.update(estimate, plant.observe())
            error, stated = estimate.values[:6] - truth, np.sqrt(np.diag(estimate.covariance))[:6]
            rows.append([error, stated])
            wrong, known = (np.round(each * UNIT, 2) for each in (error, stated))
            print(
                f"{instance} radius {1e3 * made.pancake_radius:.1f} mm, {estimate.why_stopped}: error of",
                f"x, y, z {wrong[:3]} mm, tilts {wrong[3:5]} deg, radius {wrong[5]} mm; stated {known}",
                flush=True,
            )
        world.close()
    found = np.array(rows).reshape(-1, images, 2, 6) * UNIT
    print("root mean square of x, y, z [mm], tilts [deg], radius [mm], and what is stated")
    for k in range(images):
        error, stated = np.sqrt(np.mean(found[:, k] ** 2, axis=0))
        print(f"image {k + 1}: {np.round(error, 2)}, stated {np.round(stated, 2)}")


if __name__ == "__main__":
    main()
