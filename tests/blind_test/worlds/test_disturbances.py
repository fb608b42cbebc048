"""Every family acts where it physically acts, hardly at severity zero, and repeats itself."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from samrl_core.blind_test.disturbances.disturbance import Quantity, log_quantile, quantile
from samrl_core.blind_test.disturbances.registry import CATALOGUE, FAMILIES, OUTSIDE, family
from samrl_core.blind_test.engines.simulate import Trace
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.nominal import nominal_arm
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect, place_of
from samrl_core.common.errors import InputError

DURATION = 0.7
JOINT = 2  # its load reverses, gravity acts on it, and much hangs on it

# Channel in which a family shows first, as differences from the nominal run:
# controller: commanded effort against the law at the measured state; drive: effort against commanded effort;
# link: effort against inverse dynamics of the measured motion; encoder: position against velocity.
CHANNEL = {
    **dict.fromkeys(
        (
            "coulomb_friction viscous_friction stribeck_friction load_dependent_friction presliding "
            "friction_asymmetry position_dependent_friction gear_ripple thermal_friction reflected_inertia "
            "actuator_gain torque_saturation torque_rate_limit packet_jitter torque_sensor_error "
            "quadratic_drag torque_random_walk detent neighbour_coupling coarse_torque dead_phase backlash "
            "joint_elasticity transmission_hysteresis"
        ).split(),
        "drive",
    ),
    **dict.fromkeys("controller_gain gravity_not_compensated".split(), "controller"),
    **dict.fromkeys(
        (
            "encoder_offset payload link_inertia base_tilt mount_compliance cable "
            "periodic_push moving_platform soft_stop cable_snap"
        ).split(),
        "link",
    ),
    "encoder_eccentricity": "encoder",
    **dict.fromkeys("command_low_pass command_delay".split(), "either"),
}


@cache
def _trace(
    name: str | None, form: str, severity: float, joint: int = JOINT, onset: float | None = None
) -> Trace:
    effects = ()
    if name is not None:
        effects = (PlannedEffect(name, place_of(name, "tool_arm", joint), form, severity, onset),)
    item = PlanItem("", "single", "pybullet", "tool_arm", 0, effects, 1.0, 0, DURATION)
    made = [world._effect(e, item, nominal_arm("tool_arm"), np.random.default_rng(4)) for e in effects]
    return world._run(item, "B", made, 5, None, 0)


def _residuals(trace: Trace) -> dict[str, np.ndarray]:
    """RMS (J,) per channel, away from the first moments."""
    arm = nominal_arm("tool_arm")
    controller = world.description("tool_arm", "B", world.Tolerances()).controller
    assert controller is not None
    command = world.world_command("tool_arm", 0, "B", DURATION)
    acceleration = np.gradient(trace.velocity, 0.001, axis=0)
    law = controller.stiffness * (command.position - trace.position)  # type: ignore[operator]
    law += controller.damping * (command.velocity - trace.velocity)  # type: ignore[operator]
    law += np.array([arm.model.gravity(q) for q in trace.position])
    rotor = controller.armature * acceleration  # type: ignore[operator]
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
    return ("T2",) if FAMILIES[name].outside else ("T0", "T1")


ALL = [(name, form) for name in FAMILIES for form in _forms(name)]


def test_there_are_28_of_the_catalogue_and_at_least_8_outside() -> None:
    assert len(CATALOGUE) == 28 and len(OUTSIDE) >= 8
    assert set(CHANNEL) == set(FAMILIES)


@pytest.mark.parametrize(("name", "form"), ALL)
def test_acts_in_its_channel(name: str, form: str) -> None:
    floor, found = _residuals(_trace(None, "", 0.0)), _residuals(_trace(name, form, 0.5))
    if name in ("backlash", "joint_elasticity", "transmission_hysteresis"):
        # The encoder sits on the rotor: the links move otherwise than it says.
        assert (found["link"][JOINT] - floor["link"][JOINT]) > 0.003
        return
    channels = ("controller", "drive") if CHANNEL[name] == "either" else (CHANNEL[name],)
    if name == "encoder_eccentricity" and form == "T0":
        channels = ("link",)  # its velocity errs alike, and so the accelerations
    # A rate limit bites for moments only, in so short and gentle a motion.
    least = 0.002 if name == "torque_rate_limit" else 0.02
    assert max((found[c] - floor[c]).max() for c in channels) > least
    if CHANNEL[name] in ("drive", "controller") and name != "torque_sensor_error" and name != "packet_jitter":
        worst = np.argmax(found[CHANNEL[name]] - floor[CHANNEL[name]])
        assert worst == JOINT  # and at its joint


@pytest.mark.parametrize(("name", "form"), ALL)
def test_severity_zero_is_hardly_anything(name: str, form: str) -> None:
    nominal, idle = _trace(None, "", 0.0), _trace(name, form, 0.0)
    assert np.abs(idle.position - nominal.position).max() < 3e-4
    # Elastic joints and mounts take half the step, and stay a little soft.
    assert np.sqrt(((idle.effort - nominal.effort) ** 2).mean(axis=0)).max() < 0.05


@pytest.mark.parametrize("name", [n for n in FAMILIES if FAMILIES[n].onset])
def test_switched_on_later_nothing_happens_before(name: str) -> None:
    nominal, later = _trace(None, "", 0.0), _trace(name, _forms(name)[0], 0.75, JOINT, 0.4)
    assert np.array_equal(nominal.effort[:399], later.effort[:399])
    assert np.abs(nominal.effort - later.effort)[400:].max() > 0.01


def test_friction_of_a_stuck_joint_is_stable() -> None:
    trace = _trace("coulomb_friction", "T0", 1.0, 6)
    assert np.abs(np.diff(trace.velocity[50:, 6])).max() < 0.05  # no chatter, though Fc dt / (ve J) > 1


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_every_parameter_has_a_unit(name: str) -> None:
    effect = PlannedEffect(name, place_of(name, "camera_arm", JOINT), _forms(name)[0], 0.5, None)
    item = PlanItem("", "single", "pybullet", "camera_arm", 0, (effect,), 1.0, 0, DURATION)
    made = world._effect(effect, item, nominal_arm("camera_arm"), np.random.default_rng(0))
    assert made.parameters
    for quantity in made.parameters.values():
        assert isinstance(quantity, Quantity) and quantity.unit
        assert isinstance(quantity.value, str) or np.isfinite(quantity.value)


def test_quantiles() -> None:
    assert (
        quantile(0.0, 2.0, 4.0) == 0.0 and quantile(0.5, 2.0, 4.0) == 3.0 and quantile(1.0, 2.0, 4.0) == 4.0
    )
    assert log_quantile(0.0, 1.0, 100.0) == 0.0 and log_quantile(0.5, 1.0, 100.0) == pytest.approx(10.0)
    with pytest.raises(InputError, match="quantile"):
        quantile(1.5, 0.0, 1.0)
    with pytest.raises(InputError, match="unknown disturbance"):
        family("gremlins")
