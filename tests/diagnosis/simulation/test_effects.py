"""Each plant parameter: neutral changes nothing, anything else shows in the channels where it acts."""

from __future__ import annotations

from dataclasses import dataclass, fields
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.diagnosis.effects.form import Place, Shape
from samrl_core.diagnosis.effects.friction.stribeck_friction import (
    ExponentialDrop,
    FallingForm,
    RationalDrop,
)
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters, joint_fields
from tests.diagnosis.simulation.arms import of_spec, still, swing

if TYPE_CHECKING:
    from samrl_core.diagnosis.residuals.trial import Trial

ARMATURE = np.full(7, 0.05)
DURATION = 0.4
JOINT = 3


@dataclass(frozen=True)
class Case:
    """Values that are not neutral, and the channels in which they must show; no other may."""

    values: dict[str, Any]
    shows: frozenset[str]


def _case(shows: str, **values: Any) -> Case:
    return Case(values, frozenset(shows.split()))


_PAYLOAD = np.array([0.4, 0.004, 0.0, 0.02, 1e-3, 0, 1e-3, 0, 0, 1e-3])
CASES: dict[str, Case] = {
    "encoder_offset": _case("link", encoder_offset=0.01),
    "encoder_amplitude": _case("drive link", encoder_amplitude=0.003),
    "encoder_phase": _case("drive link", encoder_amplitude=0.003, encoder_phase=1.0),
    "encoder_resolution": _case("link", encoder_resolution=0.001),
    "stiffness_scale": _case("controller", stiffness_scale=0.8),
    "damping_scale": _case("controller", damping_scale=0.8),
    "dead_band": _case("controller", dead_band=0.001),
    "command_delay": _case("controller", command_delay=0.0035),
    "command_cutoff": _case("controller", command_cutoff=20.0),
    "effort_delay": _case("drive", effort_delay=0.0024),
    "hold_probability": _case("drive", hold_probability=0.2),
    "effort_cutoff": _case("drive", effort_cutoff=30.0),
    "effort_rate_limit": _case("drive", effort_rate_limit=20.0),
    "effort_limit": _case("drive", effort_limit=15.0),
    "actuator_gain": _case("drive", actuator_gain=0.05),
    "back_emf": _case("drive", back_emf=0.5),
    "torque_offset": _case("drive", torque_offset=0.2),
    "harmonic_amplitude": _case("drive", harmonic_amplitude=0.2, harmonic_order=30.0),
    "harmonic_order": _case("drive", harmonic_amplitude=0.2, harmonic_order=50.0),
    "harmonic_phase": _case("drive", harmonic_amplitude=0.2, harmonic_phase=1.0),
    "rotor_inertia": _case("drive", rotor_inertia=0.1),
    "coulomb": _case("drive", coulomb=0.4),
    "coulomb_velocity": _case("drive", coulomb=0.4, coulomb_velocity=0.05),
    "viscous": _case("drive", viscous=0.5),
    "stribeck_drop": _case("drive", stribeck_drop=0.3),
    "stribeck_velocity": _case("drive", stribeck_drop=0.3, stribeck_velocity=0.3),
    "stribeck_exponent": _case("drive", stribeck_drop=0.3, stribeck_exponent=1.0),
    "load_friction": _case("drive", load_friction=0.05),
    "friction_asymmetry": _case("drive", friction_asymmetry=0.1),
    "friction_harmonic_amplitude": _case(
        "drive", friction_harmonic_amplitude=0.2, friction_harmonic_order=9.0
    ),
    "friction_harmonic_order": _case("drive", friction_harmonic_amplitude=0.2, friction_harmonic_order=3.0),
    "friction_harmonic_phase": _case("drive", friction_harmonic_amplitude=0.2, friction_harmonic_phase=0.5),
    "presliding_stiffness": _case("drive", coulomb=0.4, presliding_stiffness=500.0),
    "thermal_ratio": _case("drive", coulomb=0.4, thermal_ratio=0.5),
    "thermal_time": _case("drive", coulomb=0.4, thermal_ratio=0.5, thermal_time=0.2),
    "thermal_offset": _case("drive", coulomb=0.4, thermal_ratio=0.5, thermal_offset=300.0),
    "joint_stiffness": _case("link", joint_stiffness=4000.0),
    "joint_damping": _case("link", joint_stiffness=4000.0, joint_damping=5.0),
    "backlash": _case("link", backlash=0.001),
    "hysteresis_amplitude": _case("link", hysteresis_amplitude=5e-4),
    "hysteresis_torque": _case("link", hysteresis_amplitude=5e-4, hysteresis_torque=2.0),
    "sensor_gain": _case("drive link", sensor_gain=0.03),
    "sensor_bias": _case("drive link", sensor_bias=0.2),
    "sensor_drift": _case("drive link", sensor_drift=0.5),
    "cable_stiffness": _case("link", cable_stiffness=1.0, cable_rest=0.2),
    "cable_rest": _case("link", cable_stiffness=1.0, cable_rest=-0.5),
    "cable_friction": _case("link", cable_friction=0.3),
    "inertial_delta": _case("link", inertial_delta=np.tile(0.1 * _PAYLOAD, (7, 1))),
    "payload": _case("link", payload=_PAYLOAD),
    "gravity": _case("link", gravity=np.array([0.2, -0.1, -9.8])),
    "mount_stiffness": _case("link", mount_stiffness=3e4),
    "mount_damping": _case("link", mount_stiffness=3e4, mount_damping=100.0),
    "mount_inertia": _case("link", mount_stiffness=3e4, mount_inertia=2.0),
    "reading": _case("drive", joint_stiffness=4000.0, reading="link"),
    "seed": _case("drive", hold_probability=0.2, seed=5),
}


