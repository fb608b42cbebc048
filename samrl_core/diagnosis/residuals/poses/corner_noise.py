"""Noise of poses that a detector found from the corners of a flat square target, by how it was seen.

Corners have one noise in the image. To first order the pose that fits them best has the covariance
(J^T J)^-1 times its square, J the change of the four corners with the pose (Hartley and Zisserman 2004,
Multiple View Geometry, section 5.2). It is far from even: a target seen from the front hardly tells its tilt,
one at the image's border trades its distance for its place across, all grow with the distance. A board of
many corners has the same shape of noise, of a lower level.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.student import log_student

SIDES_M = tuple(0.01 * 2.0**k for k in range(6))  # half sides that are tried first, up to 0.32 m
FINER = float(np.sqrt(2.0))  # up and down from the likeliest
BEGINS_AT = (0.0, 1.0)  # half sides from the target's origin to its middle: a tag's, a chessboard's
MOST_STEPS = 400  # between neighbouring views, by which the side is found
LEAST_STEPS = 12
CLEARLY = 8.0  # [nat] by which one of so many squares must be likelier than a power of the distance
STEEPEST = 0.2  # of its distance, that any corner lies along the axis: no lens sees further aside


def corner_noise(views: np.ndarray, half_side: float, begins_at: float) -> np.ndarray:
    """Standard deviations (N, 6) [m], [rad] of a target's pose at its origin, per radian of a corner.

    Args:
        views: target in camera (N, 4, 4), z of the target across its plane.
        half_side: of the square [m].
        begins_at: half sides from the target's origin to the square's middle, along x and y.
    """
    corners = half_side * (
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + [begins_at, begins_at, 0]
    )
    arm = corners @ np.swapaxes(views[:, :3, :3], 1, 2)  # (N, 4, 3) from the target's origin
    place = arm + views[:, None, :3, 3]
    # Axes that look backwards, as OpenGL's, see the same.
    depth = np.maximum(np.abs(place[..., 2]), STEEPEST * np.linalg.norm(place, axis=2))
    depth = np.copysign(depth, place[..., 2])[..., None, None]
    moved = np.concatenate([np.broadcast_to(np.eye(3), (*arm.shape, 3)), -rigid.skew(arm)], axis=3)
    seen = moved[..., :2, :] / depth - place[..., :2, None] * moved[..., 2:, :] / depth**2
    seen = seen.reshape(len(views), 8, 6)
    seen[..., 3:] /= half_side  # one unit for all: what is inverted must not depend on it
    information = np.swapaxes(seen, 1, 2) @ seen
    trace = np.trace(information, axis1=1, axis2=2)
    covariance = np.linalg.inv(information + 1e-12 * trace[:, None, None] * np.eye(6))
    out = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return out / [1.0, 1.0, 1.0, *[half_side] * 3]


def find_square(left: np.ndarray, views: np.ndarray, growth: np.ndarray) -> tuple[float, float]:
    """Half side [m] and beginning of the square whose corners' noise the poses clearly show; 0, 0 of none.

    By differences of neighbouring views, which hold no error that lasts, and the likelihood of a Student
    distribution, which wrong detections hardly move.

    Args:
        left: what is left of the residuals (N, 6).
        views: target in camera (N, 4, 4).
        growth: noise (N, 6) that must be beaten, up to a factor per channel.
    """
    first = np.arange(0, len(left) - 1, max(1, (len(left) - 1) // MOST_STEPS))
    if len(first) < LEAST_STEPS:
        return 0.0, 0.0
    steps = left[first + 1] - left[first]
    pairs = np.concatenate([views[first], views[first + 1]])

    def likely(each: np.ndarray) -> float:
        both = np.hypot(*np.split(each, 2))
        return log_student(steps / both) - float(np.sum(np.log(both)))

    def of_square(square: tuple[float, float]) -> float:
        return likely(corner_noise(pairs, *square))

    best = max(((side, begin) for begin in BEGINS_AT for side in SIDES_M), key=of_square)
    best = max((best, *((best[0] * by, best[1]) for by in (FINER, 1.0 / FINER))), key=of_square)
    even = likely(np.concatenate([growth[first], growth[first + 1]]))
    return best if of_square(best) > even + CLEARLY else (0.0, 0.0)
