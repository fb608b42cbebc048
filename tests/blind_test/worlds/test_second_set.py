"""The second set acts where it says, hardly at severity zero, repeats itself, and is not the first one."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Quantity
from samrl_core.blind_test.disturbances.registry import CATALOGUE, DISTURBANCES
from samrl_core.blind_test.engines.simulate import Trace
from samrl_core.blind_test.second_set.friction import IwanElements, slip_elements
from samrl_core.blind_test.second_set.registry import SECOND_OUTSIDE, SECOND_SET, find_second, form_of
from samrl_core.blind_test.second_set.transmission import DuffingSpring, HertzFlanks
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.nominal import nominal_arm
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect, place_of
from samrl_core.common.errors import InputError

DURATION = 0.7
JOINT = 2  # its load reverses, gravity acts on it, and much hangs on it
ALL = {**SECOND_SET, **SECOND_OUTSIDE}


def _effect(name: str, severity: float) -> PlannedEffect:
    return PlannedEffect(name, place_of(name, "tool_arm", JOINT, 2), form_of(name), severity, None, 2)


@cache
def _trace(name: str | None, severity: float) -> Trace:
    effects = () if name is None else (_effect(name, severity),)
    item = PlanItem("", "single", "pinocchio", "tool_arm", 0, effects, 1.0, 0, DURATION)
    made = [world._inject(e, item, nominal_arm("tool_arm"), np.random.default_rng(4)) for e in effects]
    return world._run(item, "B", made, 5, None, 0)


def _gap(trace: Trace) -> dict[str, float]:
    nominal = _trace(None, 0.0)
    return {
        name: float(np.sqrt(((getattr(trace, name) - getattr(nominal, name))[100:] ** 2).mean(axis=0)).max())
        for name in ("position", "velocity", "effort", "commanded")
    }


def test_every_family_of_the_first_set_stands_in_the_second() -> None:
    assert set(SECOND_SET) == set(CATALOGUE)
    assert not set(SECOND_OUTSIDE) & set(DISTURBANCES) and len(SECOND_OUTSIDE) >= 8
    for name, first in ((n, DISTURBANCES[n]) for n in CATALOGUE):
        second: Disturbance = SECOND_SET[name]
        assert (second.place, second.twists) == (first.place, first.twists)
    with pytest.raises(InputError, match="second set"):
        find_second("quadratic_drag")


@pytest.mark.parametrize("name", sorted(ALL))
def test_shows_at_half_severity_and_hardly_at_none(name: str) -> None:
    shown = _gap(_trace(name, 0.5))
    least = 0.01 if name == "torque_rate_limit" else 0.03  # [N m]; it bites for moments in so gentle a motion
    assert max(shown["effort"], shown["commanded"]) > least
    idle = _gap(_trace(name, 0.0))
    assert idle["position"] < 3e-4 and idle["effort"] < 0.05


@pytest.mark.parametrize("name", sorted(ALL))
def test_parameters_have_units_and_repeat(name: str) -> None:
    item = PlanItem("", "single", "pybullet", "camera_arm", 0, (), 1.0, 0, DURATION)
    place = place_of(name, "camera_arm", JOINT, 2)
    planned = PlannedEffect(name, place, form_of(name), 0.5, None, 2)
    first, second = (
        world._inject(planned, item, nominal_arm("camera_arm"), np.random.default_rng(0)).parameters
        for _ in range(2)
    )
    assert first == second and first
    for quantity in first.values():
        assert isinstance(quantity, Quantity) and quantity.unit
        assert isinstance(quantity.value, str) or np.isfinite(quantity.value)


def test_maxwell_slip_holds_its_stiffness_its_level_and_its_loop() -> None:
    element = IwanElements(*slip_elements(300.0, 0.9))
    a, c = element.linear(0.0, 0.0, 1e-3, 0.0, 1e-3)
    assert a + c * 1e-3 == pytest.approx(300.0 * 1e-6)
    for _ in range(200):  # 20 mrad in one direction: all slip
        element.commit(0.0, 0.0, 0.1, 0.0, 1e-3)
    assert sum(element.linear(0.0, 0.0, 0.1, 0.0, 1e-3)) == pytest.approx(0.9)
    assert element.linear(0.0, 0.0, 0.0, 0.0, 1e-3)[0] == pytest.approx(0.9)  # at rest it still pushes back


@pytest.mark.parametrize("torque", [-7.0, 3.0])
def test_transmissions_rest_where_they_carry_the_load(torque: float) -> None:
    for element in (HertzFlanks(1e-3, 5e5, 0.1), DuffingSpring(2000.0, 0.5, 0.4, 2e-3)):
        assert element.linear(0.0, element.rest_twist(torque), 0.0, 1e-3)[0] == pytest.approx(
            torque, rel=1e-6
        )
