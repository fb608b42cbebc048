"""Servo worlds repeat themselves, hold what was planned, and log what the described machine does."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.blind_test.servo_worlds.drives import choose_drive, rotors, scales_of
from samrl_core.blind_test.servo_worlds.effects import FAMILIES
from samrl_core.blind_test.servo_worlds.engine import nominal_machine, run_machine
from samrl_core.blind_test.servo_worlds.mechanisms import mechanisms
from samrl_core.blind_test.servo_worlds.motions import motion
from samrl_core.blind_test.servo_worlds.plan import KINDS, ServoEffect, ServoItem, ServoSettings, plan_servos
from samrl_core.blind_test.servo_worlds.unknown import UNKNOWN
from samrl_core.blind_test.servo_worlds.world import ServoWorld, make_servo_world
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import EFFECTS

ALL = {m.name: m for m in mechanisms(np.random.default_rng(3))}


def _item(family: str | None, drive: str = "position_servo", severity: float = 0.75) -> ServoItem:
    effects = () if family is None else (ServoEffect(family, "joint:shoulder", 0, "T0", severity),)
    return ServoItem("s000", "single", "two_link", drive, effects, 7, 1.2)


@cache
def _bare(drive: str) -> ServoWorld:
    return make_servo_world(_item(None, drive))


def test_a_plan_has_every_family_and_every_drive_and_follows_its_seed() -> None:
    plan = plan_servos(ServoSettings(seed=3))
    kinds = [item.set for item in plan]
    assert [kinds.count(k) for k in ("single", "none", "outside", "double")] == [24, 6, 6, 4]
    assert {i.effects[0].family for i in plan if i.set == "single"} == set(FAMILIES)
    assert {i.effects[0].family for i in plan if i.set == "outside"} == set(UNKNOWN)
    assert {i.drive for i in plan} == set(KINDS) and {i.mechanism for i in plan} <= set(ALL)
    assert plan == plan_servos(ServoSettings(seed=3)) != plan_servos(ServoSettings(seed=4))
    for seed in range(40):  # no pair of effects lacks a drive
        plan_servos(ServoSettings(seed=seed, double=12))
    with pytest.raises(InputError, match="not all zero"):
        ServoSettings(single=0, none=0, outside=0, double=0)


@pytest.mark.slow
def test_a_stand_in_repeats_itself() -> None:
    first, second = make_servo_world(_item("coulomb_friction")), make_servo_world(_item("coulomb_friction"))
    assert first.label == second.label and first.urdf == second.urdf and first.mapping == second.mapping
    for letter, table in first.tables.items():
        assert all(np.array_equal(table[c], second.tables[letter][c]) for c in table)
    other = make_servo_world(replace(_item("coulomb_friction"), seed=8))
    assert other.label["background"] != first.label["background"]


def test_a_dead_band_is_named_and_measured_as_the_effect_does() -> None:
    """No arm of the other forge has one: the two wings agree on it here."""
    (effect,) = (e for e in EFFECTS if e.family == "dead_band")
    made = make_servo_world(_item("dead_band")).label["effects"][0]["parameters"]
    units = {p.name: p.unit for p in effect.parameters}
    assert set(made) & set(units)
    assert all(units.get(name, quantity["unit"]) == quantity["unit"] for name, quantity in made.items())


@pytest.mark.parametrize("name", sorted({**FAMILIES, **UNKNOWN}))
def test_every_effect_changes_the_log(name: str) -> None:
    """Against the same machine without it, whose streams are the same."""
    drive = "velocity_drive" if name == "torque_saturation" else "position_servo"
    with_effect, without = make_servo_world(_item(name, drive)), _bare(drive)
    parameters = with_effect.label["effects"][0]["parameters"]
    assert parameters and all(p["unit"] for p in parameters.values())
    changed = 0.0
    for letter in "AB":
        table, bare = with_effect.tables[letter], without.tables[letter]
        for column in table:
            if column.startswith(("pos", "torque")):
                gap = np.sqrt(np.mean((table[column] - bare[column]) ** 2))
                changed = max(changed, float(gap / np.std(bare[column])))
    assert changed > 0.002


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"voltage_motor", "current_motor"}))
def test_a_described_drive_follows_its_command(kind: str) -> None:
    mechanism = ALL["two_link"]
    drive = choose_drive(kind, mechanism, scales_of(mechanism), np.random.default_rng(2))
    time = np.arange(0.0, 3.0, drive["period_s"])
    asked = motion("B", mechanism, time, np.random.default_rng(5))
    machine = nominal_machine(mechanism, drive)
    log = run_machine(mechanism, machine, time, asked, [0.0, 0.0], (0.0, 0.0), np.random.default_rng(0))
    assert np.sqrt(np.mean((log.position - asked) ** 2)) < 0.4 * np.std(asked)


def test_a_free_rotor_obeys_the_motor_equation() -> None:
    """Turntable on a voltage: J dv/dt = kt N / R (V - ke N v), whose solution is an exponential."""
    mechanism = ALL["turntable"]
    drive = choose_drive("voltage_motor", mechanism, scales_of(mechanism), np.random.default_rng(2))
    time = np.arange(0.0, 0.6, drive["period_s"])
    volts = np.where(time[:, None] > 0.05, 2.0, 0.0)
    machine = nominal_machine(mechanism, drive)
    log = run_machine(mechanism, machine, time, volts, [0.0], (0.0, 0.0), np.random.default_rng(0))
    kn = drive["torque_constant"][0] * drive["gear_ratio"][0]
    body = mechanism.links[0]
    inertia = body.inertia[2] + body.mass * body.reach**2 + rotors(drive)[0]
    rate = kn**2 / drive["resistance"][0] / inertia
    begin = time[np.argmax(volts[:, 0] > 0)]
    told = 2.0 / kn * (1.0 - np.exp(-rate * np.maximum(time - begin, 0.0)))
    assert np.abs(log.velocity[:, 0] - told).max() < 0.01 * told.max()
