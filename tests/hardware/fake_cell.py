"""A whole cell as its drivers' topics show it: `python -m tests.hardware.fake_cell TASK --truth FILE`.

Behind it stands PyBullet's world. It speaks as franka_ros2, flexiv_ros2 and realsense-ros do: joint states at
1 kHz with the drivers' names in another order, images of 640 x 480 at 15 Hz as bgr8 and 16UC1 in millimetres,
stamps by a clock that is off. It obeys as ros2_controllers' JointTrajectoryController does. Like a simulator
it publishes /clock, and it stands still while commands are under way: a busy computer makes it slow, not
wrong. It also plays the segmenter, and the operator, who lays each scene and judges it by truth.
"""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.cell.world import make_world
from samrl_core.cell.world.evaluation import TruthLog, ending_of, read_truth
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.hardware.driver_file import driver_named
from samrl_ros.hosting.host import start_ros
from tests.hardware.fake_controller import TrajectoryController

DRIVERS = {"tool_arm": "franka_ros2", "camera_arm": "flexiv_ros2"}
ORDER = [3, 6, 0, 5, 1, 4, 2]  # of the joints in a joint state
FRAME = "camera_color_optical_frame"
WIDTH, HEIGHT, SCALE = 640, 480, 3  # of the camera; its middle 384 x 384 are the cell's image
CAMERA_MS = 67
STALE_S = 2.0  # wall time after which no command is waited for any more
AHEAD_NS = 24_000_000  # robot time that commands are kept ahead of: twice the bridge's lead


