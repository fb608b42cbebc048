"""Joint positions for a flange pose: damped least squares with a null-space pull.

    dq = J^+ e + (1 - J^+ J) k (q0 - q),   J^+ = J' (J J' + l 1)^-1,   l = c |e|^2

(Nakamura and Hanafusa, "Inverse kinematic solutions with singularity robustness for robot manipulator
control", 1986; damping by the error after Sugihara, "Solvability-unconcerned inverse kinematics by the
Levenberg-Marquardt method", 2011; redundancy term of Liegeois 1977.) A joint that a step would push
through its limit is held there, and the others take its share.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, ReachError

_MAX_STEP = 0.3  # per iteration [rad]; the linear model of e is good to a few degrees
_PULL = 0.05  # k above at large errors; slow, so that a line of waypoints does not swing the elbow
_PULL_FADES = 0.1  # error below which k falls with it, so that the pull does not keep e from converging
_PATIENCE = 25  # iterations in which the error must fall by a tenth, else the pose is given up
_RIDGE = 1e-9  # smallest l, for exact singularities


def solve_ik(
    arm: ArmModel | RobotSpec,
    flange_in_base: Pose,
    seed: np.ndarray,
    *,
    q0: np.ndarray | None = None,
    margin_rad: float = 0.05,
    iterations: int = 200,
    tolerance: float = 1e-5,
    damping: float = 0.05,
) -> np.ndarray:
    """Joint positions (J,) [rad] that put the flange there, near `seed`; deterministic.

    Args:
        arm: kinematic model; a spec is read anew on every call, which takes longer than solving.
        flange_in_base: wanted flange pose in the arm's base link.
        seed: start (J,) [rad]; clipped into the range.
        q0: posture that the redundancy tends to (J,) [rad]; the arm's home if None.
        margin_rad: distance kept from every joint limit [rad].
        iterations: most steps taken.
        tolerance: on the norm of position [m] and rotation vector [rad] error together.
        damping: c above.

    Raises:
        ReachError: not within `tolerance` after `iterations`, with what is left.
        InputError: seed or q0 of the wrong length or not finite, or a margin wider than a joint's range.
    """
    model = _model_of(arm)
    q, residual = _iterate(model, flange_in_base, seed, q0, margin_rad, iterations, tolerance, damping)
    if _norm(residual) > tolerance:
        raise ReachError(_explain(model.spec, flange_in_base, q, residual, margin_rad, tolerance))
    return q


def _iterate(
    model: ArmModel,
    target: Pose,
    seed: np.ndarray,
    q0: np.ndarray | None,
    margin_rad: float,
    iterations: int,
    tolerance: float,
    damping: float,
) -> tuple[np.ndarray, np.ndarray]:
    limits = model.spec.limits
    lower, upper = limits.lower + margin_rad, limits.upper - margin_rad
    if (lower >= upper).any():
        raise InputError(
            f"margin of {margin_rad} rad leaves a joint of '{model.spec.name}' no range; reduce it"
        )
    rest = np.clip(_joints(model.spec, "q0", model.spec.home if q0 is None else q0), lower, upper)
    q = np.clip(_joints(model.spec, "seed", seed), lower, upper)
    wanted_position, wanted_rotation = target.position, target.rotation
    best, best_error = q, np.full(6, np.inf)
    checkpoint = np.inf
    for k in range(iterations + 1):
        position, rotation, jacobian = model.flange_and_jacobian(q)
        # Difference of rotations as a rotation vector in base axes, to match the Jacobian's rows.
        turn = rotation @ pin.log3(rotation.T @ wanted_rotation)
        error = np.concatenate([wanted_position - position, turn])
        if _norm(error) < _norm(best_error):
            best, best_error = q, error
        if _norm(error) <= tolerance:
            break
        if k % _PATIENCE == 0:
            if _norm(best_error) > 0.9 * checkpoint:
                break
            checkpoint = _norm(best_error)
        pull = _PULL * min(1.0, _norm(error) / _PULL_FADES) * (rest - q)
        step = _step(q, error, jacobian, pull, lower, upper, damping * float(error @ error) + _RIDGE)
        q = np.clip(q + step * min(1.0, _MAX_STEP / max(float(np.abs(step).max()), 1e-12)), lower, upper)
    return best, best_error


def _step(
    q: np.ndarray,
    error: np.ndarray,
    jacobian: np.ndarray,
    pull: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    damping: float,
) -> np.ndarray:
    free = np.ones(len(q), dtype=bool)
    while True:
        j = jacobian * free
        solved = np.linalg.solve(j @ j.T + damping * np.eye(6), np.column_stack([error, j]))
        step = free * (j.T @ (solved[:, 0] - solved[:, 1:] @ pull) + pull)
        blocked = free & (((q <= lower) & (step < 0.0)) | ((q >= upper) & (step > 0.0)))
        if not blocked.any():
            return step
        free &= ~blocked


def _model_of(arm: ArmModel | RobotSpec) -> ArmModel:
    return arm if isinstance(arm, ArmModel) else ArmModel(arm, Pose.identity(), None)


def _joints(spec: RobotSpec, name: str, values: np.ndarray) -> np.ndarray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (len(spec.joint_names),) or not np.isfinite(array).all():
        raise InputError(f"{name} {array} for '{spec.name}' must be {len(spec.joint_names)} finite numbers")
    return array


def _norm(error: np.ndarray) -> float:
    return float(np.sqrt(error @ error))


def _explain(
    spec: RobotSpec,
    target: Pose,
    q: np.ndarray,
    error: np.ndarray,
    margin_rad: float,
    tolerance: float,
) -> str:
    near = np.minimum(q - spec.limits.lower, spec.limits.upper - q) < margin_rad + 1e-6
    at_limit = [name for name, at in zip(spec.joint_names, near, strict=True) if at]
    return (
        f"'{spec.name}' does not reach {spec.flange} at {np.round(target.position, 4).tolist()} m, "
        f"quaternion {np.round(target.quat_xyzw, 4).tolist()}: from this seed {1e3 * _norm(error[:3]):.2f}"
        f" mm and {_norm(error[3:]):.4f} rad are left (limit {tolerance:g} together), joints at their limit: "
        f"{at_limit or 'none'}; choose a nearer pose, another roll, or another seed"
    )
