"""A run's bag made by hand: 2 s, two updates, two views, one e-stop, a warning said three times."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.topics import TOPICS, arm_topic, camera_topic, cell_topic
from tests.ros.bag_files import record

PERIOD_NS = 4_000_000
ERROR_RAD = 0.0125  # largest distance of command and measurement, at joint 2 of the tool arm
JOINTS = {"tool_arm": "panda_joint", "camera_arm": "rizon_joint"}


def stamped(message: Any, time_ns: int) -> Any:
    """The message with its header's stamp set."""
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 10**9)
    return message


def new(topic: str, **values: Any) -> Any:
    """A message of a topic."""
    return message_class(TOPICS[topic].type)(**values)


def picture(value: int) -> Any:
    """A 16 x 12 rgb8 image of one value."""
    data = np.full(16 * 12 * 3, value, np.uint8).tobytes()
    return message_class("sensor_msgs/msg/Image")(
        height=12, width=16, encoding="rgb8", step=48, data=list(data)
    )


def small_run(folder: Path, outcome: str = "done") -> Path:
    """Write `folder/bag`; without an outcome the episode did not end."""
    messages: list[tuple[int, str, Any]] = []

    def say(topic: str, time_ns: int, message: Any) -> None:
        messages.append((time_ns, topic, message))

    for i in range(500):
        now = (i + 1) * PERIOD_NS
        for role, prefix in JOINTS.items():
            names = [f"{prefix}{k}" for k in range(1, 8)]
            wanted = 0.01 * np.arange(7) + 0.1 * i * 0.004
            measured = wanted.copy()
            if role == "tool_arm" and i == 250:
                measured[1] -= ERROR_RAD
            topic = arm_topic(role, "command")
            backwards = wanted[::-1].tolist()  # drivers may order joints as they like
            zero = [0.0] * 7
            point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")(
                positions=backwards, velocities=zero, accelerations=zero, effort=zero
            )
            say(topic, now, stamped(new(topic, joint_names=names[::-1], points=[point]), now))
            topic = arm_topic(role, "joint_states")
            say(
                topic,
                now,
                stamped(new(topic, name=names, position=measured.tolist(), velocity=zero, effort=zero), now),
            )
        if i % 25 == 0:
            say(camera_topic("color/image_raw"), now, stamped(picture(100), now))
    ready, phase, safety = cell_topic("sim_bridge/ready"), cell_topic("phase"), cell_topic("safety_state")
    say(ready, 100_000_000, stamped(new(ready, episode=0, task="peg_insertion"), 100_000_000))
    for at, mark in ((100, "episode 0"), (100, "update"), (500, "view"), (700, "look"), (900, "act")):
        say(phase, at * 1_000_000, new(phase, data=mark))
    for at, level, text in ((4, b"\x00", "ok"), (1500, b"\x02", "estop <by hand>"), (1900, b"\x00", "ok")):
        say(safety, at * 1_000_000, new(safety, level=level, name="cell: command guard", message=text))
    for k in range(3):
        late = new("/rosout", level=30, name="cell.policy", msg=f"an image is {k}.5 s old")
        say("/rosout", (600 + k) * 1_000_000, late)
    for step, index in enumerate((25, 100)):
        now = (index + 1) * PERIOD_NS
        state = cell_topic("model_updater/state")
        message = new(state, step=step, task="peg_insertion", loss_before=0.5, loss_after=0.125)
        say(state, now + 1, stamped(message, now))
        say(cell_topic("model_updater/image"), now + 1, stamped(picture(60), now))
        target, action = cell_topic("view_planner/target"), cell_topic("policy/nominal_action")
        view = new(target, step=step, move=step == 0, score=0.75, present_score=0.5, reason="better")
        p = view.camera_in_world.position
        p.x, p.y, p.z = 0.7, 0.1 * step, 0.3
        say(target, now + 2, stamped(view, now))
        chosen = new(action, step=step)
        chosen.nominal.x, chosen.residual.y = 0.008, 0.001
        say(action, now + 3, stamped(chosen, now))
    status = arm_topic("tool_arm", "motion_status")
    stopped = new(status, arm="tool_arm", step=1, status=3, message="stopped by the guard")
    say(status, 1_500_000_001, stamped(stopped, 1_500_000_000))
    if outcome:
        end = cell_topic("supervisor/outcome")
        said = new(end, actions=2, reason=outcome, detected_success=True)
        say(end, 1_950_000_000, stamped(said, 1_950_000_000))
    messages.sort(key=lambda entry: entry[0])
    return record(folder / "bag", messages)