class FakeCell:
    """Advances the world a millisecond at a time and says what the drivers would say."""

    def __init__(self, node: Any, options: argparse.Namespace) -> None:
        self._node, self._options = node, options
        self._cell, self._task = cell_named(DEFAULT_CELL), task_named(options.task)
        self._world = make_world("pybullet", self._task, self._cell)
        self._truth = TruthLog(options.truth, self._world)
        self._offset_ns = round(1e9 * options.offset)
        self._began_ns = 1_700_000_000_000_000_000 - self._world.time_ns  # a clock of today
        self._commanded: dict[str, tuple[float, int]] = {}  # wall time and stamp of each arm's newest command
        self._controllers: dict[str, TrajectoryController] = {}
        self._models = {r: ArmModel(self._cell.arm(r), self._cell.base_in_world(r), None) for r in ROLES}
        self._clock = node.create_publisher(Clock, "/clock", 1)
        self._joint_publishers: dict[str, Any] = {}
        for role, name in DRIVERS.items():
            driver = driver_named(name)
            assert driver.command is not None
            self._controllers[role] = TrajectoryController(
                sorted(driver.joints or {}, key=lambda n: (driver.joints or {})[n])
            )
            topic = driver.streams["joint_states"].driver_topic
            self._joint_publishers[role] = node.create_publisher(JointState, topic, 10)
            node.create_subscription(
                JointTrajectory, driver.command.driver_topic, partial(self._obey, role), 10
            )
            node.create_subscription(
                JointTrajectory, arm_topic(role, "command"), partial(self._note_command, role), 10
            )
        camera, mask = driver_named("realsense_ros"), driver_named("segmenter")
        kinds = {"color": Image, "depth": Image, "info": CameraInfo}
        self._images = {
            name: node.create_publisher(kinds[name], stream.driver_topic, 5)
            for name, stream in camera.streams.items()
        }
        self._images["mask"] = node.create_publisher(Image, mask.streams["mask"].driver_topic, 5)
        latched = QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        node.create_subscription(String, cell_topic("operator/request"), self._on_request, latched)
        self._ready = node.create_client(Trigger, cell_topic("operator/scene_ready"))
        self._judge = node.create_client(SetBool, cell_topic("operator/judge"))
        self._asked: dict[str, Any] = {"asks": "nothing"}
        self._answer_ns = 0
        self._laid = -1
        self._lay(0)

    @property
    def _now_ns(self) -> int:
        return self._began_ns + self._world.time_ns

    def is_waiting(self) -> bool:
        """Whether an arm's next command is due and still on its way."""
        soon, now = self._now_ns + self._offset_ns + AHEAD_NS, time.monotonic()
        return any(now - heard < STALE_S and stamp < soon for heard, stamp in self._commanded.values())

    def _note_command(self, role: str, message: JointTrajectory) -> None:
        self._commanded[role] = (time.monotonic(), from_message.stamp_ns(message))

    def step(self) -> None:
        """One millisecond: the controllers, physics, and what is due."""
        for role in ROLES:
            wanted = self._controllers[role].sample(self._now_ns + self._offset_ns)
            if wanted is not None:
                position, velocity, acceleration = wanted
                # Where set points came late, the spline catches up within a millisecond; no drive follows
                # its second derivative beyond what the arm can do.
                most = self._models[role].spec.limits.acceleration
                acceleration = np.clip(acceleration, -most, most)
                effort = self._models[role].effort_without_gravity(position, velocity, acceleration)
                command = ArmCommand(self._world.time_ns, position, velocity, acceleration, effort)
                self._world.command(role, command)
        self._world.advance()
        tick = self._world.time_ns // 1_000_000
        if tick % 4 == 0:
            self._clock.publish(Clock(clock=to_message.time(self._now_ns)))
        for role in ROLES:
            self._joint_publishers[role].publish(self._joint_state(role))
        if tick % CAMERA_MS == 0:
            self._publish_images()
        if self._asked["asks"] != "nothing" and self._world.time_ns >= self._answer_ns:
            self._answer()

    def _joint_state(self, role: str) -> JointState:
        reading: ArmReading = self._world.read_arm(role)
        names = self._controllers[role].joints
        said = JointState(header=to_message.header(self._now_ns + self._offset_ns))
        said.name = [names[k] for k in ORDER]
        said.position = reading.position[ORDER].tolist()
        said.velocity = reading.velocity[ORDER].tolist()
        said.effort = reading.effort[ORDER].tolist()
        if self._options.fault == "degrees" and role == "tool_arm":
            said.position = np.rad2deg(reading.position[ORDER]).tolist()
        return said

    def _publish_images(self) -> None:
        frame = self._world.read_camera()
        stamp = self._now_ns + self._offset_ns
        color = embedded(frame.color[..., ::-1])
        metres = np.nan_to_num(frame.depth)
        depth = embedded(np.round(1e3 * metres).astype(np.uint16))
        info = CameraInfo(header=to_message.header(stamp, FRAME), width=WIDTH, height=HEIGHT)
        k = self._cell.intrinsics
        info.k = [SCALE * k.fx, 0.0, WIDTH / 2 - 0.5, 0.0, SCALE * k.fy, HEIGHT / 2 - 0.5, 0.0, 0.0, 1.0]
        info.distortion_model, info.d = "plumb_bob", [0.0] * 5
        self._images["info"].publish(info)
        self._images["color"].publish(to_message.image(color, "bgr8", stamp, FRAME))
        self._images["depth"].publish(to_message.image(depth, "16UC1", stamp + 1_000_000, FRAME))
        self._images["mask"].publish(to_message.image(embedded(frame.mask), "mono8", stamp, FRAME))

    def _obey(self, role: str, message: JointTrajectory) -> None:
        self._controllers[role].take(message, self._now_ns + self._offset_ns, self._world.read_arm(role))

    def _on_request(self, message: String) -> None:
        self._asked = json.loads(message.data)
        self._answer_ns = self._world.time_ns + 300_000_000  # a very quick operator
        if self._asked["asks"] == "judgement" or (self._asked["asks"] == "scene" and self._laid >= 0):
            self._end()
        if self._asked["asks"] == "scene":
            self._lay(int(self._asked["episode"]))

    def _lay(self, episode: int) -> None:
        self._world.reset(self._options.seed + episode)
        for controller in self._controllers.values():
            controller.forget()
        self._laid = -1 if self._asked["asks"] == "nothing" else episode
        if self._laid >= 0:
            self._truth.record(episode, self._options.seed + episode, "start")

    def _end(self) -> None:
        if self._laid >= 0:
            self._truth.record(self._laid, self._options.seed + self._laid, "end")
        self._laid = -1

    def _answer(self) -> None:
        asked, self._asked = self._asked, {"asks": "nothing"}
        if asked["asks"] == "scene":
            answer = self._ready.call_async(Trigger.Request())
        else:
            end = read_truth(self._options.truth)[asked["episode"]]["end"]
            answer = self._judge.call_async(SetBool.Request(data=self._task.succeeded(ending_of(end))))
        answer.add_done_callback(lambda future: future.result().success or self._answer_again(asked))

    def _answer_again(self, asked: dict[str, Any]) -> None:
        """As a person does who was refused, of an arm that was not seen at the start yet."""
        if self._asked["asks"] == "nothing":
            self._asked, self._answer_ns = asked, self._world.time_ns + 300_000_000


def embedded(image: np.ndarray) -> np.ndarray:
    """The cell's image, `SCALE` times as large, in the middle of the camera's."""
    large = image.repeat(SCALE, axis=0).repeat(SCALE, axis=1)
    made = np.zeros((HEIGHT, WIDTH, *image.shape[2:]), image.dtype)
    top, left = (HEIGHT - large.shape[0]) // 2, (WIDTH - large.shape[1]) // 2
    made[top : top + large.shape[0], left : left + large.shape[1]] = large
    return made


def main() -> None:
    """Run until killed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("task")
    parser.add_argument("--truth", type=Path, required=True)
    parser.add_argument("--offset", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fault", default="")
    parser.add_argument("--factor", type=float, default=1.0)
    options = parser.parse_args()
    start_ros([])
    node = rclpy.create_node("fake_cell")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    cell = FakeCell(node, options)
    due = time.monotonic()
    while True:
        for _ in range(8):
            executor.spin_once(timeout_sec=0.0)
        while cell.is_waiting():
            executor.spin_once(timeout_sec=0.002)
        for _ in range(4):
            cell.step()
        now = time.monotonic()
        due = max(due + 0.004 / options.factor, now - 0.004)
        time.sleep(max(0.0, due - now))


if __name__ == "__main__":
    main()
