"""Friction, delay, springs and the like against what is known of them in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis.simulation.arms import SLIDE, description, of_spec, still, swing

MASS = 2.0  # of the slide [kg]


@pytest.fixture(scope="module")
def panda() -> ClosedLoop:
    return ClosedLoop(LoopModel(of_spec(PANDA)))


def _slide(stiffness: float = 0.0, damping: float = 0.0, **options: Any) -> ClosedLoop:
    return ClosedLoop(LoopModel(description(SLIDE, ("slide",), stiffness, damping), **options))


def _push(force: float) -> JointSignal:
    return JointSignal(np.array([0.0]), np.zeros((1, 1)), np.zeros((1, 1)), effort=np.array([[force]]))


def test_a_free_mass_accelerates_by_force_over_mass() -> None:
    run = _slide().rollout(_push(3.0), np.zeros(1), np.zeros(1), [PlantParameters()], 1.0)
    np.testing.assert_allclose(run.velocity[0, :, 0], 3.0 / MASS * run.time, atol=1e-9)


def test_coulomb_friction_holds_below_its_level_and_not_above() -> None:
    loop = _slide()
    held = loop.rollout(_push(0.99), np.zeros(1), np.zeros(1), [PlantParameters(coulomb=1.0)], 1.0)
    assert abs(held.velocity[0, -1, 0]) < 0.02  # creeps within the smoothing of the sign
    slid = loop.rollout(_push(2.0), np.zeros(1), np.zeros(1), [PlantParameters(coulomb=1.0)], 1.0)
    assert slid.velocity[0, -1, 0] == pytest.approx(0.5, rel=0.01)


def test_coulomb_friction_stops_a_light_joint_without_chatter() -> None:
    """One step of this friction would reverse the speed ten times over if it were explicit."""
    light = SLIDE.replace('mass value="2.0"', 'mass value="0.01"')
    loop = ClosedLoop(LoopModel(description(light, ("slide",), 0.0, 0.0)))
    plant = PlantParameters(coulomb=2.0)
    run = loop.rollout(_push(0.0), np.zeros(1), np.array([1.0]), [plant], 0.05)
    speed = run.velocity[0, :, 0]
    assert speed.min() > -0.01 and abs(speed[-1]) < 1e-3


@pytest.mark.parametrize("joint", range(7))
def test_coulomb_torque_of_a_moving_wrist(panda: ClosedLoop, joint: int) -> None:
    level = np.where(np.arange(7) == joint, 0.3, 0.0)
    run = panda.rollout(
        swing(PANDA.home, 0.5, 0.2, 2.0), PANDA.home, np.zeros(7), [PlantParameters(coulomb=level)], 0.5
    )
    lost = run.commanded_effort[0, :-1, joint] - run.effort[0, :-1, joint]
    speed = run.velocity[0, 1:, joint]
    fast = np.abs(speed) > 0.05
    assert fast.sum() > 100
    np.testing.assert_allclose(lost[fast], 0.3 * np.sign(speed[fast]), atol=1e-3)


def test_viscous_friction_is_proportional_to_speed() -> None:
    run = _slide().rollout(_push(3.0), np.zeros(1), np.zeros(1), [PlantParameters(viscous=2.0)], 10.0)
    assert run.velocity[0, -1, 0] == pytest.approx(1.5, rel=1e-3)


def test_bristle_gives_way_by_force_over_stiffness() -> None:
    plant = PlantParameters(coulomb=3.0, presliding_stiffness=1000.0, viscous=20.0)
    run = _slide().rollout(_push(1.0), np.zeros(1), np.zeros(1), [plant], 2.0)
    # Up to its strength L the bristle's force rises as L (1 - exp(-s0 x / L)); swinging in adds a little.
    still = -3.0 / 1000.0 * np.log(1 - 1.0 / 3.0)
    assert still < run.position[0, -1, 0] < 1.5 * still
    assert abs(run.velocity[0, -1, 0]) < 1e-6


def test_effort_delay_shifts_exactly(panda: ClosedLoop) -> None:
    run = panda.rollout(
        swing(PANDA.home, 0.3), PANDA.home, np.zeros(7), [PlantParameters(effort_delay=0.003)], 0.3
    )
    np.testing.assert_allclose(run.effort[0, 3:], run.commanded_effort[0, :-3], atol=1e-12)


def test_command_delay_shifts_exactly(panda: ClosedLoop) -> None:
    plants = [PlantParameters(), PlantParameters(command_delay=0.005)]
    run = panda.rollout(swing(PANDA.home, 0.3), PANDA.home, np.zeros(7), plants, 0.3)
    np.testing.assert_allclose(run.position[1, 5:], run.position[0, :-5], atol=1e-10)


def test_half_a_period_of_delay_is_the_mean_of_two(panda: ClosedLoop) -> None:
    run = panda.rollout(
        swing(PANDA.home, 0.3), PANDA.home, np.zeros(7), [PlantParameters(effort_delay=0.0015)], 0.3
    )
    mean = (run.commanded_effort[0, 1:-1] + run.commanded_effort[0, :-2]) / 2
    np.testing.assert_allclose(run.effort[0, 2:], mean, atol=1e-12)


def test_lost_packets_hold_the_last_torque_of_all_joints(panda: ClosedLoop) -> None:
    plants = [PlantParameters(hold_probability=0.3, seed=seed) for seed in (1, 1, 2)]
    run = panda.rollout(swing(PANDA.home, 1.0), PANDA.home, np.zeros(7), plants, 1.0)
    held = np.abs(np.diff(run.effort[0], axis=0)) < 1e-13
    lost = held.all(axis=1)
    assert 0.25 < lost.mean() < 0.35
    np.testing.assert_array_equal(lost[100:], held[100:, 3])
    np.testing.assert_array_equal(run.effort[0], run.effort[1])
    assert np.abs(run.effort[0] - run.effort[2]).max() > 1e-3


def test_spring_deflects_by_torque_over_stiffness(panda: ClosedLoop) -> None:
    plant = PlantParameters(joint_stiffness=2000.0, joint_damping=5.0)
    run = panda.rollout(still(PANDA.home), PANDA.home, np.zeros(7), [plant], 1.0)
    link = run.position[0, -1] - run.effort[0, -1] / 2000.0
    np.testing.assert_allclose(panda.model.rigid.gravity(link[None])[0], run.effort[0, -1], atol=1e-3)


def test_a_very_stiff_spring_is_a_rigid_joint(panda: ClosedLoop) -> None:
    plants = [PlantParameters(), PlantParameters(joint_stiffness=1e8)]
    run = panda.rollout(swing(PANDA.home, 0.4), PANDA.home, np.zeros(7), plants, 0.4)
    assert np.abs(run.position[0] - run.position[1]).max() < 1e-5


def test_spring_rings_at_its_natural_frequency() -> None:
    """Free-free motor and sled: omega^2 = K (1 / J + 1 / m)."""
    loop = ClosedLoop(LoopModel(description(SLIDE, ("slide",), 0.0, 0.0, armature=np.array([1.0]))))
    plant = PlantParameters(joint_stiffness=6000.0)
    run = loop.rollout(_push(0.0), np.zeros(1), np.zeros(1), [plant], 1.0)
    assert np.abs(run.velocity).max() < 1e-9  # starts wound up by gravity, so nothing moves
    kick = JointSignal(
        np.array([0.0, 0.005, 0.006]),
        np.zeros((3, 1)),
        np.zeros((3, 1)),
        effort=np.array([[20.0], [20.0], [0.0]]),
    )
    run = loop.rollout(kick, np.zeros(1), np.zeros(1), [plant], 2.0)
    torque = run.effort[0, 100:, 0] - run.effort[0, 100:, 0].mean()
    spectrum = np.abs(np.fft.rfft(torque * np.hanning(len(torque)), 1 << 16))
    peak = np.fft.rfftfreq(1 << 16, 0.001)[spectrum.argmax()]
    assert peak == pytest.approx(np.sqrt(6000.0 * 1.5) / (2 * np.pi), rel=0.02)


def test_backlash_lets_the_motor_move_alone() -> None:
    """Motor and sled collide within the play; between collisions no torque passes."""
    loop = ClosedLoop(
        LoopModel(description(SLIDE, ("slide",), 0.0, 0.0, armature=np.array([0.5]), gravity=(0.0, 0.0, 0.0)))
    )
    plant = PlantParameters(backlash=0.01)
    run = loop.rollout(_push(1.0), np.zeros(1), np.zeros(1), [plant], 0.1)
    # in the middle of its play the motor is alone: 1 N on 0.5 kg until it has gone the half width
    alone = run.time < 0.95 * np.sqrt(2 * 0.01 * 0.5 / 1.0)
    np.testing.assert_allclose(run.velocity[0, alone, 0], 2.0 * run.time[alone], rtol=0.02, atol=1e-4)
    assert np.abs(run.effort[0, alone]).max() < 0.05
    assert np.abs(run.effort[0]).max() > 0.5


def test_efforts_at_the_end_of_their_period_are_one_sample_later() -> None:
    arm = of_spec(PANDA)
    command = swing(PANDA.home, 0.1)
    first, last = (
        ClosedLoop(LoopModel(arm, efforts=where)).rollout(
            command, PANDA.home, np.zeros(7), [PlantParameters()], 0.1
        )
        for where in ("start", "end")
    )
    np.testing.assert_array_equal(last.effort[0, 1:], first.effort[0, :-1])
    np.testing.assert_array_equal(last.commanded_effort[0, 1:], first.commanded_effort[0, :-1])
    np.testing.assert_allclose(
        last.effort[0, 0], ClosedLoop(LoopModel(arm)).model.rigid.gravity(PANDA.home[None])[0], atol=1e-9
    )


def test_records_are_samples_of_the_whole(panda: ClosedLoop) -> None:
    command = swing(PANDA.home, 0.1)
    whole, some = (
        panda.rollout(command, PANDA.home, np.zeros(7), [PlantParameters()], 0.1, record_every=every)
        for every in (1, 4)
    )
    np.testing.assert_array_equal(some.time, whole.time[::4])
    np.testing.assert_array_equal(some.effort, whole.effort[:, ::4])


def test_slow_commands_are_interpolated(panda: ClosedLoop) -> None:
    dense = swing(PANDA.home, 0.2)
    assert dense.position is not None and dense.velocity is not None
    line = np.linspace(0, 0.1, len(dense))[:, None] + PANDA.home
    fast = replace(dense, position=line, velocity=np.full_like(line, 0.5))
    slow = JointSignal(fast.time[::10], line[::10], np.full_like(line, 0.5)[::10])
    runs = [panda.rollout(c, PANDA.home, np.zeros(7), [PlantParameters()], 0.19) for c in (fast, slow)]
    np.testing.assert_allclose(runs[0].position, runs[1].position, atol=1e-12)


def test_a_log_replaces_the_reading(panda: ClosedLoop) -> None:
    command = swing(PANDA.home, 0.1)
    run = panda.rollout(command, PANDA.home, np.zeros(7), [PlantParameters()], 0.1)
    log = JointSignal(run.time, run.position[0], run.velocity[0])
    again = panda.rollout(
        command, PANDA.home, np.zeros(7), [PlantParameters(encoder_offset=0.3)], 0.1, position_log=log
    )
    np.testing.assert_allclose(again.commanded_effort, run.commanded_effort, atol=1e-12)
    np.testing.assert_allclose(again.position, run.position, atol=1e-12)


def test_order_of_plants_and_threads_do_not_matter(panda: ClosedLoop) -> None:
    plants = [PlantParameters(coulomb=0.1 * i, mount_stiffness=np.inf if i % 2 else 3e4) for i in range(5)]
    command = swing(PANDA.home, 0.05)
    run = panda.rollout(command, PANDA.home, np.zeros(7), plants, 0.05)
    spread = ClosedLoop(LoopModel(panda.arm, threads=2)).rollout(
        command, PANDA.home, np.zeros(7), plants[::-1], 0.05
    )
    np.testing.assert_array_equal(run.effort, spread.effort[::-1])
