"""Every family acts where it physically acts, hardly at severity zero, and repeats itself."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from samrl_core.blind_test import disturbances
from samrl_core.blind_test.disturbances.disturbance import Quantity, log_quantile, quantile
from samrl_core.blind_test.disturbances.registry import CATALOGUE, DISTURBANCES, OUTSIDE, find_disturbance
from samrl_core.blind_test.engines.simulate import Trace
from samrl_core.blind_test.servo_worlds.effects import FAMILIES as SERVO_FAMILIES
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.nominal import nominal_arm
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect, place_of
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import EFFECTS, Effect

DURATION = 0.7
JOINT = 2  # its load reverses, gravity acts on it, and much hangs on it


@cache
def _trace(
    name: str | None, form: str, severity: float, joint: int = JOINT, onset: float | None = None
) -> Trace:
    effects = ()
    if name is not None:
        effects = (PlannedEffect(name, place_of(name, "tool_arm", joint), form, severity, onset),)
    item = PlanItem("", "single", "pybullet", "tool_arm", 0, effects, 1.0, 0, DURATION)
    made = [world._inject(e, item, nominal_arm("tool_arm"), np.random.default_rng(4)) for e in effects]
    return world._run(item, "B", made, 5, None, 0)


def _residuals(trace: Trace) -> dict[str, np.ndarray]:
    """RMS (J,) per channel, away from the first moments."""
    arm = nominal_arm("tool_arm")
    controller = world.description("tool_arm", "B", world.Tolerances()).controller
    assert controller is not None
    command = world.world_command("tool_arm", 0, "B", DURATION)
    acceleration = np.gradient(trace.velocity, 0.001, axis=0)
    law = controller.stiffness * (command.position - trace.position)
    law += controller.damping * (command.velocity - trace.velocity)
    law += np.array([arm.model.gravity(q) for q in trace.position])
    rotor = controller.armature * acceleration
    links = np.array(
        [
            arm.model.inverse_dynamics(q, v, a)
            for q, v, a in zip(trace.position, trace.velocity, acceleration, strict=True)
        ]
    )
    travelled = np.cumsum(trace.velocity - 0.5 * np.diff(trace.velocity, axis=0, prepend=0.0), axis=0) * 0.001
    gaps = {
        "encoder": 100.0 * (trace.position - trace.position[0] - travelled + travelled[0]),  # [10 mrad]
        "controller": trace.commanded - law,
        "drive": trace.effort - trace.commanded + rotor,
        "link": trace.effort - (links - rotor),
    }
    return {name: np.sqrt((gap[100:-5] ** 2).mean(axis=0)) for name, gap in gaps.items()}


def _forms(name: str) -> tuple[str, ...]:
    return ("T2",) if DISTURBANCES[name].outside else ("T0", "T1")


# What only a servo can have is made by the servo worlds (test_servo_worlds.py).
OF_SERVOS = set(SERVO_FAMILIES) - set(CATALOGUE)
OF_MACHINES = [e for e in EFFECTS if not e.of_description and e.family not in OF_SERVOS]
ALL = [(name, form) for name in DISTURBANCES for form in _forms(name)]


def test_every_effect_of_the_diagnosis_and_every_file_outside_is_listed() -> None:
    assert set(CATALOGUE) == {effect.family for effect in OF_MACHINES}
    folder = Path(disturbances.__file__).parent / "outside"
    assert set(OUTSIDE) == {file.stem for file in folder.glob("[a-z]*.py")}
    assert {d.shows_in for d in DISTURBANCES.values()} == {"controller", "drive", "link", "encoder", "either"}


@pytest.mark.parametrize(("name", "form"), ALL)
def test_acts_in_its_channel(name: str, form: str) -> None:
    floor, found = _residuals(_trace(None, "", 0.0)), _residuals(_trace(name, form, 0.5))
    if DISTURBANCES[name].twists:
        # The encoder sits on the rotor: the links move otherwise than it says.
        assert (found["link"][JOINT] - floor["link"][JOINT]) > 0.003
        return
    channels = (
        ("controller", "drive") if DISTURBANCES[name].shows_in == "either" else (DISTURBANCES[name].shows_in,)
    )
    if name == "encoder_eccentricity" and form == "T0":
        channels = ("link",)  # its velocity errs alike, and so the accelerations
    # A rate limit bites for moments only, in so short and gentle a motion.
    least = 0.002 if name == "torque_rate_limit" else 0.02
    assert max((found[c] - floor[c]).max() for c in channels) > least
    if (
        DISTURBANCES[name].shows_in in ("drive", "controller")
        and name != "torque_sensor_error"
        and name != "packet_jitter"
    ):
        worst = np.argmax(found[DISTURBANCES[name].shows_in] - floor[DISTURBANCES[name].shows_in])
        assert worst == JOINT  # and at its joint


@pytest.mark.parametrize(("name", "form"), ALL)
def test_severity_zero_is_hardly_anything(name: str, form: str) -> None:
    nominal, idle = _trace(None, "", 0.0), _trace(name, form, 0.0)
    assert np.abs(idle.position - nominal.position).max() < 3e-4
    # Elastic joints and mounts take half the step, and stay a little soft.
    assert np.sqrt(((idle.effort - nominal.effort) ** 2).mean(axis=0)).max() < 0.05


@pytest.mark.parametrize("name", [n for n in DISTURBANCES if DISTURBANCES[n].onset])
def test_switched_on_later_nothing_happens_before(name: str) -> None:
    nominal, later = _trace(None, "", 0.0), _trace(name, _forms(name)[0], 0.75, JOINT, 0.4)
    assert np.array_equal(nominal.effort[:399], later.effort[:399])
    assert np.abs(nominal.effort - later.effort)[400:].max() > 0.01


def test_friction_of_a_stuck_joint_is_stable() -> None:
    trace = _trace("coulomb_friction", "T0", 1.0, 6)
    assert np.abs(np.diff(trace.velocity[50:, 6])).max() < 0.05  # no chatter, though Fc dt / (ve J) > 1


@pytest.mark.parametrize("name", sorted(DISTURBANCES))
def test_every_parameter_has_a_unit(name: str) -> None:
    effect = PlannedEffect(name, place_of(name, "camera_arm", JOINT), _forms(name)[0], 0.5, None)
    item = PlanItem("", "single", "pybullet", "camera_arm", 0, (effect,), 1.0, 0, DURATION)
    made = world._inject(effect, item, nominal_arm("camera_arm"), np.random.default_rng(0))
    assert made.parameters
    for quantity in made.parameters.values():
        assert isinstance(quantity, Quantity) and quantity.unit
        assert isinstance(quantity.value, str) or np.isfinite(quantity.value)


def _labels(name: str) -> list[dict[str, Quantity]]:
    labels = []
    for form in _forms(name):
        effect = PlannedEffect(name, place_of(name, "tool_arm", JOINT), form, 0.5, None)
        item = PlanItem("", "single", "pybullet", "tool_arm", 0, (effect,), 1.0, 0, DURATION)
        rng = np.random.default_rng(0)
        labels.append(world._inject(effect, item, nominal_arm("tool_arm"), rng).parameters)
    return labels


def test_each_effect_has_its_disturbance() -> None:
    assert [e.family for e in OF_MACHINES] == list(CATALOGUE)
    assert OF_SERVOS == {"dead_band"}


@pytest.mark.parametrize("effect", OF_MACHINES, ids=lambda e: e.family)
def test_parameters_are_named_as_the_effect_names_them(effect: Effect) -> None:
    """The two wings do not know each other: what is the same quantity has one name and one unit in both."""
    units = {p.name: p.unit for p in effect.parameters}
    labels = _labels(effect.family)
    for label in labels:
        assert all(units.get(name, quantity.unit) == quantity.unit for name, quantity in label.items())
    # A mass error of a link is a share of it, which no joint can show: the effect states base parameters.
    assert set(labels[0]) & set(units) or effect.family == "link_inertia"


def test_quantiles() -> None:
    assert (
        quantile(0.0, 2.0, 4.0) == 0.0 and quantile(0.5, 2.0, 4.0) == 3.0 and quantile(1.0, 2.0, 4.0) == 4.0
    )
    assert log_quantile(0.0, 1.0, 100.0) == 0.0 and log_quantile(0.5, 1.0, 100.0) == pytest.approx(10.0)
    with pytest.raises(InputError, match="quantile"):
        quantile(1.5, 0.0, 1.0)
    with pytest.raises(InputError, match="unknown disturbance"):
        find_disturbance("gremlins")


def test_a_name_stands_in_one_file_only() -> None:
    """Also over both lists: a family that is in the catalogue is not unknown to the library."""
    from samrl_core.blind_test.disturbances import registry

    with pytest.raises(InputError, match="'quadratic_drag', as another file"):
        registry._load(("outside.quadratic_drag", "friction.coulomb_friction", "outside.quadratic_drag"))
