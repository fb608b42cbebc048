"""How far beside its hole a peg that comes down 1 mm per action still goes in, and how hard it presses.

`python -m tests.policy.contact.forgiven_offsets 0 1 2` prints, for development cells `typical:0` to
`typical:2` together, a line for each distance. `Forgiveness` rests on it. Evaluation's truth places the peg.
"""

from __future__ import annotations

import sys

import numpy as np

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL, TASK, SEED = cell_named(), task_named("peg_insertion_hard"), 5
DISTANCES, DIRECTIONS = (0.0005, 0.0010, 0.0013, 0.0016, 0.0020), 8  # [m]
PRESSES, STEP, ENTERED = 8, 0.001, 0.0025  # actions down, length of each [m], below the mouth [m]


def press(world: PyBulletWorld, plant: WorldPlant, beside: np.ndarray) -> tuple[bool, float]:
    """Whether a peg that is lowered `beside` (2,) [m] the hole goes in, and the peak force [N]."""
    assert isinstance(TASK, PegInsertion)
    plant.begin(SEED)
    place, top = true_values(TASK, world.truth())[:2] + beside, TASK.height

    def go(height: float, longest: float, times: int) -> None:
        for _ in range(times):
            way = np.array([*place, top + height]) - world.truth().tip_position
            plant.displace_tool(way * min(1.0, longest / max(float(np.linalg.norm(way)), 1e-9)))
            rest(world)

    go(0.015, 0.010, 12)
    go(0.0015, 0.003, 7)
    for _ in range(PRESSES):
        plant.displace_tool(np.array([0.0, 0.0, -STEP]))
        rest(world)
    truth = world.truth()
    return bool(truth.tip_position[2] < TASK.height - ENTERED), truth.peak_contact_force


def rest(world: PyBulletWorld) -> None:
    """As before an image."""
    for _ in range(300):
        world.advance()


if __name__ == "__main__":
    found: dict[float, list[tuple[bool, float]]] = {d: [] for d in DISTANCES}
    for number in sys.argv[1:]:
        world = PyBulletWorld(TASK, CELL, instance=instance_named(f"typical:{number}", CELL))
        plant = WorldPlant(world, TASK, CELL)
        for distance in DISTANCES:
            for angle in 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
                beside = distance * np.array([np.cos(angle), np.sin(angle)])
                found[distance].append(press(world, plant, beside))
        world.close()
    for distance, presses in found.items():
        went_in, force = [i for i, _ in presses], [f for i, f in presses if i]
        middle, most = (np.median(force), max(force)) if force else (np.nan, np.nan)
        print(
            f"{1e3 * distance:.1f} mm: {sum(went_in)} of {len(went_in)} in, peak of these {middle:.0f} N in "
            f"the median, {most:.0f} N at most"
        )