@pytest.fixture(scope="module")
def loop() -> ClosedLoop:
    return ClosedLoop(LoopModel(of_spec(PANDA, armature=ARMATURE)))


def _run(loop: ClosedLoop, plant: PlantParameters) -> Rollouts:
    start = PANDA.home
    return loop.rollout(swing(start, DURATION, 0.15, 2.0), start, np.zeros(7), [plant], DURATION)


def _residuals(loop: ClosedLoop, run: Rollouts) -> dict[str, float]:
    """Largest residual of the nominal law, drive and links at the measured motion [N m]."""
    control = loop.arm.controller
    assert control is not None
    command = swing(PANDA.home, DURATION, 0.15, 2.0)
    assert command.position is not None and command.velocity is not None
    q, v = run.position[0, :-1], run.velocity[0, :-1]
    ddq = np.diff(run.velocity[0], axis=0) / 0.001
    count = len(q)
    law = control.stiffness * (command.position[:count] - q) + control.damping * (
        command.velocity[:count] - v
    )
    law = np.clip(law + loop.model.rigid.gravity(q), -loop.model.effort_limit, loop.model.effort_limit)
    u, torque = run.commanded_effort[0, :-1], run.effort[0, :-1]
    return {
        "controller": np.abs(u - law).max(),
        "drive": np.abs(torque - (u - ARMATURE * ddq)).max(),
        "link": np.abs(torque - loop.model.rigid.inverse_dynamics(q, v, ddq)).max(),
    }


def test_every_field_has_a_case() -> None:
    assert {f.name for f in fields(PlantParameters)} == set(CASES)


def test_nominal_plant_has_no_residual_anywhere(loop: ClosedLoop) -> None:
    assert max(_residuals(loop, _run(loop, PlantParameters())).values()) < 1e-9


@pytest.mark.parametrize("name", joint_fields())
def test_neutral_is_exactly_nothing(loop: ClosedLoop, name: str) -> None:
    default = joint_fields()[name]["default"]
    plain = _run(loop, PlantParameters())
    values: dict[str, Any] = {name: np.full(7, default)}
    stated = _run(loop, PlantParameters(**values))
    np.testing.assert_array_equal(plain.position, stated.position)
    np.testing.assert_array_equal(plain.effort, stated.effort)


