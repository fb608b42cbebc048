"""How an edge feels for a plate of unknown height: on springs, without a simulator, and in the world."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.control.tip_sense import TipReading
from samrl_core.cell.control.touch_stop import TOUCH_DOWN
from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.policy.contact.surface_touch import SurfaceTouch, felt_surface
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL = cell_named()
STIFFNESS = 1700.0  # of the arm, upwards, where it may slide [N/m]
PRESSED = 0.0012  # of the commanded tip, where its motion ends by a touch [m]
START = np.array([0.385, 0.0, 0.020])


def task() -> SpatulaFlipping:
    found = felt_surface(task_named("spatula_flipping_hard"))
    assert found is not None
    return found


def values_of(camera_z: float = 0.0) -> np.ndarray:
    values = np.array([p.nominal for p in task().parameters()])
    values[8] = camera_z
    return values


class SpringPlate:
    """A tip on a spring over a plate, and readings that scatter by half a newton."""

    def __init__(self, height: float, rim_x: float = math.inf) -> None:
        self._commanded, self._height, self._rim_x = START.copy(), height, rim_x
        self._rng, self.largest, self.images = np.random.default_rng(3), 0.0, 0

    def move(self, displacement: np.ndarray) -> None:
        self._commanded = self._commanded + displacement

    def touch_down(self, displacement: np.ndarray) -> None:
        """A guarded motion: it ends `PRESSED` below the surface, or below where it is pressed by now."""
        surface = self._height + task().edge_height
        lowest = min(surface, float(self._commanded[2])) - PRESSED
        self._commanded = self._commanded + displacement
        self._commanded[2] = max(self._commanded[2], lowest)

    def read(self, _arm: Any) -> TipReading:
        tip = self._commanded.copy()
        tip[2] = max(tip[2], self._height + task().edge_height)
        push = STIFFNESS * (self._commanded[2] - tip[2]) - (6.0 if tip[0] > self._rim_x else 0.0)
        self.largest = max(self.largest, -push)
        return TipReading(
            tip, np.array([0.0, 0.0, -2.0 + push + 0.5 * self._rng.standard_normal()]), np.eye(3) / STIFFNESS
        )

    def observe(self) -> Any:
        self.images += 1
        return SimpleNamespace(tool_arm=None, stamp_ns=self.images)


def feel(plate: SpringPlate, values: np.ndarray) -> tuple[SurfaceTouch, int]:
    """The sense after its moves, and how many there were."""
    touch = SurfaceTouch(task(), CELL)
    touch._sense = plate  # ty: ignore[invalid-assignment]
    for count in range(40):
        touch.see(plate.observe(), values)
        found = touch.move(values, plate.read(None).tip)
        if found is None:
            return touch, count
        assert np.linalg.norm(found.displacement) < task().free_step + 1e-9
        (plate.touch_down if found.name == TOUCH_DOWN else plate.move)(found.displacement)
    raise AssertionError("it never ends")


# The last: a guarded motion comes to its end just above the surface, and the next one begins there.
@pytest.mark.parametrize("height", [-0.005, -0.002, 0.0, 0.003, 0.009, 0.012, 0.00016])
def test_a_plate_is_felt_gently_to_a_fraction_of_a_millimetre(height: float) -> None:
    plate = SpringPlate(height)
    touch, actions = feel(plate, values_of())
    assert touch.known and touch.height == pytest.approx(height, abs=2e-4)
    assert actions <= 9 and plate.largest < 6.0
    again = SurfaceTouch(task(), CELL)
    assert not again.known and again.height == 0.0


def test_images_from_elsewhere_are_no_touch() -> None:
    """Of a tool that rests in free air, over and over."""
    touch, plate = SurfaceTouch(task(), CELL), SpringPlate(0.0)
    touch._sense = plate  # ty: ignore[invalid-assignment]
    for _ in range(200):
        touch.see(plate.observe(), values_of())
    assert not touch.known


def test_where_nothing_is_touched_it_is_taken_to_be_as_drawn() -> None:
    touch, _ = feel(SpringPlate(-0.050), values_of())
    assert not touch.known and touch.height == 0.0


def test_what_pushes_under_the_pancake_is_no_plate() -> None:
    touch, plate, values = SurfaceTouch(task(), CELL), SpringPlate(-0.050, rim_x=0.440), values_of()
    touch._sense = plate  # ty: ignore[invalid-assignment]
    for _ in range(8):
        touch.see(plate.observe(), values)
        plate.move(np.array([0.010, 0.0, 0.0]))
    for _ in range(4):
        touch.see(plate.observe(), values)
        plate.move(np.array([0.0, 0.0, -0.005]))
    assert plate.largest > 5.0 and not touch.known


def test_only_a_plate_of_unknown_height_is_felt_for() -> None:
    assert [name for name, one in TASKS.items() if felt_surface(one)] == []


# Plates 7.5, 9.1 and 5.5 mm beside the drawn height: the last as felt by the second of two touches.
@pytest.mark.parametrize("name", ["typical:1", "typical:3", "careless:1", "careless:10", "careless:41"])
def test_in_a_cell_the_edge_finds_the_plate_and_bends_nothing(name: str) -> None:
    """By truth: where the plate is by the encoders, to 0.5 mm, with less force than bends the blade."""
    instance = instance_named(name, CELL)
    world = PyBulletWorld(task(), CELL, instance=instance)
    plant, touch = WorldPlant(world, task(), CELL, rest_s=0.1), SurfaceTouch(task(), CELL)
    plant.begin(7)
    values = values_of()
    for _ in range(20):
        touch.see(plant.observe(), values)
        found = touch.move(values, plant.tip())
        if found is None:
            break
        (plant.touch_down if found.name == TOUCH_DOWN else plant.displace_tool)(found.displacement)
    truth = world.truth()
    expected = instance.parts.surface + plant.tip()[2] - truth.tip_position[2]
    world.close()
    assert touch.known and abs(instance.parts.surface) > 0.002
    assert touch.height == pytest.approx(expected, abs=5e-4)
    assert truth.peak_contact_force < 0.75 * task().force_limit
