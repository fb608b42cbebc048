"""Braking, from any state and at any tick rate."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.control.brake import braked
from samrl_core.cell.types.observation import ArmCommand
from tests.cell.control.arm import LIMITS, MS, Z


def brake_to_rest(start: ArmCommand, tick_ns: int, fraction: float) -> list[ArmCommand]:
    points = [start]
    while points[-1].velocity.any():
        points.append(braked(points[-1], points[-1].stamp_ns + tick_ns, LIMITS, fraction))
        assert len(points) < 5000
    return points


@pytest.mark.parametrize("fraction", [0.3, 0.5, 1.0])
def test_random_brakes_stay_within_limits_and_end_at_rest(fraction: float) -> None:
    rng = np.random.default_rng(8)
    for _ in range(12):
        velocity = rng.uniform(-1, 1, 7) * LIMITS.velocity * (rng.random(7) < 0.8)
        room = 0.5 * velocity**2 / LIMITS.acceleration  # shortest stop; some start just there
        low = LIMITS.lower + np.where(velocity < 0, room, 0.0)
        high = LIMITS.upper - np.where(velocity > 0, room, 0.0)
        position = np.where(rng.random(7) < 0.3, np.where(velocity > 0, high, low), rng.uniform(low, high))
        points = brake_to_rest(ArmCommand(0, position, velocity, Z, Z), MS, fraction)
        q = np.array([p.position for p in points])
        dq = np.array([p.velocity for p in points])
        assert (q >= LIMITS.lower - 1e-9).all() and (q <= LIMITS.upper + 1e-9).all()
        assert (np.abs(np.diff(dq, axis=0)) / 1e-3 <= LIMITS.acceleration * (1 + 1e-6)).all()
        assert (np.diff(np.abs(dq), axis=0) <= 1e-12).all()
        assert (dq * velocity >= 0).all()  # never backwards
        # Positions are where the speeds lead: a joint slows down before its limit and is not cut off there.
        assert (
            np.abs(np.diff(q, axis=0) - 5e-4 * (dq[1:] + dq[:-1])).max() < 1.3e-7 * LIMITS.acceleration.max()
        )
        assert len(points) * 1e-3 <= (np.abs(velocity) / (fraction * LIMITS.acceleration)).max() + 2.5e-3


def test_stopping_distance_does_not_depend_on_the_tick() -> None:
    start = ArmCommand(0, 0.5 * (LIMITS.lower + LIMITS.upper), 0.4 * LIMITS.velocity, Z, Z)
    expected = start.position + 0.5 * start.velocity**2 / (0.5 * LIMITS.acceleration)
    for tick_ns in (137_000, MS, 4 * MS, 700 * MS):
        np.testing.assert_allclose(brake_to_rest(start, tick_ns, 0.5)[-1].position, expected, atol=1e-9)


def test_a_joint_beyond_its_limit_stays_but_goes_no_farther() -> None:
    position = 0.5 * (LIMITS.lower + LIMITS.upper)
    position[0] = LIMITS.upper[0] + 0.01
    velocity = Z.copy()
    velocity[0] = 0.1
    points = brake_to_rest(ArmCommand(0, position, velocity, Z, Z), MS, 0.5)
    assert {p.position[0] for p in points} == {position[0]}
