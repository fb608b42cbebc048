"""Stacks of rigid transforms (N, 4, 4) and their twists (N, 6): translation first, then rotation.

Errors are left twists in the observer's frame: true = exp(twist) nominal. Formulas: Lynch and Park 2017,
Modern Robotics, section 3.3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from samrl_core.cell.types.pose_recording import PoseTrack

SMOOTH_POSES = 7  # that a cubic is led through
SMOOTH_HZ = 25.0  # of a track, from which on a cubic is its motion over so many poses


def transforms(position: np.ndarray, quat_xyzw: np.ndarray) -> np.ndarray:
    """Homogeneous matrices (N, 4, 4) of positions (N, 3) and quaternions (N, 4)."""
    out = np.zeros((len(position), 4, 4))
    out[:, :3, :3] = Rotation.from_quat(quat_xyzw).as_matrix()
    out[:, :3, 3], out[:, 3, 3] = position, 1.0
    return out


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse rigid transforms."""
    out = np.zeros_like(matrix)
    rotation = np.swapaxes(matrix[..., :3, :3], -1, -2)
    out[..., :3, :3] = rotation
    out[..., :3, 3] = -(rotation @ matrix[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def skew(v: np.ndarray) -> np.ndarray:
    """Cross-product matrices (..., 3, 3) of vectors (..., 3)."""
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def adjoint(matrix: np.ndarray) -> np.ndarray:
    """(..., 6, 6) by which twists of the child frame become those of the parent frame."""
    rotation = matrix[..., :3, :3]
    out = np.zeros((*matrix.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = rotation
    out[..., :3, 3:] = skew(matrix[..., :3, 3]) @ rotation
    return out


def log(matrix: np.ndarray) -> np.ndarray:
    """Twists (N, 6) of rigid transforms (N, 4, 4)."""
    w = Rotation.from_matrix(matrix[:, :3, :3]).as_rotvec()
    angle = np.linalg.norm(w, axis=1)
    w_hat = skew(w)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    factor = (1.0 - 0.5 * safe * np.sin(safe) / np.maximum(1.0 - np.cos(safe), 1e-300)) / safe**2
    factor = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, factor)
    left = np.eye(3) - 0.5 * w_hat + factor[:, None, None] * (w_hat @ w_hat)
    return np.concatenate([(left @ matrix[:, :3, 3:])[..., 0], w], axis=1)


def inverse_jacobian(twist: np.ndarray) -> np.ndarray:
    """(N, 6, 6) by which log(exp(twist) exp(d)) grows with a small d (inverse right Jacobian).

    The series of the adjoint of twists (N, 6), closed by its characteristic polynomial; Bullo and Murray
    1995, Proportional derivative control on the Euclidean group.
    """
    twist = np.atleast_2d(twist)
    angle = np.linalg.norm(twist[:, 3:], axis=1)
    small = angle < 0.05
    safe = np.where(small, 1.0, angle)
    half = 0.5 * safe / np.tan(0.5 * safe)
    alike = 0.5 * (0.5 * safe / np.sin(0.5 * safe)) ** 2
    second = np.where(small, 1.0 / 12.0, (2.0 - 1.5 * half - alike) / safe**2)
    fourth = np.where(small, -1.0 / 720.0, (1.0 - 0.5 * half - alike) / safe**4)
    adjoint_of = np.zeros((len(twist), 6, 6))
    adjoint_of[:, :3, :3] = adjoint_of[:, 3:, 3:] = skew(twist[:, 3:])
    adjoint_of[:, :3, 3:] = skew(twist[:, :3])
    squared = adjoint_of @ adjoint_of
    series = second[:, None, None] * squared + fourth[:, None, None] * (squared @ squared)
    return np.asarray(np.eye(6) + 0.5 * adjoint_of + series)


def exp(twist: np.ndarray) -> np.ndarray:
    """Rigid transforms (N, 4, 4) of twists (N, 6)."""
    twist = np.atleast_2d(twist)
    v, w = twist[:, :3], twist[:, 3:]
    angle = np.linalg.norm(w, axis=1)
    w_hat = skew(w)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    b = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    left = np.eye(3) + a[:, None, None] * w_hat + b[:, None, None] * (w_hat @ w_hat)
    out = np.zeros((len(twist), 4, 4))
    out[:, :3, :3] = Rotation.from_rotvec(w).as_matrix()
    out[:, :3, 3] = (left @ v[..., None])[..., 0]
    out[:, 3, 3] = 1.0
    return out


class Interpolated:
    """A pose track between its stamps: cubic positions, rotations by a cubic spline in their log space.

    Outside of its stamps the first or the last pose holds. Poses taken at rest are not interpolated.
    """

    def __init__(self, track: PoseTrack, timed: bool = True) -> None:
        """Fit the splines; a track of few poses or of poses at rest has none."""
        self._time = track.time
        self._fixed = transforms(track.position, track.quat_xyzw)
        self._smooth = timed and len(track) > 3
        if self._smooth:
            self._position = CubicSpline(track.time, track.position)
            self._rotation = RotationSpline(track.time, Rotation.from_quat(track.quat_xyzw))

    def at(self, time: np.ndarray) -> np.ndarray:
        """Transforms (N, 4, 4) at times (N,) [s]."""
        if not self._smooth:
            nearest = np.abs(np.asarray(time)[:, None] - self._time).argmin(axis=1)
            return self._fixed[nearest]
        time = np.clip(time, self._time[0], self._time[-1])
        out = np.zeros((len(time), 4, 4))
        out[:, :3, :3] = self._rotation(time).as_matrix()
        out[:, :3, 3], out[:, 3, 3] = self._position(time), 1.0
        return out


def smoothed(track: PoseTrack) -> PoseTrack:
    """The track without most of its own noise: each pose by a cubic through it and three on either side.

    Slow tracks (`SMOOTH_HZ`) and poses next to a gap stay as they are: a cubic is no motion over so long.
    """
    count = len(track)
    if count < SMOOTH_POSES or float(np.median(np.diff(track.time))) > 1.0 / SMOOTH_HZ:
        return track
    first = np.clip(np.arange(count) - SMOOTH_POSES // 2, 0, count - SMOOTH_POSES)
    near = first[:, None] + np.arange(SMOOTH_POSES)
    after = track.time[near] - track.time[:, None]
    span = np.ptp(after, axis=1)
    powers = (after / span[:, None])[..., None] ** np.arange(4)
    weights = np.linalg.pinv(powers)[:, 0]  # (N, 7) of the poses, in their cubic's value
    quat = (
        track.quat_xyzw
        * np.cumprod(
            np.concatenate(
                [[1.0], np.where(np.sum(track.quat_xyzw[1:] * track.quat_xyzw[:-1], axis=1) < 0, -1.0, 1.0)]
            )
        )[:, None]
    )
    even = span < 2.0 * float(np.median(span))
    position = np.einsum("nw,nwk->nk", weights, track.position[near])
    turned = np.einsum("nw,nwk->nk", weights, quat[near])
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return replace(
        track,
        position=np.where(even[:, None], position, track.position),
        quat_xyzw=np.where(even[:, None], turned, quat),
    )
