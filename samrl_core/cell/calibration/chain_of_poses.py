"""Two fixed poses from pairs of moving ones: hand-eye and base-to-base calibration are the same equation.

    measured_i = outer @ moving_i @ inner

Hand-eye, camera on the flange and a board that stands still: measured is the camera in the board, moving is
the flange in the base, inner is the camera in the flange, outer is the base in the board.

Base-to-base, with a board on the tool arm's flange: measured is the board in the camera arm's base, moving
is the tool arm's flange in its base, inner is the board in the flange, outer is the tool arm's base in the
camera arm's.

A closed form begins (Li, Wang and Wu 2010, one of those in OpenCV's calibrateRobotWorldHandEye; the Python
wheels of OpenCV 5 bind neither that nor calibrateHandEye). Least squares over both poses end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, SolveError

LEAST_PAIRS = 6
LEAST_TURN = np.deg2rad(10.0)  # spread of the rotations about the second axis, root mean square [rad]
LEVER = 0.25  # [m]: an error of rotation counts as the displacement at this distance
MAX_RESIDUAL_M = 0.02  # root mean square [m]; more is another convention or unit, no noise
MAX_RESIDUAL_RAD = np.deg2rad(3.0)
MAX_CONDITION = 1e6  # of what a pair leaves unexplained; more: it alone determines something


@dataclass(frozen=True, eq=False)
class PosePairs:
    """What was recorded, N pairs.

    Raises:
        InputError: too few pairs, unequal numbers, or motions that turn about one axis only.
    """

    moving: tuple[Pose, ...]
    measured: tuple[Pose, ...]

    def __post_init__(self) -> None:
        if len(self.moving) != len(self.measured):
            raise InputError(f"{len(self.moving)} moving poses for {len(self.measured)} measured ones")
        if len(self.moving) < LEAST_PAIRS:
            raise InputError(f"pairs of poses: {len(self.moving)}, needed {LEAST_PAIRS}; record more")
        for name, poses in (("arm's", self.moving), ("measured", self.measured)):
            turn = turn_about_second_axis(poses)
            if turn < LEAST_TURN:
                raise InputError(
                    f"the {name} poses turn by {np.rad2deg(turn):.1f} deg about their second axis, needed "
                    f"{np.rad2deg(LEAST_TURN):.0f}: about one axis alone the solution is not determined; "
                    "record poses that tilt about two axes"
                )

    def __len__(self) -> int:
        return len(self.moving)

    @cached_property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotations (N, 3, 3) and positions (N, 3) [m] of the moving poses, then of the measured ones."""
        rows = []
        for poses in (self.moving, self.measured):
            rows += [np.array([p.rotation for p in poses]), np.array([p.position for p in poses])]
        return rows[0], rows[1], rows[2], rows[3]


@dataclass(frozen=True, eq=False)
class ChainSolution:
    """The two fixed poses, and how well they fit."""

    outer: Pose
    inner: Pose
    residual_m: np.ndarray  # (N,) distance per pair [m]
    residual_rad: np.ndarray  # (N,) angle per pair [rad]


def turn_about_second_axis(poses: Sequence[Pose]) -> float:
    """Root mean square of the rotations between all pairs, along the second of their principal axes [rad]."""
    turns = np.array([pose.rotation for pose in poses])
    i, j = np.triu_indices(len(poses), 1)
    vectors = Rotation.from_matrix(turns[i].transpose(0, 2, 1) @ turns[j]).as_rotvec()
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(vectors.T @ vectors / len(vectors))[1])))


def solve_chain(pairs: PosePairs) -> ChainSolution:
    """Both fixed poses.

    Raises:
        SolveError: the pairs contradict each other by more than noise.
    """
    solution = refine(pairs, *_closed_form(pairs))
    rms_m = float(np.sqrt(np.mean(solution.residual_m**2)))
    rms_rad = float(np.sqrt(np.mean(solution.residual_rad**2)))
    if not (rms_m <= MAX_RESIDUAL_M and rms_rad <= MAX_RESIDUAL_RAD):
        worst = int(np.argmax(solution.residual_m))
        raise SolveError(
            f"the pairs contradict each other by {1e3 * rms_m:.1f} mm and {np.rad2deg(rms_rad):.2f} deg "
            f"(limits {1e3 * MAX_RESIDUAL_M:.0f} mm and {np.rad2deg(MAX_RESIDUAL_RAD):.0f} deg), most in "
            f"pair {worst}; check that poses are not inverted, are in metres, and belong to the same moment"
        )
    return solution


def refine(pairs: PosePairs, outer: Pose, inner: Pose) -> ChainSolution:
    """Least squares from a start; rotation and translation weigh as displacements at `LEVER`."""
    found = least_squares(
        lambda x: _residuals(pairs, _moved(outer, x[:6]), _moved(inner, x[6:])), np.zeros(12), x_scale="jac"
    )
    outer, inner = _moved(outer, found.x[:6]), _moved(inner, found.x[6:])
    rows = _residuals(pairs, outer, inner).reshape(-1, 6)
    return ChainSolution(
        outer, inner, np.linalg.norm(rows[:, :3], axis=1), np.linalg.norm(rows[:, 3:], axis=1) / LEVER
    )


