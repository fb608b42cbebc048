"""Core types to messages."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Pose as PoseMsg
from geometry_msgs.msg import TransformStamped, Vector3
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2, PointField
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from samrl_core.cell.robots.robot import CellSpec, RobotSpec
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.types.pose import Pose


def time(stamp_ns: int) -> Time:
    """[ns] to builtin_interfaces/Time."""
    return Time(sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000)


def header(stamp_ns: int, frame: str = "") -> Header:
    """A header of one stamp and frame."""
    return Header(stamp=time(stamp_ns), frame_id=frame)


def joint_state(reading: ArmReading, joint_names: tuple[str, ...]) -> JointState:
    """A reading as sensor_msgs/JointState."""
    return JointState(
        header=header(reading.stamp_ns),
        name=list(joint_names),
        position=reading.position.tolist(),
        velocity=reading.velocity.tolist(),
        effort=reading.effort.tolist(),
    )


def effort_state(stamp_ns: int, effort: np.ndarray, joint_names: tuple[str, ...]) -> JointState:
    """Commanded torque as a JointState that carries effort only."""
    return JointState(header=header(stamp_ns), name=list(joint_names), effort=effort.tolist())


def command(value: ArmCommand, joint_names: tuple[str, ...]) -> JointTrajectory:
    """A command as a one-point trajectory, stamped with its time of validity."""
    point = JointTrajectoryPoint(
        positions=value.position.tolist(),
        velocities=value.velocity.tolist(),
        accelerations=value.acceleration.tolist(),
        effort=value.effort.tolist(),
    )
    return JointTrajectory(header=header(value.stamp_ns), joint_names=list(joint_names), points=[point])


def image(pixels: np.ndarray, encoding: str, stamp_ns: int, frame: str) -> Image:
    """An array as sensor_msgs/Image: uint8 for rgb8 and mono8, float32 metres for 32FC1."""
    pixels = np.ascontiguousarray(pixels)
    message = Image(header=header(stamp_ns, frame), height=pixels.shape[0], width=pixels.shape[1])
    message.encoding = encoding
    message.step = pixels.strides[0]
    message.data = pixels.tobytes()  # bytes: a NumPy array here costs a thousand times more
    return message


def camera_frame(frame: Frame, intrinsics: Intrinsics, frame_id: str) -> dict[str, Image | CameraInfo]:
    """The messages of one camera reading, by topic below the camera's, in the order to publish them."""
    images = {
        "color/image_raw": (frame.color, "rgb8"),
        "depth/image_rect_raw": (frame.depth, "32FC1"),
        "mask/image_raw": (frame.mask, "mono8"),
    }
    messages: dict[str, Image | CameraInfo] = {
        topic: image(pixels, encoding, frame.stamp_ns, frame_id)
        for topic, (pixels, encoding) in images.items()
    }
    return {**messages, "color/camera_info": camera_info(intrinsics, frame.stamp_ns, frame_id)}


def camera_info(intrinsics: Intrinsics, stamp_ns: int, frame: str) -> CameraInfo:
    """Undistorted pinhole CameraInfo."""
    k = intrinsics.ros_k
    message = CameraInfo(header=header(stamp_ns, frame), width=intrinsics.width, height=intrinsics.height)
    message.distortion_model = "plumb_bob"
    message.d = [0.0] * 5
    message.k = list(k)
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [k[0], 0.0, k[2], 0.0, 0.0, k[4], k[5], 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


def cloud(points: np.ndarray, fields: tuple[str, ...], stamp_ns: int, frame: str) -> PointCloud2:
    """Points (N, F) as sensor_msgs/PointCloud2 of float32 fields; the first three are x, y, z [m].

    A field `rgb` holds what `packed_rgb` gives.
    """
    rows = np.ascontiguousarray(points, dtype=np.float32)
    message = PointCloud2(header=header(stamp_ns, frame), height=1, width=len(rows), is_dense=True)
    message.fields = [
        PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate(fields)
    ]
    message.point_step = 4 * len(fields)
    message.row_step = message.point_step * len(rows)
    message.data = rows.tobytes()
    return message


def packed_rgb(colors: np.ndarray) -> np.ndarray:
    """Colours (N, 3) uint8 as float32 (N,) whose bytes are b, g, r, 0: what PCL and RViz call `rgb`."""
    wide = np.asarray(colors, dtype=np.uint32)
    return (wide[:, 0] << 16 | wide[:, 1] << 8 | wide[:, 2]).astype("<u4").view("<f4")


def pose(value: Pose) -> PoseMsg:
    """geometry_msgs/Pose."""
    message = PoseMsg()
    message.position.x, message.position.y, message.position.z = (float(v) for v in value.position)
    o = message.orientation
    o.x, o.y, o.z, o.w = (float(v) for v in value.quat_xyzw)
    return message


def vector(value: np.ndarray) -> Vector3:
    """(3,) to geometry_msgs/Vector3."""
    return Vector3(x=float(value[0]), y=float(value[1]), z=float(value[2]))


def transform(stamp_ns: int, parent: str, child: str, child_in_parent: Pose) -> TransformStamped:
    """One edge of the tf tree."""
    message = TransformStamped(header=header(stamp_ns, parent), child_frame_id=child)
    t, r = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = (float(v) for v in child_in_parent.position)
    r.x, r.y, r.z, r.w = (float(v) for v in child_in_parent.quat_xyzw)
    return message


def diagnostic(name: str, level: int, text: str, values: dict[str, str]) -> DiagnosticStatus:
    """diagnostic_msgs/DiagnosticStatus; level 0 ok, 1 warn, 2 error, 3 stale."""
    status = DiagnosticStatus(name=name, message=text)
    status.level = bytes([level])
    status.values = [KeyValue(key=k, value=v) for k, v in values.items()]
    return status


def controller(spec: RobotSpec, gravity: tuple[float, float, float]) -> String:
    """The nominal controller as the contract's JSON."""
    return String(
        data=json.dumps(
            {
                "type": "joint_impedance",
                "joints": list(spec.joint_names),
                "stiffness": spec.controller.stiffness.tolist(),
                "damping": spec.controller.damping.tolist(),
                "gravity_compensation": True,
                "period_s": spec.controller.period_s,
                "gravity": list(gravity),
                "effort_limit": spec.limits.effort.tolist(),
                "armature": spec.armature.tolist(),
            }
        )
    )


def payload(mass: float, center_of_mass: np.ndarray, inertia: np.ndarray) -> String:
    """The nominal payload at the flange as the contract's JSON."""
    data: dict[str, Any] = {
        "mass": mass,
        "center_of_mass": np.asarray(center_of_mass).tolist(),
        "inertia": np.asarray(inertia).tolist(),
    }
    return String(data=json.dumps(data))


def calibration(cell: CellSpec) -> String:
    """Nominal hand-eye and bases as JSON."""
    return String(
        data=json.dumps(
            {
                "camera_in_flange": _pose(cell.camera_in_flange),
                "flange": cell.camera_arm.flange,
                "base_in_world": {
                    "tool_arm": _pose(cell.tool_base_in_world),
                    "camera_arm": _pose(cell.camera_base_in_world),
                },
            }
        )
    )


def _pose(value: Pose) -> dict[str, list[float]]:
    return {"position": value.position.tolist(), "quat_xyzw": value.quat_xyzw.tolist()}
