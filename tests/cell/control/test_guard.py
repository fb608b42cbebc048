"""States of the guard, its two clocks, interpolation, joining, braking and reset."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.control.guard import CommandGuard, GuardState
from samrl_core.common.errors import InputError, LimitError
from tests.cell.control.arm import AHEAD_MS, HOME, LIMITS, MS, NAMES, Rig, Z, ahead, command, reading, wave


def test_holds_where_it_is_without_commands() -> None:
    rig = Rig()
    rig.position = HOME + 0.3
    first = rig.tick()
    np.testing.assert_array_equal(first.position, HOME + 0.3)
    rig.position = HOME + 0.31  # pushed: the place to hold does not drift with the arm
    np.testing.assert_array_equal(rig.tick().position, HOME + 0.3)
    assert rig.guard.status.state is GuardState.HOLD


def test_no_place_to_hold_is_an_error() -> None:
    guard = CommandGuard(LIMITS, NAMES)
    with pytest.raises(InputError, match="no place to hold"):
        guard.tick(reading(np.full(7, np.nan)), 0.0, 0.0)
    with pytest.raises(InputError, match="clocks"):
        guard.tick(reading(), np.nan, 0.0)


def test_interpolation_is_exact_at_commands_and_for_cubics_between() -> None:
    rig = Rig()
    rig.follow(600)
    for point in rig.points[150:]:
        ms = point.stamp_ns // MS
        expected = wave(ms)
        if ms % 4 == 0:
            for name in ("position", "velocity", "acceleration", "effort"):
                np.testing.assert_array_equal(getattr(point, name), getattr(expected, name))
        # Error of a cubic Hermite: h^4 / 384 times the fourth derivative, 0.2 pi^4 here.
        np.testing.assert_allclose(
            point.position, expected.position, atol=4e-3**4 / 384 * 0.2 * np.pi**4 + 1e-15
        )
        np.testing.assert_allclose(point.velocity, expected.velocity, atol=1e-7)


def test_ticks_slower_than_commands_follow_the_same_curve() -> None:
    guard = CommandGuard(LIMITS, NAMES)
    for t in range(20, 400, 4):
        guard.accept(wave(t), reading(wave(t).position), 0.0, max(0.0, (t - 20) * 1e-3))
        if t % 10 == 0:
            point = guard.tick(reading(), 0.0, (t - 20) * 1e-3)
            np.testing.assert_allclose(point.position, wave(t - 20).position, atol=1e-9)


def test_jitter_within_the_horizon_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    steady, jittery = Rig(), Rig()
    due: list[tuple[int, int]] = []  # arrival, sent [ms]
    for t in range(800):
        if t % 4 == 0:
            due.append((max(t + int(rng.integers(0, AHEAD_MS - 4)), due[-1][0] if due else 0), t))
            steady.accept(ahead(t))
        while due and due[0][0] <= t:
            jittery.accept(ahead(due.pop(0)[1]))
        steady.tick()
        jittery.tick()
    assert jittery.guard.status.late == jittery.guard.status.ignored == 0
    for a, b in zip(steady.points[100:], jittery.points[100:], strict=True):
        np.testing.assert_array_equal(a.position, b.position)


def test_late_commands_slow_down_and_are_joined_without_a_jump() -> None:
    rig = Rig()
    rig.follow(500)
    rig.follow(60, send=False)  # 40 ms beyond the last command, not yet stale
    assert rig.guard.status.state is GuardState.TRACKING
    assert np.abs(rig.points[-1].velocity).max() < np.abs(wave(559).velocity).max()
    rig.follow(1000)
    assert rig.guard.status.state is GuardState.TRACKING
    speed, acceleration = rig.worst()
    assert speed < 0.5 and acceleration < 0.75  # half the limit to brake, a fifth to join, and the wave's own
    np.testing.assert_allclose(rig.points[-1].position, wave(rig.robot_ms - 1).position, atol=1e-9)


def test_start_from_a_set_point_off_the_command_joins_within_limits() -> None:
    rig = Rig()
    rig.position = HOME + 0.04
    rig.tick()
    rig.follow(800)
    speed, acceleration = rig.worst()
    assert speed < 0.6 and acceleration < 0.5
    dq, ddq = (np.array([getattr(p, n) for p in rig.points[30:90]]) for n in ("velocity", "acceleration"))
    assert np.abs(ddq).max() > 0.5  # joining, while the sender still rests
    np.testing.assert_allclose(np.diff(dq, axis=0) / 1e-3, 0.5 * (ddq[1:] + ddq[:-1]), atol=1e-6)
    np.testing.assert_allclose(rig.points[-1].position, wave(rig.robot_ms - 1).position, atol=1e-9)


def test_commands_near_the_limits_are_refused_while_joining() -> None:
    rig = Rig()
    rig.position = HOME + 0.02
    rig.tick()
    rig.accept(command(24))
    fast = np.zeros(7)
    fast[0] = 0.9 * LIMITS.acceleration[0]
    with pytest.raises(LimitError, match="80% while the set point joins"):
        rig.accept(command(28, acceleration=fast))


def test_stale_brakes_to_rest_within_limits_then_holds() -> None:
    rig = Rig()
    rig.follow(600)
    last_accept = rig.robot_ms - 4
    states = []
    for _ in range(800):
        rig.tick()
        states.append(rig.guard.status.state)
    order = [s for k, s in enumerate(states) if k == 0 or s is not states[k - 1]]
    assert order[0] is GuardState.TRACKING and order[-1] is GuardState.HOLD
    stopped_at = 600 + states.index(order[1])
    assert 100 <= stopped_at - last_accept <= 101
    speed, acceleration = rig.worst()
    assert speed < 0.5 and acceleration <= 0.5 + 1e-9
    assert not rig.points[-1].velocity.any()
    np.testing.assert_array_equal(rig.points[-1].position, rig.points[-100].position)
    assert "no command for 0.10" in rig.guard.status.reason


def test_fast_motion_goes_through_braking_and_ignores_commands_there() -> None:
    rig = Rig()
    for t in range(900):
        if t % 4 == 0:
            rig.accept(wave(t + AHEAD_MS, 0.6, 2.0))
        rig.tick()
    while rig.guard.status.state is GuardState.TRACKING:
        rig.tick()
    assert rig.guard.status.state is GuardState.BRAKING and rig.velocity.any()
    since = rig.guard.status.since_s
    assert since == pytest.approx(rig.robot_s - 1e-3)
    before = rig.guard.status.ignored
    assert not rig.accept(command(rig.robot_ms + 20, rig.position))
    assert rig.guard.status.ignored == before + 1
    while rig.guard.status.state is GuardState.BRAKING:
        rig.tick()
    assert rig.guard.status.state is GuardState.HOLD and not rig.velocity.any()
    assert rig.accept(command(rig.robot_ms + 20, rig.position))
    assert rig.guard.status.state is GuardState.TRACKING


@pytest.mark.parametrize("pace", [0.01, 1.0, 20.0])
def test_neither_slow_nor_fast_simulation_trips_the_timeout(pace: float) -> None:
    rig = Rig(pace=pace)
    rig.follow(600)
    assert rig.guard.status.state is GuardState.TRACKING
    slower_clock_ms = 100 * max(1.0, pace)  # both clocks must be past the timeout
    rig.follow(int(slower_clock_ms) - 8, send=False)
    assert rig.guard.status.state is GuardState.TRACKING
    rig.follow(20 + int(0.1 * slower_clock_ms), send=False)
    assert rig.guard.status.state is not GuardState.TRACKING


def test_pause_of_either_clock_alone_is_not_stale() -> None:
    rig = Rig()
    rig.follow(200)
    rig.guard.tick(rig.measured(), rig.steady_s + 100.0, rig.robot_s)
    assert rig.guard.status.state is GuardState.TRACKING


def test_waits_for_command_only_while_tracking_and_short_of_one() -> None:
    guard = CommandGuard(LIMITS, NAMES)
    assert not guard.waits_for_command(0.0, 0.005)
    guard.accept(command(20), reading(), 0.0, 0.0)
    assert not guard.waits_for_command(0.010, 0.005)
    assert guard.waits_for_command(0.016, 0.005)
    guard.estop("asked for")
    assert not guard.waits_for_command(0.016, 0.005)


def test_estop_brakes_latches_and_outranks_a_fault() -> None:
    rig = Rig()
    rig.follow(600)
    rig.guard.fault("torque sensor")
    rig.guard.estop("button")
    rig.guard.estop("second button")
    rig.guard.fault("later")
    assert rig.guard.status.state is GuardState.ESTOP and rig.guard.status.reason == "button"
    assert not rig.accept(ahead(rig.robot_ms))
    rig.follow(400, send=False)
    assert not rig.points[-1].velocity.any()
    assert rig.worst()[1] <= 0.5 + 1e-9
    assert rig.guard.status.state is GuardState.ESTOP


def test_first_fault_is_the_reason() -> None:
    guard = CommandGuard(LIMITS, NAMES)
    guard.fault("first")
    guard.fault("second")
    assert guard.status.reason == "first"


def test_reset_is_refused_while_moving_and_then_holds_where_the_arm_is() -> None:
    rig = Rig()
    rig.follow(600)
    rig.guard.estop("button")
    rig.tick()
    assert "still moves at" in rig.guard.reset(rig.measured())
    assert "set point still brakes" in rig.guard.reset(reading(rig.position))
    assert "still moves at nan" in rig.guard.reset(reading(rig.position, np.full(7, np.nan)))
    assert rig.guard.status.state is GuardState.ESTOP
    rig.follow(400, send=False)
    pushed = rig.position + 0.01
    assert rig.guard.reset(reading(pushed)) == ""
    assert rig.guard.status.state is GuardState.HOLD and rig.guard.status.reason == ""
    held = rig.points[-1].position
    rig.position = pushed
    np.testing.assert_allclose(rig.tick().position, held, atol=1e-5)
    rig.follow(400, send=False)
    np.testing.assert_array_equal(rig.tick().position, pushed)
    assert max(rig.worst()) <= 1.0
    assert rig.accept(command(rig.robot_ms + 20, pushed))


def test_after_a_reset_the_set_point_makes_no_step_whatever_comes_next() -> None:
    for after in ("command", "stop", "nothing"):
        rig = Rig()
        rig.follow(600)
        rig.guard.estop("button")
        rig.follow(400, send=False)
        elsewhere = rig.position + 0.03
        assert rig.guard.reset(reading(elsewhere)) == ""
        for _ in range(400):
            if after == "command" and rig.robot_ms % 4 == 0:
                rig.guard.accept(
                    command(rig.robot_ms + 20, elsewhere), reading(elsewhere), rig.steady_s, rig.robot_s
                )
            if after == "stop" and rig.robot_ms == 1050:
                rig.guard.estop("once more")
            rig.tick()
        assert max(rig.worst()) <= 1.0, after
        if after != "stop":
            np.testing.assert_array_equal(rig.points[-1].position, elsewhere)


def test_reset_far_from_the_set_point_starts_where_the_arm_is() -> None:
    rig = Rig()
    rig.follow(600)
    rig.guard.estop("button")
    rig.follow(400, send=False)
    assert rig.guard.reset(reading(rig.position - 1.0)) == ""
    rig.position = rig.position - 1.0
    expected = rig.position
    np.testing.assert_array_equal(rig.tick().position, expected)


def test_reset_without_a_stop_does_nothing() -> None:
    rig = Rig()
    rig.follow(400)
    assert rig.guard.reset(rig.measured()) == ""
    assert rig.guard.status.state is GuardState.TRACKING


def test_restart_forgets_the_place_but_not_the_counters() -> None:
    rig = Rig()
    rig.follow(200)
    accepted = rig.guard.status.accepted
    rig.guard.restart()
    np.testing.assert_array_equal(rig.guard.tick(reading(HOME + 0.2), 0.0, 0.0).position, HOME + 0.2)
    assert rig.guard.status.accepted == accepted and rig.guard.status.state is GuardState.HOLD


def test_robot_time_going_back_is_a_fault_that_still_comes_to_rest() -> None:
    rig = Rig()
    rig.follow(500)
    rig.robot_ms = 10
    rig.follow(400, send=False)
    assert rig.guard.status.state is GuardState.FAULT and "went back" in rig.guard.status.reason
    assert not rig.points[-1].velocity.any()
    assert rig.worst()[1] <= 0.5 + 1e-9


def test_what_is_tracked_is_not_the_senders_array() -> None:
    rig = Rig()
    place = HOME.copy()
    rig.position = place
    rig.tick()
    place += 1.0
    np.testing.assert_array_equal(rig.guard.tick(reading(), rig.steady_s, rig.robot_s).position, HOME)
    assert Z.sum() == 0.0
