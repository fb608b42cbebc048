"""Driver messages as the cell's topics have them: joint names and order, colour order, depth unit.

Pure functions of one message. What does not fit is refused; nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import Image, JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from samrl_core.cell.robots.robot import JointLimits, RobotSpec
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.common.errors import InputError
from samrl_ros.conversions import from_message, to_message
from samrl_ros.hardware.preflight import reordered

JOINT_STATE_HZ = 250  # that the cell's topic has (samrl_ros/contract/topics.py)


def is_due(last_ns: int, stamp_ns: int) -> bool:
    """Whether a joint state is passed on: drivers publish at 1 kHz, the cell's topic has 250 Hz.

    Args:
        last_ns: stamp of the one that was passed on last [ns].
        stamp_ns: of this one [ns]; half a driver's period early is in time.
    """
    return stamp_ns - last_ns >= 1_000_000_000 // JOINT_STATE_HZ - 500_000 or stamp_ns < last_ns


def joint_state(message: Any, joints: Mapping[str, int], spec: RobotSpec) -> JointState:
    """A driver's JointState under our joint names, in our order; joints beside them are left out.

    Args:
        message: sensor_msgs/JointState.
        joints: number of our joint by the driver's name, as a driver's file has it.
        spec: of the arm.

    Raises:
        InputError: a joint is not there or twice, missing values, or numbers of ours that are not finite.
    """
    names = list(message.name)
    is_whole = set(joints) <= set(names) and len(set(names)) == len(names)
    if not is_whole or len(joints) != len(spec.joint_names):
        raise InputError(f"joints {names} are not those of the driver's file, {list(joints)}; correct it")
    made = JointState(header=message.header, name=list(spec.joint_names))
    for field in ("position", "velocity", "effort"):
        values = list(getattr(message, field))
        ours = reordered(joints, names, values) if len(values) == len(names) else []
        if not ours or not np.isfinite(ours).all():
            raise InputError(f"joint state has {field} {values} for {len(names)} joints; check the driver")
        setattr(made, field, ours)
    return made


def color_image(message: Any, frame: str) -> Image:
    """A colour image as rgb8 in the cell's frame. Raises InputError for an encoding but rgb8 and bgr8."""
    if message.encoding == "rgb8":
        pixels = from_message.image(message)
    elif message.encoding == "bgr8":
        swapped = Image(
            height=message.height, width=message.width, step=message.step, encoding="rgb8", data=message.data
        )
        pixels = from_message.image(swapped)[..., ::-1]
    else:
        raise InputError(
            f"colour image is {message.encoding!r}, must be rgb8 or bgr8; set the driver's format"
        )
    return to_message.image(pixels, "rgb8", from_message.stamp_ns(message), frame)


def depth_image(message: Any, frame: str) -> Image:
    """A depth image as 32FC1 [m], NaN invalid. Raises InputError for an encoding but 16UC1 [mm] and 32FC1."""
    if message.encoding not in ("16UC1", "32FC1"):
        raise InputError(
            f"depth image is {message.encoding!r}, must be 16UC1 or 32FC1; set the driver's format"
        )
    return to_message.image(from_message.image(message), "32FC1", from_message.stamp_ns(message), frame)


def mask_image(message: Any) -> Image:
    """A label image as it is. Raises InputError for an encoding but mono8."""
    if message.encoding != "mono8":
        raise InputError(f"label image is {message.encoding!r}, must be mono8; set the segmenter's format")
    return message


def controller_trajectory(
    command: ArmCommand, joints: Mapping[str, int], limits: JointLimits
) -> JointTrajectory:
    """A set point for a JointTrajectoryController: at its time, and from there to rest.

    The next message replaces it long before. If none comes, because we died, the controller itself brakes
    each joint at its acceleration limit. It interpolates with cubics, which parabolas are; from ROS Jazzy on
    it refuses a trajectory that ends in motion, and it refuses efforts.

    Args:
        command: set point, valid at its stamp, in the driver's clock.
        joints: number of our joint by the driver's name.
        limits: of the arm.
    """
    names = sorted(joints, key=lambda name: joints[name])
    speed, way = np.abs(command.velocity), np.sign(command.velocity)
    stop = np.round(1e9 * speed / limits.acceleration).astype(np.int64)  # [ns] each joint needs
    points = []
    for after_ns in sorted({0, *stop.tolist()}):
        t = np.minimum(1e-9 * after_ns, speed / limits.acceleration)
        point = JointTrajectoryPoint(time_from_start=_duration(after_ns))
        point.positions = (command.position + way * (speed - 0.5 * limits.acceleration * t) * t).tolist()
        rest = after_ns >= stop
        point.velocities = np.where(rest, 0.0, way * (speed - limits.acceleration * t)).tolist()
        points.append(point)
    return JointTrajectory(header=to_message.header(command.stamp_ns), joint_names=names, points=points)


def _duration(ns: int) -> Duration:
    return Duration(sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)
