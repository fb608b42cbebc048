"""What viewers are shown besides the graph's own messages: differences, clouds, the chosen view, meshes.

Messages in, messages out, all of them as CDR, so that a running cell and a recorded bag are shown alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.cell.report.pictures import COLOR, MODEL, difference_image
from samrl_ros.cell.viewer.clouds import SLOP_NS, ModelCloud, Nearest, cloud, depth_points, positions_of
from samrl_ros.cell.viewer.meshes import by_package, with_meshes
from samrl_ros.cell.viewer.view_marks import view_marks
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.topics import TOPICS, arm_topic, camera_topic, cell_topic
from samrl_ros.conversions import from_message

DEPTH, INFO = camera_topic("depth/image_rect_raw"), camera_topic("color/camera_info")
CALIBRATION = camera_topic("calibration")
STATE, TARGET = cell_topic("model_updater/state"), cell_topic("view_planner/target")
JOINTS = {arm_topic(role, "joint_states"): role for role in ROLES}
DESCRIPTIONS = {arm_topic(role, "robot_description"): role for role in ROLES}

DIFFERENCE = cell_topic("live_view/difference")
CAMERA_CLOUD, MODEL_CLOUD = cell_topic("live_view/camera_cloud"), cell_topic("live_view/model_cloud")
VIEW = cell_topic("live_view/view")
MADE = {  # types of what is made here
    DIFFERENCE: "sensor_msgs/msg/Image",
    CAMERA_CLOUD: "sensor_msgs/msg/PointCloud2",
    MODEL_CLOUD: "sensor_msgs/msg/PointCloud2",
    VIEW: "visualization_msgs/msg/MarkerArray",
}
TAKEN = frozenset({COLOR, MODEL, DEPTH, INFO, CALIBRATION, STATE, TARGET, *JOINTS, *DESCRIPTIONS})

IMAGES = 50  # kept for the model that belongs to one of them: 5 s
READINGS = 5000  # kept per arm: 20 s at 250 Hz, the longest update
CLOUD_PERIOD_NS = 500_000_000  # between clouds of the camera


@dataclass(frozen=True)
class Shown:
    """A message for viewers."""

    topic: str
    type: str
    data: bytes  # CDR


class ViewerMessages:
    """Makes them of one task's run in one cell."""

    def __init__(
        self,
        task: str,
        cell: str,
        wanted: Callable[[str], bool] = lambda topic: True,
        mesh_url: Callable[[str], str] = by_package,
    ) -> None:
        """Args:
        task: by name.
        cell: by name.
        wanted: whether anybody looks at a topic of `MADE`; clouds are made for those who do.
        mesh_url: as of `with_meshes`.
        """
        self._cell = cell_named(cell)
        self._wanted, self._mesh_url = wanted, mesh_url
        self._model = ModelCloud(task, cell)
        self._images: dict[str, Nearest] = {COLOR: Nearest(IMAGES), DEPTH: Nearest(IMAGES)}
        self._readings = {role: Nearest(READINGS) for role in ROLES}
        self._newest: dict[str, bytes] = {}  # camera_info and calibration
        self._cloud_ns = -CLOUD_PERIOD_NS  # stamp of the camera's last cloud
        self._drawn_ns = -1  # stamp of the model's last cloud

    def take(self, topic: str, data: bytes) -> Iterator[Shown]:
        """Take a message of `TAKEN` as it came; what it lets viewers see.

        Raises:
            InputError: a message that cannot be shown; nothing is kept of it.
        """
        stamp_ns = header_stamp_ns(TOPICS[topic].type, data) or 0
        if topic in JOINTS:
            self._readings[JOINTS[topic]].add(stamp_ns, data)
        elif topic in (INFO, CALIBRATION):
            self._newest[topic] = data
        elif topic in DESCRIPTIONS:
            yield self._description(topic, data)
        elif topic in self._images:
            self._images[topic].add(stamp_ns, data)
            yield from self._camera_cloud(stamp_ns)
        elif topic == MODEL:
            yield from self._difference(stamp_ns, data)
        elif topic == STATE:
            yield from self._model_cloud(stamp_ns, data)
        elif topic == TARGET:
            yield _shown(VIEW, view_marks(_read(TARGET, data)))

    def _description(self, topic: str, data: bytes) -> Shown:
        message = _read(topic, data)
        meshes = self._cell.arm(DESCRIPTIONS[topic]).meshes
        message.data = with_meshes(message.data, meshes, self._mesh_url)
        return Shown(topic, TOPICS[topic].type, serialize_message(message))

    def _difference(self, stamp_ns: int, data: bytes) -> Iterator[Shown]:
        camera = self._images[COLOR].at(stamp_ns)
        if camera is None:
            return
        drawn = _read(MODEL, data)
        real, model = from_message.image(_read(COLOR, camera)), from_message.image(drawn)
        if real.shape == model.shape:
            drawn.data = difference_image(real, model).tobytes()
            drawn.step = model.shape[1] * 3
            yield _shown(DIFFERENCE, drawn)

    def _camera_cloud(self, stamp_ns: int) -> Iterator[Shown]:
        parts = [self._images[COLOR].at(stamp_ns), self._images[DEPTH].at(stamp_ns), self._newest.get(INFO)]
        if (
            None in parts
            or abs(stamp_ns - self._cloud_ns) < CLOUD_PERIOD_NS
            or not self._wanted(CAMERA_CLOUD)
        ):
            return
        self._cloud_ns = stamp_ns
        color, depth, info = (_read(t, d) for t, d in zip((COLOR, DEPTH, INFO), parts, strict=True))
        pixels, metres = from_message.image(color), from_message.image(depth)
        if pixels.shape[:2] == metres.shape:
            points = depth_points(metres, pixels, from_message.intrinsics(info))
            yield _shown(CAMERA_CLOUD, cloud(points, stamp_ns))

    def _model_cloud(self, stamp_ns: int, data: bytes) -> Iterator[Shown]:
        readings = {role: kept.at(stamp_ns, SLOP_NS) for role, kept in self._readings.items()}
        calibration = self._newest.get(CALIBRATION)
        if None in readings.values() or calibration is None or not self._wanted(MODEL_CLOUD):
            return
        if stamp_ns == self._drawn_ns:
            return  # a state that was asked for twice
        self._drawn_ns = stamp_ns
        tool, camera_arm = (
            positions_of(
                _read(arm_topic(role, "joint_states"), readings[role]), self._cell.arm(role).joint_names
            )
            for role in ROLES
        )
        hand_eye = from_message.calibration(_read(CALIBRATION, calibration).data)["camera_in_flange"]
        points = self._model.points(_read(STATE, data), tool, camera_arm, hand_eye)
        yield _shown(MODEL_CLOUD, cloud(points, stamp_ns))


def _read(topic: str, data: Any) -> Any:
    return deserialize_message(data, message_class(TOPICS[topic].type))


def _shown(topic: str, message: Any) -> Shown:
    return Shown(topic, MADE[topic], serialize_message(message))
