"""The pushes of the simulated cell: what the driver records, and what is found from it."""

from __future__ import annotations

import json
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE
from samrl_core.cell.world.pose_sensor import PoseSensor
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError, LimitError
from samrl_core.model.physical_parameters.identify import IdentifySettings, identify
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord
from samrl_core.studies.model import mass_from_pushes
from samrl_core.studies.model.mass_from_pushes import (
    FRICTION_RANGE,
    RANGES,
    SCHEMA,
    PushCase,
    main,
    pushing_scene,
    sample_case,
)
from samrl_core.studies.model.push_driver import PushDriver, PushSettings

CELL = cell_named()
MASS, FRICTION = 0.7, 0.35
TASK = pushing_scene(MASS, FRICTION)
DISC = Disc(TASK.pancake_radius, TASK.pancake_thickness, TASK.pancake_radius - TASK.pancake_rounding)
NOISE = 0.001


@pytest.fixture
def world() -> Iterator[PyBulletWorld]:
    made = PyBulletWorld(TASK, CELL)
    yield made
    made.close()


def pushed(world: PyBulletWorld, settings: PushSettings, force: float = 8.0) -> PushRecord:
    sensor = PoseSensor(world, PANCAKE, NOISE, np.random.default_rng(5))
    return PushDriver(CELL, TASK.scene(CELL).tool, settings).push(world, force, sensor)


def test_the_drive_explains_the_free_tip_and_not_the_touching_one(world: PyBulletWorld) -> None:
    """Integrated twice, the recorded drive is the tip's way, until the blade is at the pancake."""
    push = pushed(world, PushSettings(push_s=0.1, total_s=0.11))
    speed = np.concatenate([[0.0], np.cumsum(push.free_acceleration) * push.period_s])
    way = push.tip[0] + np.concatenate([[0.0], np.cumsum(speed[1:]) * push.period_s])
    error = np.abs(way[:-1] - push.tip)
    free = push.tip < push.tip[0] + 0.003  # the gap is 4 mm at least
    assert free.sum() > 20 and error[free].max() < 1e-4
    assert error[-1] > 2e-3
    assert push.effective_mass.min() > 0.3 and push.effective_mass.max() < 0.8


def test_a_push_in_a_new_world_is_the_same(world: PyBulletWorld) -> None:
    """Bit for bit. In one world it is not so after contact: Bullet keeps some of that over a reset."""
    settings = PushSettings(push_s=0.07, total_s=0.08)
    other = PyBulletWorld(TASK, CELL)
    first, again = pushed(world, settings), pushed(other, settings)
    assert other.truth().first_contact_ns > 0
    other.close()
    np.testing.assert_array_equal(first.tip, again.tip)
    np.testing.assert_array_equal(first.seen, again.seen)


@pytest.mark.thorough
def test_one_push_weighs_the_pancake(world: PyBulletWorld) -> None:
    """From 50 % off to 10 %, with an interval that holds the truth."""
    found = identify([pushed(world, PushSettings(total_s=0.35))], DISC, 0.5 * MASS)
    mass = found.parameter("mass")
    assert found.explained
    assert mass.value == pytest.approx(MASS, rel=0.10)
    assert mass.lower < MASS < mass.upper


def test_a_push_beyond_the_line_stops(world: PyBulletWorld) -> None:
    with pytest.raises(LimitError, match="beyond its line"):
        pushed(world, PushSettings(push_s=0.2, total_s=0.3, reach=0.02))


def test_impossible_pushes_are_refused(world: PyBulletWorld) -> None:
    with pytest.raises(InputError, match="force"):
        pushed(world, PushSettings(), force=-1.0)
    with pytest.raises(InputError, match="total_s"):
        PushSettings(push_s=0.3, total_s=0.2)
    with pytest.raises(InputError, match="brake_force"):
        PushSettings(brake_force=0.0)


def test_sightings_have_the_noise_that_is_stated(world: PyBulletWorld) -> None:
    sensor = PoseSensor(world, PANCAKE, NOISE, np.random.default_rng(0))
    seen = np.array([sensor.read() for _ in range(300)])
    assert seen.std(axis=0) == pytest.approx(NOISE, rel=0.15)
    np.testing.assert_allclose(seen.mean(axis=0), world.truth().body_position[PANCAKE], atol=3e-4)
    with pytest.raises(InputError, match="waffle"):
        PoseSensor(world, "waffle", NOISE, np.random.default_rng(0))
    with pytest.raises(InputError, match="noise"):
        PoseSensor(world, PANCAKE, -1.0, np.random.default_rng(0))


def test_cases_are_drawn_within_their_ranges_and_repeat() -> None:
    for group, (low, high) in RANGES.items():
        cases = [sample_case(group, i, 0) for i in range(20)]
        assert cases == [sample_case(group, i, 0) for i in range(20)]
        assert all(low <= c.mass <= high for c in cases)
        assert all(FRICTION_RANGE[0] <= c.friction <= FRICTION_RANGE[1] for c in cases)
        assert {round(c.guess / c.mass, 9) for c in cases} == {0.5, 1.5}
    assert sample_case("heavy", 0, 0) != sample_case("heavy", 0, 1)


def test_no_case_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--cases"):
        main(["--cases", "0", "--light", "0", "--out", str(tmp_path)])


class _AskedAgainError(Exception):
    pass


def test_a_case_whose_file_could_not_be_written_is_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No room in the middle of a case's file: the next run finds nothing, instead of half of it."""
    made: list[str] = []

    def run(case: PushCase, seed: int, settings: IdentifySettings) -> dict[str, Any]:
        if made:
            raise _AskedAgainError
        made.append(case.name)
        return {"schema": SCHEMA, "seed": seed, "numbers": [0.0] * 1000}

    monkeypatch.setattr(mass_from_pushes, "run_case", run)
    arguments = ["--cases", "1", "--light", "0", "--out", str(tmp_path)]
    most, limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, limit))  # bytes of any file
    try:
        with pytest.raises(InputError, match="File too large"):
            main(arguments)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, limit))
    assert made == ["heavy_00"] and not list((tmp_path / "cases").iterdir())
    with pytest.raises(_AskedAgainError):
        main(arguments)


@pytest.mark.slow
def test_two_pushes_of_a_heavy_and_a_light_pancake(tmp_path: Path) -> None:
    """One case of each; a second run reads the first one's results."""
    arguments = ["--cases", "1", "--light", "1", "--out", str(tmp_path)]
    assert main(arguments) == 0
    record = json.loads((tmp_path / "mass_from_pushes.json").read_text())
    heavy, light = (case["fits"] for case in record["cases"])
    assert abs(heavy["two_pushes"]["error"]) < 0.05
    assert light["one_push"]["half_width"] > 1.5 * heavy["one_push"]["half_width"]
    assert (tmp_path / "mass_from_pushes.png").stat().st_size > 10_000
    marked = tmp_path / "cases" / "heavy_00.json"
    before = marked.stat().st_mtime_ns
    assert main(arguments) == 0
    assert marked.stat().st_mtime_ns == before


def test_settings_state_the_noise_that_the_sensor_has() -> None:
    assert IdentifySettings().seen_noise == NOISE
