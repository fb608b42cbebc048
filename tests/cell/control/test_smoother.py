"""Jerk-limited motion: limits by finite differences, continuity, stops, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.control.smoother import JointSmoother
from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.robots.rizon.spec import RIZON4
from samrl_core.common.errors import InputError, LimitError

LIMITS = PANDA.limits
PERIOD = 0.004


def run(smoother: JointSmoother, steps: int = 5000) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Steps until done."""
    out = []
    for _ in range(steps):
        out.append(smoother.step())
        if smoother.done:
            return out
    raise AssertionError(f"not done after {steps} steps")


def at_home(**options: float) -> JointSmoother:
    smoother = JointSmoother(LIMITS, PERIOD, **options)
    smoother.reset(PANDA.home)
    return smoother


@pytest.mark.parametrize("spec", [PANDA, RIZON4], ids=["panda", "rizon"])
@pytest.mark.parametrize(("v", "a", "j"), [(1.0, 1.0, 1.0), (0.4, 0.3, 0.2)])
def test_random_target_switching_stays_within_every_limit(spec, v: float, a: float, j: float) -> None:
    limits, rng = spec.limits, np.random.default_rng(5)
    smoother = JointSmoother(limits, PERIOD, v, a, j)
    smoother.reset(spec.home)
    states = [(spec.home, np.zeros(7), np.zeros(7))]
    for _ in range(60):
        if rng.random() < 0.15:
            smoother.stop()
        else:  # half of the targets exactly on limits, where overshoot would show
            target = rng.uniform(limits.lower, limits.upper)
            on_limit = rng.random(7) < 0.5
            target = np.where(on_limit, rng.choice([limits.lower, limits.upper]), target)
            smoother.set_waypoints([target])
        states += [smoother.step() for _ in range(int(rng.integers(1, 80)))]
    q, dq, ddq = (np.array(x) for x in zip(*states, strict=True))
    assert np.abs(dq).max(axis=0).max() > 0.1
    assert (np.abs(dq) <= v * limits.velocity * (1 + 1e-6)).all()
    assert (np.abs(ddq) <= a * limits.acceleration * (1 + 1e-6)).all()
    assert (q >= limits.lower - 1e-6).all() and (q <= limits.upper + 1e-6).all()
    # Finite differences: what is claimed is also what happens.
    assert (np.abs(np.diff(q, axis=0)) / PERIOD <= v * limits.velocity * (1 + 1e-6)).all()
    assert (np.abs(np.diff(dq, axis=0)) / PERIOD <= a * limits.acceleration * (1 + 1e-6)).all()
    assert (np.abs(np.diff(ddq, axis=0)) / PERIOD <= j * limits.jerk * (1 + 1e-6)).all()
    assert (
        np.abs(np.diff(q, axis=0) / PERIOD - 0.5 * (dq[1:] + dq[:-1])).max()
        < limits.acceleration.max() * PERIOD
    )


def test_reaches_the_target_at_rest_with_all_joints_together() -> None:
    smoother = at_home()
    target = PANDA.home + np.array([0.5, 0.1, -0.2, 0.05, 0.3, -0.1, 0.02])
    smoother.set_waypoints([target])
    assert not smoother.done
    states = run(smoother)
    np.testing.assert_allclose(states[-1][0], target, atol=1e-9)
    assert not states[-1][1].any() and not states[-1][2].any()
    moving = np.abs(states[-3][0] - target) > 0
    assert moving.all()  # synchronised: none arrived early
    np.testing.assert_array_equal(smoother.step()[0], states[-1][0])


@pytest.mark.parametrize("spec", [PANDA, RIZON4], ids=["panda", "rizon"])
def test_a_motion_from_rest_to_rest_stays_on_the_straight_line(spec) -> None:
    """Views are found clear of the other arm along that line."""
    limits, rng = spec.limits, np.random.default_rng(5)
    smoother = JointSmoother(limits, PERIOD)
    for _ in range(20):
        start, target = (
            limits.lower + rng.uniform(0.2, 0.8, 7) * (limits.upper - limits.lower) for _ in "ab"
        )
        target[3] = start[3]  # a joint that has nowhere to go
        smoother.reset(start)
        smoother.set_waypoints([target])
        q = np.array([state[0] for state in run(smoother)])
        way = target - start
        along = (q - start) @ way / (way @ way)
        np.testing.assert_allclose(q, start + along[:, None] * way, atol=1e-6)


def test_starts_done_and_stands_still() -> None:
    smoother = at_home()
    assert smoother.done
    q, dq, ddq = smoother.step()
    np.testing.assert_array_equal(q, PANDA.home)
    assert not dq.any() and not ddq.any()


def test_waypoints_are_passed_in_order_within_the_blend() -> None:
    rng = np.random.default_rng(1)
    waypoints = [PANDA.home + rng.uniform(-0.2, 0.2, 7) for _ in range(4)]
    smoother = at_home(blend_rad=0.01)
    smoother.set_waypoints(waypoints)
    q = np.array([s[0] for s in run(smoother)])
    nearest = [np.abs(q - w).max(axis=1) for w in waypoints]
    assert all(d.min() < 0.01 for d in nearest)
    assert list(np.argsort([int(np.argmin(d)) for d in nearest])) == [0, 1, 2, 3]