@pytest.mark.parametrize("name", CASES)
def test_effect_shows_where_it_acts(loop: ClosedLoop, name: str) -> None:
    found = _residuals(loop, _run(loop, PlantParameters(**CASES[name].values)))
    shown = {channel for channel, size in found.items() if size > 1e-6}
    assert shown == CASES[name].shows, found


@pytest.mark.parametrize("name", [n for n in CASES if n in joint_fields()])
def test_effect_of_one_joint_starts_at_that_joint(loop: ClosedLoop, name: str) -> None:
    """What differs first, before dynamics couple the joints, is the stated joint's own chain."""
    case = CASES[name]
    values: dict[str, Any] = {
        key: np.where(np.arange(7) == JOINT, value, joint_fields()[key]["default"])
        for key, value in case.values.items()
        if key in joint_fields()
    }
    run, plain = _run(loop, PlantParameters(**values)), _run(loop, PlantParameters())
    assert max(np.abs(run.effort - plain.effort).max(), np.abs(run.position - plain.position).max()) > 1e-6
    if "link" not in case.shows:
        residual = run.effort[0, :-1] - run.commanded_effort[0, :-1]
        residual = residual + ARMATURE * np.diff(run.velocity[0], axis=0) / 0.001
        others = np.delete(np.abs(residual).max(axis=0), JOINT)
        assert others.max() < 1e-9


def test_parameters_that_only_modify_another_still_matter(loop: ClosedLoop) -> None:
    """A phase, a width or a time constant changes the run, not only its partner."""
    for name, case in CASES.items():
        partners = {key: value for key, value in case.values.items() if key != name}
        if not partners:
            continue
        with_it = _run(loop, PlantParameters(**case.values))
        without = _run(loop, PlantParameters(**partners))
        assert np.abs(with_it.effort - without.effort).max() > 1e-7, name


def test_mount_swings_and_settles(loop: ClosedLoop) -> None:
    """The base starts in its own equilibrium: a still arm on a soft mount stays still."""
    plant = PlantParameters(mount_stiffness=2e4, mount_damping=20.0, mount_inertia=1.0)
    run = loop.rollout(still(PANDA.home), PANDA.home, np.zeros(7), [plant], 0.3)
    assert np.abs(run.velocity).max() < 0.02


@pytest.mark.parametrize(
    ("made", "shape"),
    [(ExponentialDrop, {"d": 1.0}), (ExponentialDrop, {"d": 2.0}), (RationalDrop, {})],
    ids=["exp(-x)", "exp(-x^2)", "1 / (1 + x^2)"],
)
def test_a_drop_is_simulated_as_it_is_fitted(loop: ClosedLoop, made: type[FallingForm], shape: Shape) -> None:
    """Each was simulated as exp(-x^2), which is flat at rest, where exp(-x) falls most steeply."""
    amplitudes, shape = np.array([0.3, 0.6]), {"v": 0.005, "vs": 0.1, **shape}
    form = made(name="", place=Place("", (JOINT,)), amplitudes=("Fc", "drop"), shapes=(shape,))
    trial = cast("Trial", SimpleNamespace(joints=7, motion=SimpleNamespace()))
    fields_of_it = form.plant_fields(trial, shape, amplitudes)
    assert fields_of_it is not None
    run = _run(loop, PlantParameters(**fields_of_it))
    lost = run.commanded_effort[0, :-1] - run.effort[0, :-1]
    lost = lost[:, JOINT] - ARMATURE[JOINT] * np.diff(run.velocity[0, :, JOINT]) / 0.001
    trial.motion.sure_velocity = run.velocity[0, 1:]
    turned = np.abs(run.velocity[0, 1:, JOINT]) > 0.02  # the sign's turn is linearised in each step
    assert np.count_nonzero(turned) > 300
    expected = amplitudes @ form.torque(trial, JOINT, shape)
    np.testing.assert_allclose(lost[turned], expected[turned], atol=0.01)
