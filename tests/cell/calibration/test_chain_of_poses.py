"""Two fixed poses are found again from synthetic pairs, and what cannot be solved is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.cell.calibration.chain_of_poses import PosePairs, influence, solve_chain
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, SolveError

OUTER = Pose.from_rpy(np.array([0.9, -0.1, 0.05]), (0.02, -0.01, 3.1))
INNER = Pose.from_rpy(np.array([0.05, -0.03, 0.08]), (0.1, -0.2, 1.6))
NOISE_M, NOISE_RAD = 0.5e-3, np.deg2rad(0.1)


def made_pairs(count: int, seed: int, noise: float = 1.0, tilt: float = 0.5) -> PosePairs:
    """Flange poses about a working point; `tilt` scales the rotation about all axes but one."""
    random = np.random.default_rng(seed)
    moving, measured = [], []
    for _ in range(count):
        turn = Rotation.from_rotvec(random.uniform(-1, 1, 3) * np.array([tilt, tilt, 0.8]))
        turn = Rotation.from_euler("x", np.pi) * turn
        flange = Pose(np.array([0.5, 0.0, 0.4]) + random.uniform(-0.15, 0.15, 3), turn.as_quat())
        exact = OUTER @ flange @ INNER
        shaken = Rotation.from_quat(exact.quat_xyzw) * Rotation.from_rotvec(
            noise * NOISE_RAD * random.standard_normal(3)
        )
        shift = noise * NOISE_M * random.standard_normal(3)
        moving.append(flange)
        measured.append(Pose(exact.position + shift, shaken.as_quat()))
    return PosePairs(tuple(moving), tuple(measured))


def test_exact_pairs_give_the_poses() -> None:
    solution = solve_chain(made_pairs(8, seed=0, noise=0.0))
    assert np.allclose(solution.inner.position, INNER.position, atol=1e-7)
    assert np.allclose(solution.outer.position, OUTER.position, atol=1e-7)
    assert solution.inner.angle_to(INNER) < 1e-7 and solution.outer.angle_to(OUTER) < 1e-7


@pytest.mark.thorough
@pytest.mark.parametrize("count", [8, 25])
def test_noise_averages_out_and_pairs_left_out_tell_what_is_left(count: int) -> None:
    """Errors of 60 calibrations, in units of their own standard deviations: 180 coordinates, 1 +- 0.053."""
    ratios = []
    for seed in range(60):
        pairs = made_pairs(count, seed)
        solution = solve_chain(pairs)
        assert np.linalg.norm(solution.inner.position - INNER.position) < 2.5e-3
        assert solution.inner.angle_to(INNER) < np.deg2rad(0.4)
        _, moved = influence(pairs, solution)
        deviation = np.sqrt(np.diag(moved.T @ moved))
        ratios.append((solution.inner.position - INNER.position) / deviation[:3])
    assert 0.84 < float(np.sqrt(np.mean(np.square(ratios)))) < 1.16


def test_influence_is_what_leaving_a_pair_out_does() -> None:
    pairs = made_pairs(12, seed=3)
    solution = solve_chain(pairs)
    outer, inner = influence(pairs, solution)
    for n in (0, 7):
        kept = [k for k in range(12) if k != n]
        others = PosePairs(tuple(pairs.moving[k] for k in kept), tuple(pairs.measured[k] for k in kept))
        again = solve_chain(others)
        for moved, before, after in (
            (outer, solution.outer, again.outer),
            (inner, solution.inner, again.inner),
        ):
            assert np.allclose(np.abs(after.position - before.position), np.abs(moved[n, :3]), atol=2e-6)


def test_rotation_about_one_axis_is_refused() -> None:
    with pytest.raises(InputError, match=r"second axis, needed 10.*two axes"):
        made_pairs(20, seed=0, tilt=0.02)


def test_few_or_unequal_pairs_are_refused() -> None:
    with pytest.raises(InputError, match="pairs of poses: 5, needed 6"):
        made_pairs(5, seed=0)
    pairs = made_pairs(8, seed=0)
    with pytest.raises(InputError, match="8 moving poses for 7"):
        PosePairs(pairs.moving, pairs.measured[:-1])


@pytest.mark.parametrize("what", ["inverted", "millimetres", "shuffled"])
def test_pairs_that_contradict_each_other_are_refused(what: str) -> None:
    pairs = made_pairs(20, seed=0)
    moving = {
        "inverted": [pose.inverse() for pose in pairs.moving],
        "millimetres": [Pose(1e3 * pose.position, pose.quat_xyzw) for pose in pairs.moving],
        "shuffled": [pairs.moving[(3 * k) % 20] for k in range(20)],
    }[what]
    with pytest.raises(SolveError, match=r"contradict.*pair \d+.*metres"):
        solve_chain(PosePairs(tuple(moving), pairs.measured))
