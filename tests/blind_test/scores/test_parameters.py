from __future__ import annotations

import math

import numpy as np
import pytest

from samrl_core.blind_test.scores.effect_scores import comparable
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.nominal import nominal_arm
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect, place_of


def stated(value: float, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "ci95": [value - 0.1, value + 0.1]}


def true(value: float | str, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit}


def test_equal_names_need_equal_units() -> None:
    pairs = comparable(
        {"T": stated(4.0, "ms"), "x": stated(1.0, "1"), "acts_on": stated(0.0, "channel")},
        {"T": true(0.004, "s"), "acts_on": true("effort", "channel")},
    )
    assert pairs == []
    (pair,) = comparable({"T": stated(0.005, "s")}, {"T": true(0.004, "s")})
    assert (pair[0], pair[2]) == ("T", 0.004)


def test_angles_are_the_same_after_whole_turns() -> None:
    label = {
        "amplitude": true(0.2, "N m"),
        "order": true(40.0, "1/rad"),
        "phase": true(-3.1 - math.pi, "rad"),
        "swing": true(1.0, "N m"),
    }
    claim = {
        "amplitude": stated(0.21, "N m"),
        "order": stated(40.0, "1"),
        "phase": stated(0.05, "rad"),
        "level": stated(0.3, "N m"),
    }
    found = {name: value for name, _, value in comparable(claim, label)}
    assert found == pytest.approx({"amplitude": 0.2, "order": 40.0, "phase": -3.1 + math.pi})


def test_no_interval_is_not_comparable() -> None:
    claim = {
        "Fc": {"value": 0.4, "unit": "N m", "ci95": None},
        "Fs": {"value": 0.4, "unit": "N m", "ci95": [None, 1]},
    }
    assert comparable(claim, {"Fc": true(0.4, "N m"), "Fs": true(0.4, "N m")}) == []


def test_labels_hold_what_is_compared(short_worlds: None) -> None:
    """Quantities that were once named unlike, by the size that the disturbance really has."""

    def label(family: str, form: str = "T0") -> dict[str, float]:
        effect = PlannedEffect(family, place_of(family, "tool_arm", 3), form, 0.5, None)
        item = PlanItem("", "single", "pybullet", "tool_arm", 0, (effect,), 1.0, 0, 0.3)
        made = world._inject(effect, item, nominal_arm("tool_arm"), np.random.default_rng(0))
        return {name: float(q.value) for name, q in made.parameters.items() if not isinstance(q.value, str)}

    sides = label("friction_asymmetry")
    assert 2.0 * sides["mean"] == pytest.approx(sides["A"]) and abs(sides["difference"]) < sides["mean"]
    harmonic = label("position_dependent_friction")
    assert harmonic["amplitude"] == pytest.approx(0.35 * harmonic["swing"])
    assert harmonic["level"] == pytest.approx(0.5 * harmonic["swing"]) and harmonic["order"] >= 2.0
    alike, back = label("load_dependent_friction"), label("load_dependent_friction", "T1")
    assert alike["Kb"] == alike["Kl"] and back["Kb"] == pytest.approx(1.8 * back["Kl"])
    assert label("transmission_hysteresis")["a"] > 0 and label("cable")["h"] > 0
    found = {
        "backlash": "b", "reflected_inertia": "Ja", "torque_saturation": "L", "torque_rate_limit": "R",
        "packet_jitter": "held", "controller_gain": "eD", "payload": "com_z", "mount_compliance": "damping",
    }  # fmt: skip
    for family, name in found.items():
        assert np.isfinite(label(family)[name]) and label(family)[name] != 0.0