def test_no_blend_stops_at_each_waypoint() -> None:
    middle = PANDA.home + 0.1
    smoother = at_home(blend_rad=0.0)
    smoother.set_waypoints([middle, PANDA.home + 0.2])
    states = run(smoother)
    passing = min(states, key=lambda s: float(np.abs(s[0] - middle).max()))
    assert np.abs(passing[1]).max() < 0.1  # at most one period's acceleration away from rest


def test_blend_runs_through_closely_spaced_waypoints() -> None:
    points = [PANDA.home + 0.005 * k for k in range(1, 41)]
    blended, stopping = at_home(blend_rad=0.02), at_home(blend_rad=0.0)
    blended.set_waypoints(points)
    stopping.set_waypoints(points)
    assert len(run(blended)) < 0.5 * len(run(stopping))


def test_stop_comes_to_rest_within_the_shortest_time_for_each_joint() -> None:
    smoother = at_home()
    smoother.set_waypoints([PANDA.home + np.array([1.5, 0, 0, 0.02, 0, 0, 0])])
    for _ in range(60):
        q0, v0, _ = smoother.step()
    smoother.stop()
    states = run(smoother)
    assert (
        len(states) * PERIOD
        <= (np.abs(v0) / LIMITS.acceleration + 2 * LIMITS.acceleration / LIMITS.jerk).max() + PERIOD
    )
    assert not states[-1][1].any()
    reach = 0.5 * np.abs(v0) * (np.abs(v0) / LIMITS.acceleration + 2 * LIMITS.acceleration / LIMITS.jerk)
    assert (np.abs(states[-1][0] - q0) <= reach + 1e-4).all()


def test_refused_targets_change_nothing_and_name_the_joint() -> None:
    smoother = JointSmoother(LIMITS, PERIOD, position_margin_rad=0.1, joint_names=PANDA.joint_names)
    smoother.reset(PANDA.home)
    smoother.set_waypoints([PANDA.home + 0.1])
    before = smoother.step()[0]
    bad = PANDA.home.copy()
    bad[1] = LIMITS.upper[1] - 0.05  # inside the limit, within the margin
    with pytest.raises(LimitError, match=r"panda_joint2 at 1\.71.* allowed -1\.66.* to 1\.66.* inside"):
        smoother.set_waypoints([bad])
    bad[1] = np.nan
    with pytest.raises(InputError, match="panda_joint2 is nan"):
        smoother.set_waypoints([PANDA.home, bad])
    with pytest.raises(InputError, match="shape"):
        smoother.set_waypoints([PANDA.home[:6]])
    with pytest.raises(InputError, match="waypoint"):
        smoother.set_waypoints([])
    states = run(smoother)
    assert (states[0][0] > before).all()
    np.testing.assert_allclose(states[-1][0], PANDA.home + 0.1, atol=1e-9)


def test_reset_outside_limits_is_refused() -> None:
    with pytest.raises(LimitError, match=r"joint 4 at 0\.0.*by hand"):
        at_home().reset(np.zeros(7))
    with pytest.raises(InputError, match="joint 1 is inf"):
        at_home().reset(np.full(7, np.inf))


@pytest.mark.parametrize(
    "options",
    [{"velocity_scaling": 0.0}, {"jerk_scaling": 1.1}, {"acceleration_scaling": float("nan")}]
    + [{"position_margin_rad": -0.1}, {"blend_rad": float("nan")}, {"joint_names": ("a",)}],
)
def test_senseless_settings_are_refused(options: dict) -> None:
    with pytest.raises(InputError):
        JointSmoother(LIMITS, PERIOD, **options)
    with pytest.raises(InputError, match="period"):
        JointSmoother(LIMITS, 0.0)


def test_a_short_motion_takes_no_less_than_it_is_told() -> None:
    """A touch of 1 mm in half the time hits twice as hard."""
    near = PANDA.home + 0.002
    fast, slow = at_home(), at_home()
    fast.set_waypoints([near])
    slow.set_waypoints([near], least_s=0.1)
    hasty, told = run(fast), run(slow)
    assert len(hasty) * PERIOD < 0.06 and 0.1 <= len(told) * PERIOD < 0.12
    top = [max(float(np.abs(dq).max()) for _, dq, _ in states) for states in (hasty, told)]
    assert top[1] < 0.7 * top[0]
    slow.set_waypoints([PANDA.home])  # what was told holds for that motion alone
    assert len(run(slow)) * PERIOD < 0.06
    slow.set_waypoints([near], least_s=0.5)
    slow.step()
    slow.stop()
    assert len(run(slow)) * PERIOD < 0.1
    with pytest.raises(InputError, match="least_s is -1"):
        slow.set_waypoints([near], least_s=-1.0)
