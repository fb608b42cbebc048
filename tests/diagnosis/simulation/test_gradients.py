"""Derivatives by the adjoint method against differences of rollouts, for every continuous quantity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.cell.types.controllers import controller_from
from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.gradients import Gradient, gradient
from samrl_core.diagnosis.simulation.jacobian import jacobian
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters, joint_fields
from tests.diagnosis.simulation.arms import ARMS, description, swing

DURATION = 0.15
NEVER = ("encoder_resolution", "hold_probability")
# Everything at once, and off every corner of a piecewise-linear law.
RICH = PlantParameters(
    encoder_offset=0.003, encoder_amplitude=0.002, encoder_phase=0.3, stiffness_scale=1.1, damping_scale=0.9,
    command_delay=0.0023, command_cutoff=30.0, effort_delay=0.0014, effort_cutoff=80.0, actuator_gain=0.05,
    torque_offset=0.1, harmonic_amplitude=0.2, harmonic_order=8.0, harmonic_phase=0.4, rotor_inertia=0.02,
    coulomb=0.3, coulomb_velocity=0.02, viscous=0.2, stribeck_drop=0.1, stribeck_exponent=1.5,
    load_friction=0.02, friction_asymmetry=0.05, friction_harmonic_amplitude=0.05,
    friction_harmonic_order=5.0, thermal_ratio=0.3, thermal_time=1.0, thermal_offset=0.2,
    hysteresis_amplitude=3e-4, sensor_gain=0.02, sensor_bias=0.1, sensor_drift=0.5,
    cable_stiffness=1.0, cable_rest=0.2, cable_friction=0.2,
    gravity=np.array([0.1, -0.05, -9.8]),
    payload=np.array([0.3, 0.003, 0.001, 0.02, 0.001, 0, 0.001, 0, 0, 0.001]),
)  # fmt: skip
PLANTS = {
    "rich": RICH,
    "neutral": PlantParameters(rotor_inertia=0.02),
    "quasi-static": replace(RICH, joint_stiffness=3000.0, rotor_inertia=0.001, backlash=1e-4),
    "two masses": replace(RICH, joint_stiffness=3000.0, rotor_inertia=0.2, joint_damping=2.0),
    "bristle": replace(RICH, presliding_stiffness=500.0),
    "mount": replace(RICH, mount_stiffness=2e4, mount_damping=30.0, mount_inertia=1.0),
    "link encoder": replace(RICH, reading="link", joint_stiffness=3000.0, rotor_inertia=0.2),
}

FAST = ("rich", "two masses", "quasi-static", "mount")


@dataclass(frozen=True, eq=False)
class Problem:
    """A random linear functional of all channels, its gradient, and one joint to look at."""

    loop: ClosedLoop
    command: JointSignal
    start: np.ndarray
    speed: np.ndarray
    plant: PlantParameters
    weights: Rollouts
    gradient: Gradient

    def value(self, **changed: Any) -> float:
        """The functional after changes of the plant, `command`, `start` or `speed`."""
        named = {key: changed.pop(key, getattr(self, key)) for key in ("command", "start", "speed")}
        plant = replace(self.plant, **changed)
        run = self.loop.rollout(named["command"], named["start"], named["speed"], [plant], DURATION)
        return float(_functional(self.weights, run)[0])


def _functional(weights: Rollouts, run: Rollouts) -> np.ndarray:
    pairs = (
        (weights.position, run.position), (weights.velocity, run.velocity), (weights.effort, run.effort),
        (weights.commanded_effort, run.commanded_effort),
    )  # fmt: skip
    return np.array([sum(np.sum(w[0] * c[b]) for w, c in pairs) for b in range(len(run.position))])


def _problem(
    arm: str, plant: PlantParameters, described: ArmController | None = None, **options: Any
) -> Problem:
    about, start = ARMS[arm]
    if described is not None:
        about = replace(about, controller=described)
    loop = ClosedLoop(LoopModel(about, **options))
    joints = len(start)
    rng = np.random.default_rng(5)
    shape = (1, int(DURATION / about.controller.period_s + 0.5) + 1, joints)
    weights = Rollouts(np.zeros(0), *(rng.normal(0, s, shape) for s in (1.0, 0.3, 0.01, 0.01)))
    speed = np.linspace(0.1, -0.12, joints) if joints > 1 else np.array([0.1])
    command = swing(start, DURATION, 0.1, 3.0)
    found = gradient(
        loop, command, start, speed, [plant], DURATION, lambda run: (_functional(weights, run), weights)
    )
    return Problem(loop, command, start, speed, plant, weights, found)


def _difference(value: Callable[[float], float], step: float) -> float:
    """Fourth-order central difference."""
    near, far = value(step) - value(-step), value(2 * step) - value(-2 * step)
    return (8 * near - far) / (12 * step)


def _compare(name: str, found: float, value: Callable[[float], float], step: float, noise: float) -> None:
    # Rounding of the functional limits the difference; a kink within the step shows at a smaller one.
    errors = []
    for h in (step, step / 10, step * 10):
        wanted = _difference(value, h)
        errors.append(abs(found - wanted) - noise * 1e-13 / h)
        if errors[-1] <= 1e-4 * max(abs(wanted), 1e-4):
            return
    raise AssertionError(f"{name}: adjoint {found}, differences off by {errors}")


def _check_all(problem: Problem, fields: list[str] | None = None) -> None:
    joints = len(problem.start)
    j = joints // 2
    unit = np.eye(joints)[j]
    found, plant = problem.gradient, problem.plant
    noise = 100 * max(1.0, abs(problem.value()))
    _compare(
        "start position",
        found.start_position[0, j],
        lambda h: problem.value(start=problem.start + h * unit),
        1e-5,
        noise,
    )
    _compare(
        "start velocity",
        found.start_velocity[0, j],
        lambda h: problem.value(speed=problem.speed + h * unit),
        1e-5,
        noise,
    )
    for channel in ("position", "velocity", "effort"):

        def commanded(h: float, channel: str = channel) -> float:
            values = np.array(getattr(problem.command, channel))
            values[40, j] += h
            return problem.value(command=replace(problem.command, **{channel: values}))

        _compare(f"command {channel}", getattr(found.command, channel)[40, j], commanded, 1e-4, noise)
    for name, about in joint_fields().items():
        values = plant.joint_values(name, joints)
        if name in NEVER or not np.isfinite(values[j]):
            continue
        absent = name in ("presliding_stiffness", "backlash") and values[j] == 0
        at_bound = about["low"] == values[j]
        if absent or at_bound:
            continue
        step = 1e-5 * max(abs(values[j]), 0.01)
        _compare(
            name,
            found.plants[0][name][j],
            lambda h, n=name, v=values: problem.value(**{n: v + h * unit}),
            step,
            noise,
        )
    for i in range(10):
        at = np.zeros((joints, 10))
        at[j, i] = 1.0
        _compare(
            f"inertia {i}",
            found.plants[0]["inertial_delta"][j, i],
            lambda h, at=at: problem.value(inertial_delta=h * at),
            1e-5,
            noise,
        )
        payload = np.zeros(10) if plant.payload is None else plant.payload
        _compare(
            f"payload {i}",
            found.plants[0]["payload"][i],
            lambda h, i=i, p=payload: problem.value(payload=p + h * np.eye(10)[i]),
            1e-5,
            noise,
        )
    gravity = problem.loop.model.gravity if plant.gravity is None else plant.gravity
    for i in range(3):
        _compare(
            f"gravity {i}",
            found.plants[0]["gravity"][i],
            lambda h, i=i: problem.value(gravity=gravity + h * np.eye(3)[i]),
            1e-4,
            noise,
        )
    if np.isfinite(plant.mount_stiffness):
        for name in ("mount_stiffness", "mount_damping", "mount_inertia"):
            value = getattr(plant, name)
            _compare(
                name,
                float(found.plants[0][name]),
                lambda h, n=name, v=value: problem.value(**{n: v + h}),
                1e-5 * value,
                noise,
            )


@pytest.mark.thorough
@pytest.mark.parametrize(
    "kind", [k if k in FAST else pytest.param(k, marks=pytest.mark.slow) for k in PLANTS]
)
def test_gradient_of_a_branched_arm(kind: str) -> None:
    _check_all(_problem("tree", PLANTS[kind]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rich", "mount"])
def test_gradient_of_a_whole_arm(kind: str) -> None:
    _check_all(_problem("panda", PLANTS[kind]))


@pytest.mark.thorough
def test_gradient_of_a_single_slide() -> None:
    _check_all(_problem("slide", replace(RICH, payload=None)))


def test_gradient_of_a_servo_on_a_voltage() -> None:
    """Dead band, integral and back-EMF, thinking at every second step."""
    servo = controller_from(
        {
            "type": "voltage_servo", "joints": ["slide"], "proportional": [300.0], "integral": [400.0],
            "derivative": [2.0], "dead_band": [0.0005], "voltage_limit": [1000.0], "torque_constant": [0.02],
            "resistance": [2.0], "gear_ratio": [60.0], "period_s": 0.002, "armature": [0.3],
        }
    )  # fmt: skip
    plant = PlantParameters(dead_band=3e-4, back_emf=0.4, viscous=0.5, actuator_gain=0.05)
    _check_all(_problem("slide", plant, servo, substeps=2))


def test_gradient_of_a_law_that_damps_a_late_velocity() -> None:
    """A driver's low-pass between reading and law, also where an encoder's error scales the reading."""
    (joint,) = ARMS["slide"][0].joints
    law = DriveLaw(velocity_lag=0.0025)
    servo = ArmController(
        (joint,), np.array([3000.0]), np.array([150.0]), 0.001, armature=np.array([0.3]), law=law
    )
    plant = PlantParameters(encoder_amplitude=0.002, encoder_phase=0.3, damping_scale=0.9, viscous=0.5)
    _check_all(_problem("slide", plant, servo, substeps=2))


@pytest.mark.thorough
def test_gradient_with_substeps_and_late_records() -> None:
    _check_all(_problem("slide", replace(RICH, payload=None), substeps=3, efforts="end"))


def test_adjoint_and_differences_agree_on_a_jacobian() -> None:
    problem = _problem("panda", RICH)
    wrt = [
        ("coulomb", 3), ("payload", 0), ("inertial_delta", (2, 4)), ("gravity", 2), ("encoder_offset", 1),
        ("command_delay", 2), ("start_position", 1), ("start_velocity", 5),
    ]  # fmt: skip
    found = jacobian(problem.loop, problem.command, problem.start, problem.speed, RICH, DURATION, wrt)
    for i, (name, place) in enumerate(wrt):
        channels = (found.position[i], found.velocity[i], found.effort[i], found.commanded_effort[i])
        sum_ = _functional(problem.weights, Rollouts(found.rollouts.time, *(c[None] for c in channels)))[0]
        source = problem.gradient.plants[0].get(name)
        wanted = getattr(problem.gradient, name)[0][place] if source is None else source[place]
        assert sum_ == pytest.approx(wanted, rel=1e-4, abs=1e-6), name


def test_gradients_of_plants_are_their_own() -> None:
    about, start = ARMS["tree"]
    loop = ClosedLoop(LoopModel(about))
    command = swing(start, DURATION, 0.1, 3.0)
    plants = [replace(RICH, coulomb=level) for level in (0.1, 0.5)]

    def loss(run: Rollouts) -> tuple[np.ndarray, Rollouts]:
        zero = np.zeros_like(run.position)
        return (run.position**2).sum((1, 2)), Rollouts(run.time, 2 * run.position, zero, zero, zero)

    both = gradient(loop, command, start, np.zeros(4), plants, DURATION, loss)
    alone = gradient(loop, command, start, np.zeros(4), plants[1:], DURATION, loss)
    np.testing.assert_allclose(both.plants[1]["coulomb"], alone.plants[0]["coulomb"], rtol=1e-9)
    np.testing.assert_allclose(both.value[1:], alone.value)
    assert both.command.position is not None and alone.command.position is not None
    assert not np.allclose(both.command.position, alone.command.position)


def test_clipping_stops_the_gradient() -> None:
    arm = description(ARMS["slide"][0].urdf or "", ("slide",), 200.0, 0.0, effort_limit=np.array([1.0]))
    loop = ClosedLoop(LoopModel(arm))
    command = JointSignal(np.array([0.0]), np.array([[1.0]]))

    def loss(run: Rollouts) -> tuple[np.ndarray, Rollouts]:
        zero, one = np.zeros_like(run.position), np.zeros_like(run.position)
        one[:, -1] = 1.0
        return run.position[:, -1, 0], Rollouts(run.time, one, zero, zero, zero)

    found = gradient(loop, command, np.zeros(1), np.zeros(1), [PlantParameters()], 0.05, loss)
    assert found.command.position is not None
    assert found.command.position[0, 0] == 0.0
    assert found.plants[0]["actuator_gain"][0] != 0.0


def test_a_history_too_large_for_memory_is_refused() -> None:
    about, start = ARMS["panda"]
    with pytest.raises(InputError, match="GB"):
        gradient(
            ClosedLoop(LoopModel(about)),
            swing(start, 0.1),
            start,
            np.zeros(7),
            [PlantParameters()] * 900,
            10.0,
            lambda r: (r.time, r),
        )
