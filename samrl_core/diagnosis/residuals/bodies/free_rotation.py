"""How a body turns on which no torque acts (Euler's equations), and what its start can do to that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

ROUNDS = 6
STEP = 1e-4  # of finite differences [rad], [rad/s]
FINEST_S = 0.01  # of the integration


@dataclass(frozen=True, eq=False)
class FreeRotation:
    """The nominal rotation that comes closest to a measured one.

    Attributes:
        residual: (n, 3) [rad] rotation vectors, in the track's frame, by which the measured is ahead.
        start: (6, n, 3) what the start's orientation and angular velocity can do to it.
        inertia: (2, n, 3) per relative error of the first two moments of inertia.
        spin: (n, 3) angular velocity in the track's frame [rad/s].
    """

    residual: np.ndarray
    start: np.ndarray
    inertia: np.ndarray
    spin: np.ndarray


def free_rotation(time: np.ndarray, measured: np.ndarray, gyration: np.ndarray) -> FreeRotation:
    """Fit the start of a free rotation to matrices (n, 3, 3) at times (n,).

    `gyration` (3,): moments of inertia over mass, along the tracked frame's axes. Gauss-Newton.
    """
    first = Rotation.from_matrix(measured[0])
    spin = _first_guess(time, measured)
    x = np.zeros(6)
    for _ in range(ROUNDS):
        nominal, _, jacobian = _with_derivatives(time, first, spin, gyration)
        residual = _between(measured, nominal)
        left = residual.reshape(-1)
        weight = 1.0 / (1.0 + np.abs(left) / (3.0 * max(float(np.median(np.abs(left))), 1e-6)))
        design = jacobian.reshape(6, -1).T
        x = np.linalg.lstsq(design * weight[:, None], left * weight, rcond=None)[0]
        first, spin = Rotation.from_rotvec(x[:3]) * first, spin + x[3:]
        if float(np.max(np.abs(x))) < 1e-8:
            break
    nominal, omega, jacobian = _with_derivatives(time, first, spin, gyration)
    changed = []
    for k in range(2):
        other = gyration.copy()
        other[k] *= 1.0 + 1e-3
        moved, _ = _integrated(time, first.as_matrix()[None], spin[None], other)
        changed.append(_between(moved[0], nominal) / 1e-3)
    world = np.einsum("nij,nj->ni", nominal, omega)
    return FreeRotation(_between(measured, nominal), jacobian, np.stack(changed), world)


def _first_guess(time: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Angular velocity (3,) at the start in the body's frame [rad/s], by the first steps."""
    count = min(len(time) - 1, max(3, len(time) // 5))
    steps = Rotation.from_matrix(np.swapaxes(measured[:count], 1, 2) @ measured[1 : count + 1]).as_rotvec()
    return np.median(steps / np.diff(time[: count + 1])[:, None], axis=0)


def _with_derivatives(
    time: np.ndarray, first: Rotation, spin: np.ndarray, gyration: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices (n, 3, 3), angular velocities (n, 3) in the body, derivatives (6, n, 3) by the start."""
    starts = [first, *(Rotation.from_rotvec(STEP * e) * first for e in np.eye(3)), first, first, first]
    spins = np.concatenate([np.tile(spin, (4, 1)), spin + STEP * np.eye(3)])
    made, omega = _integrated(time, np.stack([s.as_matrix() for s in starts]), spins, gyration)
    return made[0], omega[0], np.stack([_between(m, made[0]) for m in made[1:]]) / STEP


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation vectors (n, 3) that lead from b to a, both (n, 3, 3)."""
    return Rotation.from_matrix(a @ np.swapaxes(b, 1, 2)).as_rotvec()


def _integrated(
    time: np.ndarray, first: np.ndarray, spin: np.ndarray, gyration: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (K, n, 3, 3) and angular velocities (K, n, 3) in the body, for K starts.

    Classical Runge-Kutta on the angular velocity, exponentials of its mean on the rotation.
    """
    since = time - time[0]
    if float(np.ptp(gyration)) < 1e-9 * float(np.max(gyration)):
        turns = Rotation.from_rotvec((since[None, :, None] * spin[:, None]).reshape(-1, 3)).as_matrix()
        made = first[:, None] @ turns.reshape(len(spin), len(time), 3, 3)
        return made, np.broadcast_to(spin[:, None], (*made.shape[:2], 3))

    # (I w) x w / I, component by component: the next axis times the one after.
    after, last = [1, 2, 0], [2, 0, 1]
    ratio = (gyration[after] - gyration[last]) / gyration

    def rate(w: np.ndarray) -> np.ndarray:
        return ratio * w[:, after] * w[:, last]

    parts = np.maximum(1, np.ceil(np.diff(time) / FINEST_S)).astype(int)
    w, speeds, means, steps = spin, [spin], [], np.repeat(np.diff(time) / parts, parts)
    for h in steps:
        k1 = rate(w)
        k2 = rate(w + 0.5 * h * k1)
        k3 = rate(w + 0.5 * h * k2)
        k4 = rate(w + h * k3)
        middle = w + h * (5.0 * k1 + 4.0 * k2 + 4.0 * k3 - k4) / 24.0  # at half the step, third order
        new = w + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
        turned = (new - w)[:, after] * w[:, last] - (new - w)[:, last] * w[:, after]
        means.append(h * ((w + 4.0 * middle + new) / 6.0 - h * turned / 12.0))  # Magnus, fourth order
        w = new
        speeds.append(w)
    turns = Rotation.from_rotvec(np.concatenate(means)).as_matrix().reshape(len(means), *first.shape)
    made = [first]
    for turn in turns:
        made.append(made[-1] @ turn)
    at = np.concatenate([[0], np.cumsum(parts)])
    return np.stack(made, axis=1)[:, at], np.stack(speeds, axis=1)[:, at]