def influence(pairs: PosePairs, solution: ChainSolution) -> tuple[np.ndarray, np.ndarray]:
    """How far the two poses move when one pair is left out, to first order.

    Their outer products add up to the covariance, whatever the noise within a pair: HC3 (MacKinnon and White
    1985) with pairs as clusters (Bell and McCaffrey 2002). A fit draws its own residuals towards zero by the
    pair's leverage. Drawing pairs with replacement leaves that out and says too little: by a factor of 1.6
    with 8 pairs, 1.13 with 25.

    Returns:
        Displacements (N, 6) of the outer and of the inner pose: position in the parent's axes [m], then
        rotation in the child's axes [rad].

    Raises:
        InputError: without one of the pairs the others determine no solution.
    """
    residual, slope = _linearised(pairs, solution)
    inverse = np.linalg.inv(np.einsum("nij,nik->jk", slope, slope))
    moved = np.empty((len(pairs), 12))
    for n in range(len(pairs)):
        unexplained = np.eye(6) - slope[n] @ inverse @ slope[n].T
        if np.linalg.cond(unexplained) > MAX_CONDITION:
            raise InputError(f"without pair {n} the others determine no solution; record more poses")
        moved[n] = inverse @ slope[n].T @ np.linalg.solve(unexplained, residual[n])
    return moved[:, :6], moved[:, 6:]


def response(pairs: PosePairs, solution: ChainSolution, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far the two poses move with a change of what was measured, to first order.

    Args:
        pairs: as solved.
        solution: theirs.
        change: (N, 6, K) of the measured poses by K causes: position in the parent's axes [m], rotation in
            the child's axes [rad].

    Returns:
        Displacements (6, K) of the outer and of the inner pose.
    """
    _, slope = _linearised(pairs, solution)
    scaled = change * np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])[:, None]
    normal = np.einsum("nij,nik->jk", slope, slope)
    moved = np.linalg.solve(normal, np.einsum("nij,nik->jk", slope, scaled))
    return moved[:6], moved[6:]


def _linearised(pairs: PosePairs, solution: ChainSolution) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (N, 6) at the solution and their slopes (N, 6, 12), by central differences."""
    step = 1e-6

    def residuals(x: np.ndarray) -> np.ndarray:
        return _residuals(pairs, _moved(solution.outer, x[:6]), _moved(solution.inner, x[6:])).reshape(-1, 6)

    columns = [(residuals(step * one) - residuals(-step * one)) / (2.0 * step) for one in np.eye(12)]
    return residuals(np.zeros(12)), np.stack(columns, axis=-1)


def _closed_form(pairs: PosePairs) -> tuple[Pose, Pose]:
    """Outer and inner pose: rotations from the null space of a linear system, then positions.

    outer^T measured = moving inner is linear in both rotations. The solution of unit length is scaled to
    determinant 1, then brought to the nearest rotations.
    """
    one = np.eye(3)
    rows = [
        np.hstack([np.kron(one, a.rotation), -np.kron(m.rotation.T, one)])
        for a, m in zip(pairs.moving, pairs.measured, strict=True)
    ]
    null = np.linalg.svd(np.vstack(rows))[2][-1]
    inner, outer_t = null[:9].reshape(3, 3, order="F"), null[9:].reshape(3, 3, order="F")
    sign = 1.0 if np.linalg.det(inner) > 0 else -1.0
    inner, outer = _nearest_rotation(sign * inner), _nearest_rotation(sign * outer_t).T
    # measured = outer (moving inner_t + moving_t) + outer_t
    left = np.vstack([np.hstack([one, outer @ a.rotation]) for a in pairs.moving])
    right = np.concatenate(
        [m.position - outer @ a.position for a, m in zip(pairs.moving, pairs.measured, strict=True)]
    )
    shift = np.linalg.lstsq(left, right, rcond=None)[0]
    return _pose(outer, shift[:3]), _pose(inner, shift[3:])


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    u, _, vt = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def _pose(rotation: np.ndarray, shift: np.ndarray) -> Pose:
    return Pose(shift, Rotation.from_matrix(rotation).as_quat())


def _residuals(pairs: PosePairs, outer: Pose, inner: Pose) -> np.ndarray:
    """(6 N,): difference of position [m], and of rotation times `LEVER` [m], pair by pair."""
    moving_turn, moving_shift, measured_turn, measured_shift = pairs.arrays
    shift = (moving_turn @ inner.position + moving_shift) @ outer.rotation.T + outer.position
    turn = measured_turn.transpose(0, 2, 1) @ (outer.rotation @ moving_turn @ inner.rotation)
    angle = Rotation.from_matrix(turn).as_rotvec()
    return np.hstack([shift - measured_shift, LEVER * angle]).reshape(-1)


def _moved(pose: Pose, by: np.ndarray) -> Pose:
    turn = Rotation.from_quat(pose.quat_xyzw) * Rotation.from_rotvec(by[3:])
    return Pose(pose.position + by[:3], turn.as_quat())
