"""Servo machines that stick as their description states: held at rest, opposed in motion, logged raggedly."""

import numpy as np
import pytest

from samrl_core.blind_test.servo_worlds.plan import ServoItem, ServoSettings, plan_servos
from samrl_core.blind_test.servo_worlds.stiction import hold_or_slip, ragged, rounding_encoder
from samrl_core.blind_test.servo_worlds.world import make_servo_world


def test_friction_holds_up_to_its_level_and_slips_beyond():
    """Of a mass of 2 kg in a step of 1 ms: 3 N hold what 2.5 N push, and take 3 N off 4 N."""
    dt, mass = 1e-3, 2.0
    for push, left in ((2.5, 0.0), (-2.5, 0.0), (4.0, 1.0), (-4.0, -1.0)):
        (held,) = hold_or_slip(np.array([push * dt / mass]), np.array([[dt / mass]]), [3.0], [0.0])
        assert push - held == pytest.approx(left)


def test_friction_of_coupled_axes_agrees_in_all_of_them():
    """Each axis either rests, held by less than its level, or moves against all of it."""
    rng, levels = np.random.default_rng(3), [0.4, 0.2, 0.3]
    half = rng.normal(size=(3, 3))
    yielding = 1e-2 * (half @ half.T + 0.1 * np.eye(3))
    for _ in range(20):
        free = yielding @ rng.normal(size=3) * 0.5
        held = np.array(hold_or_slip(free, yielding, levels, [0.0] * 3))
        moved = free - yielding @ held
        rests = np.abs(moved) < 1e-9
        assert np.all(np.abs(held) <= levels)
        np.testing.assert_allclose(held[~rests], (levels * np.sign(moved))[~rests], atol=1e-6)


def test_an_encoder_rounds_and_its_speed_lags():
    """Positions are whole counts; of a steady turn the filtered difference finds the speed."""
    read = rounding_encoder([1000.0], 0.001, np.random.default_rng(0))
    speeds = []
    for k in range(400):
        (q,), (v,) = read(k * 1e-3, [2.0 * k * 1e-3], [0.0])
        assert q * 1000.0 == pytest.approx(round(q * 1000.0))
        speeds.append(v)
    assert speeds[1] < 1.9
    assert np.mean(speeds[200:]) == pytest.approx(2.0, rel=1e-2)


def test_a_ragged_log_misses_rows_and_is_late_by_less_than_a_row():
    """Its stamps increase, and those that are there stand near their own row's time."""
    table = {"time": 0.004 * np.arange(3000), "pos": np.arange(3000.0)}
    made = [ragged(table, np.random.default_rng(seed)) for seed in range(4)]
    assert min(len(m["time"]) for m in made) < 3000
    for m in made:
        assert np.all(np.diff(m["time"]) > 0)
        assert np.abs(m["time"] - 0.004 * m["pos"]).max() < 0.1 * 0.004 + 1e-6


def test_a_machine_that_sticks_states_it_and_rests():
    """Its URDF states friction near the label's, and between moves the encoder keeps its count."""
    (item,) = plan_servos(ServoSettings(seed=4, single=0, none=1, outside=0, double=0, stated_friction=True))
    item = ServoItem("s0", "none", "slide", "position_servo", (), item.seed, 4.0, sticks=True)
    world = make_servo_world(item)
    assert '<dynamics friction="' in world.urdf
    (stated,) = (float(part.split('"')[0]) for part in world.urdf.split('friction="')[1:])
    assert world.label["background"]["coulomb_nm"][0] == pytest.approx(stated, rel=0.9)
    table = world.tables["C"]
    position = next(v for k, v in table.items() if k.startswith("pos"))
    assert np.mean(np.diff(position) == 0.0) > 0.05
