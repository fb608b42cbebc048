"""Driver messages as the cell's topics have them: joint names and order, colour order, depth unit.

Pure functions of one message. What does not fit is refused; nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from sensor_msgs.msg import Image, JointState

from samrl_core.cell.robots.robot import RobotSpec
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
    """A driver's JointState under our joint names, in our order.

    Args:
        message: sensor_msgs/JointState.
        joints: number of our joint by the driver's name, as a driver's file has it.
        spec: of the arm.

    Raises:
        InputError: other names, missing values, or numbers that are not finite.
    """
    names = list(message.name)
    if sorted(names) != sorted(joints) or len(joints) != len(spec.joint_names):
        raise InputError(f"joints {names} are not those of the driver's file, {list(joints)}; correct it")
    made = JointState(header=message.header, name=list(spec.joint_names))
    for field in ("position", "velocity", "effort"):
        values = list(getattr(message, field))
        if len(values) != len(names) or not np.isfinite(values).all():
            raise InputError(f"joint state has {field} {values} for {len(names)} joints; check the driver")
        setattr(made, field, reordered(joints, names, values))
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
