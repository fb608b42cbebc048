"""Listens to drivers for a while, and publishes nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy

from samrl_ros.contract.message_types import message_class
from samrl_ros.conversions.from_message import stamp_ns
from samrl_ros.hardware.driver_file import DriverFile
from samrl_ros.hardware.preflight import ImageSample, JointSample

DEPTH = 100  # messages of 1 kHz while the executor is elsewhere


@dataclass
class Observed:
    """What was heard: joint states by arm, images by stream."""

    arms: dict[str, list[JointSample]] = field(default_factory=dict)
    images: dict[str, list[ImageSample]] = field(default_factory=dict)


def joint_sample(message: Any, received_s: float) -> JointSample:
    """A JointState, as data."""
    return JointSample(
        received_s,
        1e-9 * stamp_ns(message),
        tuple(message.name),
        tuple(message.position),
        tuple(message.velocity),
        tuple(message.effort),
    )


def image_sample(message: Any, received_s: float) -> ImageSample:
    """An Image or a CameraInfo, as data; pixels are left behind."""
    return ImageSample(
        received_s,
        1e-9 * stamp_ns(message),
        message.header.frame_id,
        int(message.width),
        int(message.height),
        getattr(message, "encoding", ""),
        tuple(float(v) for v in getattr(message, "k", ())),
    )


def observe(drivers: Mapping[str, DriverFile], seconds: float, now: Callable[[], float]) -> Observed:
    """Hear all topics of the drivers. ROS has been started; the time counts from the first message.

    Args:
        drivers: by `tool_arm`, `camera_arm` and `camera`.
        seconds: to listen [s]; as long again is waited for the first message.
        now: this computer's clock, that stamps are compared with [s].
    """
    heard = Observed()
    node = rclpy.create_node("samrl_preflight")
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def take(samples: list[Any], convert: Callable[[Any, float], Any], message: Any) -> None:
        samples.append(convert(message, now()))

    for part, driver in drivers.items():
        for name, stream in driver.streams.items():
            samples: list[Any] = (
                heard.arms.setdefault(part, []) if driver.kind == "arm" else heard.images.setdefault(name, [])
            )
            convert = joint_sample if driver.kind == "arm" else image_sample
            reliability = (
                ReliabilityPolicy.RELIABLE
                if stream.reliability == "reliable"
                else ReliabilityPolicy.BEST_EFFORT
            )
            node.create_subscription(
                message_class(stream.type),
                stream.driver_topic,
                partial(take, samples, convert),
                QoSProfile(depth=DEPTH, reliability=reliability),
            )
    begin, first = time.monotonic(), None
    while time.monotonic() - (begin if first is None else first) < seconds:
        executor.spin_once(timeout_sec=0.05)
        if first is None and any([*heard.arms.values(), *heard.images.values()]):
            first = time.monotonic()
    node.destroy_node()
    return heard
