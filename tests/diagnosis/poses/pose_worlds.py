"""Recordings of poses with one known difference, made with SciPy's rotations, NumPy and Pinocchio."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from tests.diagnosis.worlds import HOME, JOINTS, URDF

POSITION_NOISE, ROTATION_NOISE = 3e-4, 2e-3  # [m], [rad] of a detected tag
RATE_HZ, SECONDS = 30.0, 24.0


def matrix(position: tuple[float, ...], rotation_vector: tuple[float, ...]) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_rotvec(rotation_vector).as_matrix(), position
    return out


CAMERA = matrix((0.05, 0.02, 0.06), (0.02, 0.03, 1.6))  # in its flange
TARGET = matrix((0.42, 0.02, 0.03), (0.0, 0.0, 0.3))  # in the base
SMALL = matrix((0.002, -0.001, 0.0015), (0.004, -0.003, 0.002))
NONE = np.eye(4)


@dataclass(frozen=True, eq=False)
class PoseWorld:
    """What differs from the description, and what is stated."""

    camera_error: np.ndarray = field(default_factory=lambda: NONE)
    target_error: np.ndarray = field(default_factory=lambda: NONE)
    latency: float = 0.0
    drift: float = 0.0
    size_error: float = 0.0
    moving: bool = True
    at_rest: bool = False
    stated: bool = True
    seconds: float = SECONDS
    wrong_detections: int = 0
    moved_at: float | None = None  # [s] when somebody pushed the target
    inverse: bool = False  # the camera's transform is stated the wrong way round


def flange(time: np.ndarray, world: PoseWorld) -> np.ndarray:
    rng = np.random.default_rng(5)
    if world.at_rest:
        position = np.array([0.4, 0.0, 0.5]) + rng.uniform(-0.2, 0.2, (len(time), 3))
        turned = rng.uniform(-0.6, 0.6, (len(time), 3))
    else:
        phase, speed = rng.uniform(0, 6.28, (6, 3)), rng.uniform(0.3, 1.6, (6, 3))
        waves = np.sin(time[:, None, None] * speed + phase).sum(axis=2) / 1.7
        position = np.array([0.4, 0.0, 0.5]) + waves[:, :3] * [0.12, 0.15, 0.08]
        turned = waves[:, 3:] * [0.35, 0.35, 0.6]
    if not world.moving:
        position, turned = np.broadcast_to([0.4, 0.0, 0.5], position.shape), 0.0 * turned
    out = np.tile(np.eye(4), (len(time), 1, 1))
    out[:, :3, :3] = (Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(turned)).as_matrix()
    out[:, :3, 3] = position
    return out


def track(time: np.ndarray, poses: np.ndarray) -> PoseTrack:
    return PoseTrack(time, poses[:, :3, 3].copy(), Rotation.from_matrix(poses[:, :3, :3]).as_quat())


def record(world: PoseWorld, seed: int = 1) -> PoseRecording:
    rng = np.random.default_rng(seed)
    time = 2.0 * np.arange(40) if world.at_rest else np.arange(0.0, world.seconds, 1 / RATE_HZ)
    camera = CAMERA @ background(rng) @ world.camera_error
    target = TARGET @ background(rng) @ world.target_error
    seen = np.linalg.inv(flange(time - world.latency - world.drift * time, world) @ camera) @ target
    if world.moved_at is not None:
        seen[time > world.moved_at] = seen[time > world.moved_at] @ matrix(
            (0.02, 0.015, 0.0), (0.0, 0.0, 0.1)
        )
    seen[:, :3, 3] /= 1.0 + world.size_error
    seen[:, :3, 3] += POSITION_NOISE * rng.standard_normal((len(time), 3)) * [1, 1, 2]
    seen[:, :3, :3] = (
        Rotation.from_rotvec(ROTATION_NOISE * rng.standard_normal((len(time), 3))).as_matrix()
        @ seen[:, :3, :3]
    )
    for k in rng.choice(len(time), world.wrong_detections, replace=False):
        seen[k] = seen[k] @ matrix((0.05, 0.0, 0.1), (0.0, 0.5, 0.0))
    camera_in_flange = Pose.from_matrix(np.linalg.inv(CAMERA) if world.inverse else CAMERA)
    return PoseRecording(
        "run", "made by a test", f"{seed:064x}", track(time, seen),
        ArmPoses("camera_arm", track(time, flange(time, world))), None,
        camera_in_flange if world.stated else None, Pose.from_matrix(TARGET) if world.stated else None, None,
        timed=not world.at_rest,
    )  # fmt: skip


def background(rng: np.random.Generator) -> np.ndarray:
    """Within the default tolerances."""
    return matrix(tuple(4e-4 * rng.uniform(-1, 1, 3)), tuple(8e-4 * rng.uniform(-1, 1, 3)))


def record_two_arms(
    tool_clock: float = 0.0, encoder: Mapping[str, float] | None = None, seed: int = 3
) -> PoseRecording:
    """The camera on an arm that is known by its flange, the target on a small arm with joints and a URDF.

    `tool_clock` [s] is by how much the tool arm's stamps are ahead, `encoder` [rad] by how much joints read
    too much. The small arm's kinematics are Pinocchio's.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, 1 / RATE_HZ)
    model = pin.buildModelFromXML(URDF)
    phase, speed = rng.uniform(0, 6.28, (4, 3)), rng.uniform(0.4, 1.8, (4, 3))

    def angles(t: np.ndarray) -> np.ndarray:
        return HOME + 0.28 * np.sin(t[:, None, None] * speed + phase).sum(axis=1)

    def tool_flange(q: np.ndarray) -> np.ndarray:
        data, out = model.createData(), []
        for row in q:
            pin.framesForwardKinematics(model, data, row)
            out.append(data.oMf[model.getFrameId("fore")].homogeneous)
        return np.array(out)

    offsets = np.array([(encoder or {}).get(name, 0.0) for name in JOINTS])
    base = matrix((0.75, 0.1, -0.2), (0.0, 0.0, 0.4))  # of the small arm
    target = matrix((0.2, 0.0, 0.03), (0.2, 0.1, 0.3))  # on its flange
    camera = flange(time, PoseWorld()) @ CAMERA @ background(rng)
    seen = (
        np.linalg.inv(camera) @ base @ background(rng) @ tool_flange(angles(time)) @ target @ background(rng)
    )
    seen[:, :3, 3] += POSITION_NOISE * rng.standard_normal((len(time), 3))
    shaken = Rotation.from_rotvec(ROTATION_NOISE * rng.standard_normal((len(time), 3)))
    seen[:, :3, :3] = shaken.as_matrix() @ seen[:, :3, :3]
    stamps = np.arange(-0.1, SECONDS + 0.1, 0.01)
    return PoseRecording(
        "both", "made by a test", "2" * 64, track(time, seen),
        ArmPoses("camera_arm", track(time, flange(time, PoseWorld()))),
        ArmPoses("tool_arm", None, JOINTS, stamps, angles(stamps - tool_clock) + offsets, URDF),
        Pose.from_matrix(CAMERA), Pose.from_matrix(base), Pose.from_matrix(target),
    )  # fmt: skip
