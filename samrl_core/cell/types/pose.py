"""Rigid transforms. A variable `<child>_in_<parent>` maps child coordinates to parent coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError

_UNIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Pose:
    """Position and orientation of a child frame in a parent frame.

    `a_in_b @ c_in_a` is `c_in_b`. Arrays are read-only copies in float64.

    Raises:
        InputError: shape, non-finite value, or a quaternion that is not of unit length.
    """

    position: np.ndarray  # (3,) [m]
    quat_xyzw: np.ndarray  # (4,) unit quaternion, x y z w as ROS, Bullet and Warp store it

    def __post_init__(self) -> None:
        position = np.array(self.position, dtype=np.float64)
        quat = np.array(self.quat_xyzw, dtype=np.float64)
        if position.shape != (3,) or quat.shape != (4,):
            raise InputError(f"Pose needs shapes (3,) and (4,), got {position.shape} and {quat.shape}")
        if not (np.isfinite(position).all() and np.isfinite(quat).all()):
            raise InputError(f"Pose has a non-finite value: position {position}, quaternion {quat}")
        norm = float(np.linalg.norm(quat))
        if abs(norm - 1.0) > 1e-3:
            raise InputError(f"quaternion {quat} has length {norm:.6f}, must be 1; normalise it first")
        if abs(norm - 1.0) > _UNIT_TOLERANCE:
            quat = quat / norm  # rounding of a text file or a float32 message
        position.setflags(write=False)
        quat.setflags(write=False)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quat_xyzw", quat)

    @staticmethod
    def identity() -> Pose:
        """The pose of a frame in itself."""
        return Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

    @staticmethod
    def from_matrix(matrix: np.ndarray) -> Pose:
        """From a homogeneous matrix, shape (4, 4)."""
        return Pose(np.asarray(matrix)[:3, 3], quaternion_from_rotation(np.asarray(matrix)[:3, :3]))

    @staticmethod
    def from_rotation(position: np.ndarray, rotation: np.ndarray) -> Pose:
        """From a position (3,) [m] and a rotation matrix (3, 3)."""
        return Pose(position, quaternion_from_rotation(rotation))

    @staticmethod
    def from_rpy(position: np.ndarray, rpy: tuple[float, float, float]) -> Pose:
        """From URDF's fixed-axis roll, pitch, yaw [rad]."""
        r, p, y = (0.5 * a for a in rpy)
        cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
        return Pose(
            position,
            np.array(
                [
                    sr * cp * cy - cr * sp * sy,
                    cr * sp * cy + sr * cp * sy,
                    cr * cp * sy - sr * sp * cy,
                    cr * cp * cy + sr * sp * sy,
                ]
            ),
        )

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrix, shape (3, 3)."""
        x, y, z, w = self.quat_xyzw
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    def matrix(self) -> np.ndarray:
        """Homogeneous matrix, shape (4, 4)."""
        m = np.eye(4)
        m[:3, :3] = self.rotation
        m[:3, 3] = self.position
        return m

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(
            self.position + self.rotation @ other.position,
            _normalised(_product(self.quat_xyzw, other.quat_xyzw)),
        )

    def inverse(self) -> Pose:
        """The parent's pose in the child's frame."""
        x, y, z, w = self.quat_xyzw
        return Pose(-self.rotation.T @ self.position, np.array([-x, -y, -z, w]))

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Child coordinates (..., 3) [m] to parent coordinates (..., 3) [m]."""
        return np.asarray(points) @ self.rotation.T + self.position

    def angle_to(self, other: Pose) -> float:
        """Angle of the rotation between two poses [rad]."""
        between = (self.inverse() @ other).quat_xyzw
        # Not by arccos: near zero it would turn rounding of 1e-7 into an angle of 1e-3.
        return 2.0 * float(np.arctan2(np.linalg.norm(between[:3]), abs(between[3])))


def rotation_vector(vector: np.ndarray) -> Pose:
    """The rotation about a vector (3,) by its length [rad]."""
    angle = float(np.linalg.norm(vector))
    share = 0.5 * float(np.sinc(0.5 * angle / math.pi))  # sin(angle / 2) / angle, 1/2 at 0
    return Pose(np.zeros(3), np.array([*(share * vector), math.cos(0.5 * angle)]))


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def _normalised(quat: np.ndarray) -> np.ndarray:
    return quat / np.linalg.norm(quat)


def quaternion_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion xyzw of a rotation matrix (3, 3); w is not negative.

    Raises:
        InputError: the matrix is not a rotation.
    """
    r = np.asarray(rotation, dtype=np.float64)
    if r.shape != (3, 3) or not np.allclose(r @ r.T, np.eye(3), atol=1e-5) or np.linalg.det(r) < 0:
        raise InputError(f"not a rotation matrix (orthonormal, determinant +1):\n{r}")
    # Largest of the four squared components first: no division by a small number (Shepperd 1978).
    squares = np.array([r[0, 0], r[1, 1], r[2, 2], np.trace(r)])
    k = int(np.argmax(squares))
    if k == 3:
        q = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + squares[3]])
    else:
        i, j, m = k, (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[i] = 1 + r[i, i] - r[j, j] - r[m, m]
        q[j] = r[j, i] + r[i, j]
        q[m] = r[m, i] + r[i, m]
        q[3] = r[m, j] - r[j, m]
    q = _normalised(q)
    return -q if q[3] < 0 else q


def rpy_from_rotation(rotation: np.ndarray) -> tuple[float, float, float]:
    """URDF's fixed-axis roll, pitch, yaw [rad] of a rotation matrix (3, 3), R = Rz Ry Rx.

    At a pitch of +-90 deg only the sum of roll and yaw is known, or their difference: roll is zero there.
    """
    r = rotation
    level = float(np.hypot(r[0, 0], r[1, 0]))
    pitch = float(np.arctan2(-r[2, 0], level))
    if level < 1e-9:
        return 0.0, pitch, float(np.arctan2(-r[0, 1], r[1, 1]))
    return float(np.arctan2(r[2, 1], r[2, 2])), pitch, float(np.arctan2(r[1, 0], r[0, 0]))


def look_at(eye: np.ndarray, target: np.ndarray, roll: float = 0.0) -> Pose:
    """Camera pose in world: optical axes (z forward, x right, y down), image up towards world z.

    Args:
        eye: position of the camera (3,) [m].
        target: point on the optical axis (3,) [m].
        roll: extra rotation about the optical axis [rad].

    Raises:
        InputError: eye and target coincide, or the view is straight up or down.
    """
    eye, target = np.asarray(eye, dtype=np.float64), np.asarray(target, dtype=np.float64)
    z = target - eye
    distance = float(np.linalg.norm(z))
    if distance < 1e-9:
        raise InputError(f"camera and target coincide at {eye}; move one of them")
    z = z / distance
    x = np.cross(z, [0.0, 0.0, 1.0])
    if float(np.linalg.norm(x)) < 1e-6:
        raise InputError(f"view direction {z} is vertical, image-up is undefined; tilt the camera")
    x = x / np.linalg.norm(x)
    y = np.cross(z, x)
    c, s = np.cos(roll), np.sin(roll)
    rotation = np.stack([x, y, z], axis=1) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return Pose.from_rotation(eye, rotation)
