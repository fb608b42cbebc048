"""A pancake that slides when its pan is shaken, in the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL = cell_named()


def flipping() -> SpatulaFlipping:
    found = task_named("spatula_flipping_hard")
    assert isinstance(found, SpatulaFlipping)
    return found


def places_after(instance: str, seed: int, steps: int = 8) -> np.ndarray:
    """Where the pancake lies (steps + 1, 3) before and after steps of the edge 4 mm upwards [m]."""
    drawn = instance_named(instance, CELL)
    world = PyBulletWorld(flipping(), CELL, NOISELESS, instance=drawn)
    plant = WorldPlant(world, flipping(), CELL, rest_s=0.0)
    plant.begin(seed)
    found = [world.truth().body_position[PANCAKE]]
    for _ in range(steps):
        plant.displace_tool(np.array([0.0, 0.0, 0.004]))
        found.append(world.truth().body_position[PANCAKE])
    world.close()
    return np.array(found)


@pytest.mark.parametrize("seed", [3, 4])
def test_it_slides_as_far_as_the_cell_has_it_once_the_edge_has_come_near(seed: int) -> None:
    instance = instance_named("typical:1", CELL)
    places = places_after("typical:1", seed)
    way = np.linalg.norm(places[:, :2] - places[0, :2], axis=1)
    assert 0.015 <= instance.parts.slide <= 0.030
    assert way[2] < 1e-4, "the edge was raised by 8 mm"
    assert way[-1] == pytest.approx(instance.parts.slide, rel=0.1)
    assert way[-1] == pytest.approx(way[-2], abs=1e-4), "it has come to rest"
    aside, along = np.abs(places[-1, :2] - places[0, :2])[::-1]
    assert aside > 2.0 * along
    assert abs(places[-1, 2] - places[0, 2]) < 1e-3


def test_nothing_slides_as_drawn() -> None:
    places = places_after("nominal", 3)
    np.testing.assert_allclose(places, places[:1].repeat(len(places), axis=0), atol=1e-4)


def test_episodes_of_a_cell_differ_in_side_and_moment_and_not_in_size() -> None:
    made = flipping().as_made(instance_named("typical:1", CELL).parts)
    slides = [made.sample_start(np.random.default_rng(k)).slides[0] for k in range(30)]
    ways = np.array([one.way for one in slides])
    sizes = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(sizes, sizes[0])
    assert 5 < (ways[:, 1] > 0.0).sum() < 25
    assert len({one.after for one in slides}) == len(slides)
    plain = replace(flipping(), shaken=False).as_made(instance_named("typical:1", CELL).parts)
    assert plain.sample_start(np.random.default_rng(0)).slides == ()


def test_it_slides_before_the_edge_can_have_come_to_it() -> None:
    """Nor into the lip or off its end; a careless one may just meet them."""
    task = flipping()
    start = task.center_x - task.start_behind
    for level, most in (("typical", 0.030), ("careless", 0.045)):
        made = [task.as_made(instance_named(f"{level}:{k}", CELL).parts) for k in range(40)]
        flips = [one for one in made if isinstance(one, SpatulaFlipping)]
        radius = max(one.pancake_radius for one in flips)
        assert all(0.5 * most <= one.slide <= most for one in flips)
        drawn = [one.sample_start(np.random.default_rng(k)).slides[0] for k, one in enumerate(flips)]
        along = max(abs(one.way[0]) / float(np.linalg.norm(one.way)) for one in drawn) * most
        (near, left, *_), (far, right, *_) = task.start_range
        assert start + max(one.after for one in drawn) < near - along - radius
        assert far + along + radius < task.lip_x + (level == "careless") * 0.01
        assert max(right, -left) + most + radius < 0.5 * task.lip_size[1] + (level == "careless") * 0.01
