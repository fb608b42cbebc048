"""Listens to drivers for a while, and publishes nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy

from samrl_ros.contract.message_types import message_class
from samrl_ros.conversions.from_message import stamp_ns
from samrl_ros.hardware.driver_file import DriverFile
from samrl_ros.hardware.preflight import LEAST_SAMPLES, ImageSample, JointSample, is_of

DEPTH = 100  # messages of 1 kHz while the executor is elsewhere
PATIENCE = 4.0  # wall time to wait for the drivers, in units of the time to listen


@dataclass
class HeardSamples:
    """What was heard: joint states by arm, images by stream."""

    arms: dict[str, list[JointSample]] = field(default_factory=dict)
    images: dict[str, list[ImageSample]] = field(default_factory=dict)

    def take(self, driver: DriverFile, part: str, stream: str, message: Any, received_s: float) -> None:
        """Note a message of a part's stream, received at `received_s` by the clock of stamps [s].

        Joint states of others on an arm's topic stay only as long as there are none of the arm: they tell
        which names are there.
        """
        if driver.kind == "arm":
            joints, samples = driver.joints or {}, self.arms.setdefault(part, [])
            is_known = bool(samples) and is_of(joints, samples[-1].names)
            if is_of(joints, message.name) and not is_known:
                samples.clear()
            elif is_known and not is_of(joints, message.name):
                return
            samples.append(joint_sample(message, received_s))
        else:
            self.images.setdefault(stream, []).append(image_sample(message, received_s))

    def is_enough(self, drivers: Mapping[str, DriverFile], seconds: float) -> bool:
        """Whether each stream has been heard for so long, by its stamps [s]."""
        for part, driver in drivers.items():
            for stream in driver.streams:
                heard = self.arms.get(part, []) if driver.kind == "arm" else self.images.get(stream, [])
                if len(heard) < LEAST_SAMPLES or heard[-1].stamp_s - heard[0].stamp_s < seconds:
                    return False
        return True


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
        tuple(float(v) for v in getattr(message, "d", ())),
    )


def subscribe(
    node: Any,
    drivers: Mapping[str, DriverFile],
    hear: Callable[[str, str, Any], None],
) -> list[Any]:
    """Subscriptions of a node to all topics of the drivers; `hear` takes part, stream and message."""
    made = []
    for part, driver in drivers.items():
        for name, stream in driver.streams.items():
            reliability = (
                ReliabilityPolicy.RELIABLE
                if stream.reliability == "reliable"
                else ReliabilityPolicy.BEST_EFFORT
            )
            made.append(
                node.create_subscription(
                    message_class(stream.type),
                    stream.driver_topic,
                    partial(hear, part, name),
                    QoSProfile(depth=DEPTH, reliability=reliability),
                )
            )
    return made


def observe(
    drivers: Mapping[str, DriverFile],
    seconds: float,
    closers: list[Callable[[], object]],
    sim_time: bool = False,
) -> HeardSamples:
    """Hear all topics of the drivers. ROS has been started.

    Args:
        drivers: by `tool_arm`, `camera_arm`, `camera` and `segmenter`.
        seconds: that each stream must have been heard, by its stamps [s]; after `PATIENCE` times as long by
            the wall clock it ends with what there is.
        closers: gets what takes the node from the graph, see `on_graph`.
        sim_time: whether stamps are compared with /clock, in place of this computer's clock.
    """
    heard = HeardSamples()
    override = [Parameter("use_sim_time", value=sim_time)]
    node = rclpy.create_node("samrl_preflight", parameter_overrides=override)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    closers += [node.destroy_node, executor.shutdown]

    def hear(part: str, stream: str, message: Any) -> None:
        heard.take(drivers[part], part, stream, message, 1e-9 * node.get_clock().now().nanoseconds)

    subscribe(node, drivers, hear)
    end = time.monotonic() + PATIENCE * seconds
    while time.monotonic() < end and not heard.is_enough(drivers, seconds):
        executor.spin_once(timeout_sec=0.05)
    return heard
