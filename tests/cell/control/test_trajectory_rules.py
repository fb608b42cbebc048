"""One test per rule by which a trajectory is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.control.trajectory_rules import TrajectoryPoint, TrajectoryRules, check_trajectory
from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.common.errors import InputError, LimitError, SamrlError

NAMES = PANDA.joint_names
NOW = 10_000_000_000
Z = np.zeros(7)


def points() -> list[TrajectoryPoint]:
    step = np.linspace(0.01, 0.07, 7)
    return [
        TrajectoryPoint(PANDA.home, Z, Z, 0),
        TrajectoryPoint(PANDA.home + step, step, Z, 500_000_000),
        TrajectoryPoint(PANDA.home + 2 * step, Z, Z, 1_000_000_000),
    ]


def check(
    given: Sequence[TrajectoryPoint], names: Sequence[str] = NAMES, **options: Any
) -> list[TrajectoryPoint]:
    arguments: dict[str, Any] = {
        "expected_names": NAMES,
        "limits": PANDA.limits,
        "now_ns": NOW,
        "stamp_ns": 0,
        "present_position": PANDA.home,
    }
    return check_trajectory(names, given, **(arguments | options))


def test_good_trajectory_passes_unchanged() -> None:
    for before, after in zip(points(), check(points()), strict=True):
        np.testing.assert_array_equal(before.position, after.position)
        np.testing.assert_array_equal(before.velocity, after.velocity)
        assert before.time_from_start_ns == after.time_from_start_ns


def test_permuted_joints_are_put_in_order() -> None:
    order = np.random.default_rng(2).permutation(7)
    shuffled = [
        TrajectoryPoint(p.position[order], p.velocity[order], p.acceleration[order], p.time_from_start_ns)
        for p in points()
    ]
    for before, after in zip(points(), check(shuffled, [NAMES[k] for k in order]), strict=True):
        np.testing.assert_array_equal(before.position, after.position)
        np.testing.assert_array_equal(before.velocity, after.velocity)


def test_velocity_and_acceleration_may_be_left_out() -> None:
    none = np.zeros(0)
    bare = [TrajectoryPoint(p.position, none, none, p.time_from_start_ns) for p in points()]
    assert all(p.velocity.size == 0 for p in check(bare))


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ([], "names no joints"),
        ([*NAMES[:6], "elbow"], r"unknown \['elbow'\], missing \['panda_joint7'\]"),
        (NAMES[:6], r"missing \['panda_joint7'\]"),
        ([*NAMES, NAMES[0]], r"twice \['panda_joint1'\]"),
        ([*NAMES[:6], ""], r"unknown \[''\]"),
    ],
    ids=["empty", "unknown", "missing", "duplicate", "empty name"],
)
def test_joint_names(names: Sequence[str], text: str) -> None:
    with pytest.raises(InputError, match=text):
        check(points(), names)


def test_empty_trajectory() -> None:
    with pytest.raises(InputError, match="no points"):
        check([])


@pytest.mark.parametrize("second", [0, -1])
def test_times_must_strictly_increase(second: int) -> None:
    first, middle, last = points()
    with pytest.raises(InputError, match="strictly increase"):
        check([first, replace(middle, time_from_start_ns=second), last])


def test_first_time_before_the_start() -> None:
    first, *rest = points()
    with pytest.raises(InputError, match="before the start"):
        check([replace(first, time_from_start_ns=-1), *rest])


def test_end_in_the_past() -> None:
    with pytest.raises(InputError, match=r"ended 0\.500 s ago"):
        check(points(), stamp_ns=NOW - 1_500_000_000)
    assert len(check(points(), stamp_ns=NOW - 1_000_000_000)) == 3  # ends now


def test_velocity_at_the_end() -> None:
    given = points()
    given[-1] = replace(given[-1], velocity=np.array([0, 0, 0.1, 0, 0, 0, 0]))
    with pytest.raises(InputError, match=r"panda_joint3 ends at 0\.1000 rad/s.*allow_nonzero"):
        check(given)
    assert len(check(given, rules=TrajectoryRules(allow_nonzero_velocity_at_trajectory_end=True))) == 3


@pytest.mark.parametrize("field", ["position", "velocity", "acceleration"])
def test_wrong_sizes(field: str) -> None:
    given = points()
    given[1] = replace(given[1], **{field: np.zeros(6)})
    with pytest.raises(InputError, match=f"point 1 has 6 values of {field} for 7 joints"):
        check(given)


def test_positions_may_not_be_left_out() -> None:
    with pytest.raises(InputError, match="0 values of position"):
        check([replace(points()[0], position=np.zeros(0))])


@pytest.mark.parametrize("field", ["position", "velocity", "acceleration"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_not_finite(field: str, value: float) -> None:
    given = points()
    bad = getattr(given[1], field).copy()
    bad[4] = value
    given[1] = replace(given[1], **{field: bad})
    with pytest.raises(InputError, match=f"point 1: {field} is not finite"):
        check(given)


def change_joint(value: float) -> Callable[[np.ndarray], np.ndarray]:
    def changed(values: np.ndarray) -> np.ndarray:
        out = values.copy()
        out[5] = value
        return out

    return changed


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("position", PANDA.limits.upper[5] + 1e-6, "point 1: panda_joint6 at 3.75"),
        ("velocity", -2.62, "point 1: panda_joint6 velocity -2.620 rad/s, limit 2.610"),
        ("acceleration", 20.1, "point 1: panda_joint6 acceleration 20.100 rad/s2, limit 20.000"),
    ],
)
def test_limits(field: str, value: float, text: str) -> None:
    given = points()
    given[1] = replace(given[1], **{field: change_joint(value)(getattr(given[1], field))})
    with pytest.raises(LimitError, match=text):
        check(given)


def test_margin_is_kept_from_position_limits() -> None:
    given = [TrajectoryPoint(change_joint(PANDA.limits.upper[5] - 0.05)(PANDA.home), Z, Z, 0)]
    rules = TrajectoryRules(start_jump_rad=10.0)
    assert len(check(given, rules=rules)) == 1
    with pytest.raises(LimitError, match="panda_joint6"):
        check(given, rules=replace(rules, joint_limit_margin=0.1))


def test_points_too_far_apart_for_their_times() -> None:
    given = points()
    given[2] = replace(given[2], time_from_start_ns=given[1].time_from_start_ns + 10_000_000)
    with pytest.raises(LimitError, match=r"points 1 and 2: panda_joint\d moves"):
        check(given)


def test_start_far_from_where_the_arm_is() -> None:
    with pytest.raises(LimitError, match=r"0\.300 rad from where panda_joint\d"):
        check(points(), present_position=PANDA.home + 0.3)


@pytest.mark.parametrize("present", [np.full(7, np.nan), np.zeros(6)])
def test_bad_present_position_cannot_hide_a_jump(present: np.ndarray) -> None:
    with pytest.raises(InputError, match="present position"):
        check(points(), present_position=present)


def test_refusals_are_of_one_family() -> None:
    with pytest.raises(SamrlError):
        check([], [])
