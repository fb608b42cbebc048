from __future__ import annotations

import math

import numpy as np
import pytest

from samrl_core.blind_test.scores import parameters
from samrl_core.blind_test.scores.parameters import comparable
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.nominal import nominal_arm
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect, place_of


def stated(value: float, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "ci95": [value - 0.1, value + 0.1]}


def true(value: float | str, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit}


def test_equal_names_need_equal_units() -> None:
    pairs = comparable(
        "command_delay",
        {"T": stated(4.0, "ms"), "x": stated(1.0, "1"), "acts_on": stated(0.0, "channel")},
        {"T": true(0.004, "s"), "acts_on": true("effort", "channel")},
    )
    assert pairs == []
    (pair,) = comparable("command_delay", {"T": stated(0.005, "s")}, {"T": true(0.004, "s")})
    assert (pair[0], pair[2]) == ("T", 0.004)


def test_translated_names_and_whole_turns() -> None:
    label = {"A": true(0.2, "N m"), "N": true(40.0, "1/rad"), "phi": true(-3.1, "rad")}
    claim = {
        "amplitude": stated(0.21, "N m"),
        "order": stated(40.0, "1/rad"),
        "phase": stated(0.05, "rad"),
    }
    found = {name: value for name, _, value in comparable("gear_ripple", claim, label)}
    assert found == pytest.approx({"amplitude": 0.2, "order": 40.0, "phase": -3.1 + math.pi})
    sides = {"forward": true(0.5, "N m"), "backward": true(0.1, "N m")}
    (pair,) = comparable("friction_asymmetry", {"difference": stated(0.2, "N m")}, sides)
    assert pair[2] == pytest.approx(0.2)


def test_no_interval_is_not_comparable() -> None:
    claim = {
        "Fc": {"value": 0.4, "unit": "N m", "ci95": None},
        "Fs": {"value": 0.4, "unit": "N m", "ci95": [None, 1]},
    }
    assert comparable("coulomb_friction", claim, {"Fc": true(0.4, "N m"), "Fs": true(0.4, "N m")}) == []


def test_what_is_translated_is_in_the_labels(short_worlds: None) -> None:

    for family, translations in parameters._SAME.items():
        effect = PlannedEffect(family, place_of(family, "tool_arm", 3), "T0", 0.5, None)
        item = PlanItem("", "single", "pybullet", "tool_arm", 0, (effect,), 1.0, 0, 0.3)
        made = world._effect(effect, item, nominal_arm("tool_arm"), np.random.default_rng(0))
        values = {name: float(q.value) for name, q in made.parameters.items() if not isinstance(q.value, str)}
        for translate in translations.values():
            assert np.isfinite(translate(values))
