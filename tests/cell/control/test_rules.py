"""Each rule of the guard, at and beyond its limit; a refusal latches and nothing of it reaches the arm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from samrl_core.cell.control.guard import CommandGuard, GuardSettings, GuardState
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.common.errors import InputError, LimitError, SamrlError
from tests.cell.control.arm import HOME, LIMITS, MS, NAMES, Rig, Z, command, reading, wave


def one(joint: int, value: float, base: np.ndarray = Z) -> np.ndarray:
    out = base.copy()
    out[joint] = value
    return out


BAD: dict[str, tuple[Callable[[float], ArmCommand], str]] = {
    "position nan": (lambda t: command(t, one(2, np.nan, HOME)), "position of panda_joint3 is nan"),
    "velocity inf": (lambda t: command(t, velocity=one(0, np.inf)), "velocity of panda_joint1 is inf"),
    "acceleration nan": (lambda t: command(t, acceleration=one(0, np.nan)), "acceleration of panda_joint1"),
    "effort nan": (lambda t: command(t, effort=one(6, -np.inf)), "effort of panda_joint7 is -inf"),
    "too few": (lambda t: command(t, HOME[:6]), "6 values of position for 7 joints"),
    "too many": (lambda t: command(t, velocity=np.zeros(8)), "8 values of velocity"),
    "position limit": (lambda t: command(t, one(5, 3.76, HOME)), r"panda_joint6 to 3\.76.* to 3\.75"),
    "velocity limit": (lambda t: command(t, velocity=one(1, 2.3)), "velocity of panda_joint2 is 2.300"),
    "acceleration limit": (lambda t: command(t, acceleration=one(1, 8.0)), "acceleration of panda_joint2"),
    "torque limit": (
        lambda t: command(t, effort=one(6, 12.1)),
        "feed-forward torque of panda_joint7 is 12.1",
    ),
    "jump": (lambda t: command(t, one(0, 0.6, HOME)), "0.600 rad from its measured position"),
    "foreign clock": (lambda t: command(t + 600), "0.6.* s ahead of robot time"),
    "step": (lambda t: command(t, one(0, 0.01, HOME)), "its velocity limit"),
    "velocity step": (lambda t: command(t, velocity=one(0, 0.3)), "its acceleration limit"),
    "inconsistent": (lambda t: command(t, one(0, 0.002, HOME)), "what its velocities allow"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_command_while_tracking_latches_and_never_reaches_the_arm(name: str) -> None:
    make, text = BAD[name]
    rig = Rig()
    for t in range(20, 40, 4):
        rig.accept(command(t))
    rig.tick()
    with pytest.raises(SamrlError, match=text):
        rig.accept(make(40))
    status = rig.guard.status
    assert status.state is GuardState.FAULT and status.refused == 1
    assert status.reason
    for _ in range(100):
        point = rig.tick()
        np.testing.assert_array_equal(point.position, HOME)
        assert not point.velocity.any() and not point.effort.any()
    assert not rig.accept(command(rig.robot_ms + 20))  # latched
    assert rig.guard.status.state is GuardState.FAULT


@pytest.mark.parametrize("name", [n for n in BAD if n not in ("step", "velocity step", "inconsistent")])
def test_bad_first_command_is_refused(name: str) -> None:
    make, _ = BAD[name]
    rig = Rig()
    with pytest.raises(SamrlError):
        rig.accept(make(20))
    np.testing.assert_array_equal(rig.tick().position, HOME)
    assert rig.guard.status.state is GuardState.FAULT


def test_start_jump_is_tighter_than_a_jump_while_tracking() -> None:
    rig = Rig()
    rig.accept(command(20, HOME + 0.049))
    rig = Rig()
    with pytest.raises(
        LimitError, match=r"0\.051 rad from its measured.*limit 0\.05.*start from the measured"
    ):
        rig.accept(command(20, HOME + 0.051))


def test_start_in_motion_is_refused() -> None:
    with pytest.raises(LimitError, match="start at rest"):
        Rig().accept(command(20, velocity=np.full(7, 1.0)))


def test_nan_measurement_cannot_hide_a_jump() -> None:
    guard = CommandGuard(LIMITS, NAMES)
    with pytest.raises(InputError, match="measured position"):
        guard.accept(command(20, HOME), reading(np.full(7, np.nan)), 0.0, 0.0)
    assert guard.status.state is GuardState.FAULT


def test_motion_that_cannot_stop_before_a_limit_is_refused() -> None:
    near = one(0, LIMITS.upper[0] - 0.05, HOME)
    guard = CommandGuard(LIMITS, NAMES)
    guard.check(command(0, near, one(0, 1.2)), reading(near))  # 1.2^2 / 2 / 15 = 0.048 rad
    with pytest.raises(LimitError, match="panda_joint1 cannot stop before"):
        guard.check(command(0, near, one(0, 1.4)), reading(near))
    guard.check(command(0, near, one(0, -1.4)), reading(near))


def test_margin_is_kept_from_position_limits() -> None:
    near = one(0, LIMITS.upper[0] - 0.05, HOME)
    CommandGuard(LIMITS, NAMES).check(command(0, near), reading(near))
    with pytest.raises(LimitError, match="panda_joint1"):
        CommandGuard(LIMITS, NAMES, GuardSettings(position_margin_rad=0.1)).check(
            command(0, near), reading(near)
        )


def test_old_and_repeated_stamps_are_ignored_and_counted() -> None:
    rig = Rig()
    assert rig.accept(wave(20)) and rig.accept(wave(28))
    assert not rig.accept(wave(24)) and not rig.accept(wave(28))
    assert not rig.accept(command(24, np.full(7, np.nan)))  # never looked at
    status = rig.guard.status
    assert (status.accepted, status.ignored, status.refused, status.late) == (2, 3, 0, 0)
    assert status.state is GuardState.TRACKING


def test_command_after_its_time_of_validity_is_ignored_and_counted() -> None:
    rig = Rig()
    rig.robot_ms = 50
    assert not rig.accept(command(49))
    assert rig.guard.status.late == 1 and rig.guard.status.state is GuardState.HOLD
    assert rig.accept(command(50))


@pytest.mark.parametrize(
    "settings",
    [{"timeout_s": 0.0}, {"timeout_s": np.nan}, {"slack": 0.9}, {"brake_fraction": 0.0}]
    + [{"join_fraction": 1.1}, {"start_jump_rad": -0.1}, {"join_s": np.inf}],
)
def test_senseless_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(settings))):
        GuardSettings(**settings)


@pytest.mark.parametrize(("share", "taken"), [(0.95, True), (1.2, False), (1.5, False)])
def test_the_acceleration_of_what_is_driven_counts_whatever_a_command_says(share: float, taken: bool) -> None:
    rig = Rig()
    for t in (20, 24):
        rig.accept(command(t))
    step = share * LIMITS.acceleration[1] * 0.004**2 / 6 + 1e-6  # at rest at both ends; stamps are rounded
    moved = command(28, one(1, HOME[1] + step, HOME))
    if taken:
        rig.accept(moved)
    else:
        with pytest.raises(LimitError, match="panda_joint2.*what its velocities allow"):
            rig.accept(moved)
    rig.follow(20, send=False)
    assert rig.worst()[1] <= 1.05


def test_names_and_limits_must_fit() -> None:
    with pytest.raises(InputError, match="6 joint names"):
        CommandGuard(LIMITS, NAMES[:6])
    with pytest.raises(InputError, match="timeout_s"):
        CommandGuard(LIMITS, NAMES, timeout_s=-1.0)


def test_random_bad_commands_never_move_the_arm_beyond_its_limits() -> None:
    rng = np.random.default_rng(11)
    for _ in range(40):
        rig = Rig()
        rig.follow(200)
        good = wave(rig.robot_ms + 20)
        scale = 10.0 ** rng.uniform(-4, 2)
        noisy = ArmCommand(
            good.stamp_ns + int(rng.integers(-5, 30)) * MS,
            good.position + scale * rng.standard_normal(7),
            good.velocity + scale * rng.standard_normal(7),
            good.acceleration,
            good.effort,
        )
        try:
            rig.accept(noisy)
        except SamrlError:
            assert rig.guard.status.state is GuardState.FAULT
        rig.follow(60, send=False)
        speed, acceleration = rig.worst()
        assert speed <= 1.05 and acceleration <= 1.2  # rounding of stamps is 0.15 of the limit at 2 rad/s
