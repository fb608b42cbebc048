"""Trajectories keep every limit for any seed, and show what they are for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.excitation import SETS, gains, make_trajectory
from samrl_core.cell.excitation.limits import check_trajectory
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, LimitError

KINDS = tuple(SETS.values())


def torques(arm, command: JointSignal, every: int = 20) -> np.ndarray:
    model = ArmModel(arm.spec, Pose.identity(), arm.payload)
    rows = range(0, len(command), every)
    return np.array(
        [
            model.inverse_dynamics(command.position[k], command.velocity[k], command.acceleration[k])
            for k in rows
        ]
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_inside_every_limit_with_margin_and_at_rest_at_both_ends(arm, kind, seed):
    command = make_trajectory(arm.spec, arm.payload, kind, seed, 8.0, period_s=0.002)
    limits = arm.spec.limits
    assert (command.position > limits.lower + 0.04).all() and (command.position < limits.upper - 0.04).all()
    assert (np.abs(command.velocity) < 0.75 * limits.velocity).all()
    assert (np.abs(command.acceleration) < 0.75 * limits.acceleration).all()
    assert (np.abs(torques(arm, command)) < 0.75 * limits.effort).all()
    assert not command.velocity[[0, -1]].any()


@pytest.mark.parametrize("kind", KINDS)
def test_flange_and_elbow_stay_above_the_table(arm, kind):
    command = make_trajectory(arm.spec, arm.payload, kind, 5, 8.0, period_s=0.002)
    model = ArmModel(arm.spec, Pose.identity(), arm.payload)
    for q in command.position[::50]:
        poses = list(model.link_poses_in_world(q).values())
        assert min(pose.position[2] for pose in poses[3:]) > 0.1
        assert poses[-1].apply(np.array([0.0, 0.0, 0.1634]))[2] > 0.02  # the peg's tip


@pytest.mark.parametrize("kind", KINDS)
def test_quantities_agree_with_each_other(tool_arm, kind):
    command = make_trajectory(tool_arm.spec, tool_arm.payload, kind, 1, 6.0)
    dt = 0.001
    assert np.allclose(command.time, np.arange(6001) * dt)
    middle = 0.5 * (command.velocity[1:] + command.velocity[:-1])
    assert np.abs(np.diff(command.position, axis=0) - dt * middle).max() < 1e-12
    assert np.abs(np.gradient(command.velocity, dt, axis=0) - command.acceleration).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_all_joints_move_both_ways(arm, kind):
    command = make_trajectory(arm.spec, arm.payload, kind, 2, 12.0, period_s=0.002)
    assert (command.velocity.max(axis=0) > 0.02).all() and (command.velocity.min(axis=0) < -0.02).all()
    assert (np.ptp(command.position, axis=0) > 0.05).all()


def holds(command: JointSignal) -> list[tuple[int, int]]:
    still = (np.abs(command.velocity) < 1e-6).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    period = command.time[1] - command.time[0]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if (b - a) * period >= 0.15]


def test_slow_trajectory_rests_at_five_poses_with_different_gravity_loads(arm):
    command = make_trajectory(arm.spec, arm.payload, "slow", 0, 12.0)
    found = holds(command)
    assert len(found) >= 5
    load = torques(arm, command, every=1)[[a + 10 for a, _ in found]]
    spread = np.ptp(load, axis=0)
    assert (spread[1:4] > 0.02 * arm.spec.limits.effort[1:4]).all()  # joints that carry the arm's weight


def test_slow_trajectory_reverses_every_joint_at_several_speeds(arm):
    command = make_trajectory(arm.spec, arm.payload, "slow", 3, 15.0)
    for j in range(command.velocity.shape[1]):
        speed = command.velocity[:, j]
        cruising = np.abs(np.gradient(speed)) < 1e-9
        levels = np.unique(np.round(np.abs(speed[cruising & (np.abs(speed) > 0.01)]), 3))
        assert len(levels) >= 2 and levels.min() >= 0.02 and levels.max() <= 0.301
        signs = np.sign(speed[np.abs(speed) > 0.005])
        assert (np.diff(signs) != 0).sum() >= 4


def test_torque_changes_sign_where_gravity_allows(tool_arm):
    command = make_trajectory(tool_arm.spec, tool_arm.payload, "slow", 0, 15.0)
    effort = torques(tool_arm, command)
    both = (effort.max(axis=0) > 0) & (effort.min(axis=0) < 0)
    assert both[[0, 1, 2]].all() and both.sum() >= 4


def test_multisine_fills_its_band_and_the_chirp_reaches_twenty_hertz(tool_arm):
    command = make_trajectory(tool_arm.spec, tool_arm.payload, "multisine", 0, 16.0)
    power = np.abs(np.fft.rfft(command.velocity, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(command), 0.001)
    for low, high in ((0.1, 0.5), (0.5, 2.0), (2.0, 5.0), (5.0, 10.0), (10.0, 19.0)):
        band = power[(frequency >= low) & (frequency < high)].sum(axis=0)
        assert (band > 1e-5 * power.sum(axis=0)).all(), (low, high)
    assert (power[frequency > 30.0].sum(axis=0) < 1e-5 * power.sum(axis=0)).all()


def test_seeds_differ_and_repeat(tool_arm):
    first, again, other = (
        make_trajectory(tool_arm.spec, tool_arm.payload, "task", s, 4.0) for s in (1, 1, 2)
    )
    assert np.array_equal(first.position, again.position)
    assert not np.allclose(first.position, other.position)


def test_held_out_set_is_played_softer():
    assert gains("task").stiffness < 1.0 and gains("slow").stiffness == gains("multisine").stiffness == 1.0
    with pytest.raises(InputError, match="no set is called 'fast'"):
        gains("fast")


def test_bad_requests_are_refused(tool_arm):
    with pytest.raises(InputError, match="no excitation trajectory is called 'wild'; there are slow"):
        make_trajectory(tool_arm.spec, tool_arm.payload, "wild", 0, 10.0)
    with pytest.raises(InputError, match="lasts 0.5 s"):
        make_trajectory(tool_arm.spec, tool_arm.payload, "task", 0, 0.5)
    with pytest.raises(InputError, match="period is nan"):
        make_trajectory(tool_arm.spec, tool_arm.payload, "task", 0, 10.0, float("nan"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: replace(c, position=c.position + 3.0), "panda_joint1: position"),
        (lambda c: replace(c, velocity=c.velocity * 20.0), "velocity .* allowed .* reduce"),
        (lambda c: replace(c, acceleration=c.acceleration * 50.0), "acceleration .* rad/s2, allowed"),
    ],
)
def test_check_names_joint_value_and_limit(tool_arm, change, message):
    command = make_trajectory(tool_arm.spec, tool_arm.payload, "slow", 0, 6.0, 0.002)
    check_trajectory(tool_arm.spec, tool_arm.payload, command)
    with pytest.raises(LimitError, match=message):
        check_trajectory(tool_arm.spec, tool_arm.payload, change(command))


def test_check_refuses_torque_table_and_a_moving_end(tool_arm):
    spec = tool_arm.spec
    command = make_trajectory(spec, tool_arm.payload, "slow", 0, 6.0, 0.002)
    heavy = replace(tool_arm.payload, mass=30.0)
    with pytest.raises(LimitError, match="predicted torque"):
        check_trajectory(spec, heavy, command)
    low = np.array([0.0, 1.2, 0.0, -1.0, 0.0, 2.0, 0.0])
    still = np.zeros_like(command.position)
    with pytest.raises(LimitError, match="too near to the table"):
        check_trajectory(spec, tool_arm.payload, JointSignal(command.time, still + low, still, still))
    with pytest.raises(InputError, match="at rest"):
        check_trajectory(spec, tool_arm.payload, replace(command, velocity=command.velocity + 0.1))
    with pytest.raises(InputError, match="needs acceleration"):
        check_trajectory(spec, tool_arm.payload, replace(command, acceleration=None))
