"""The border to the drivers, message by message: what may move when, and what a controller is told."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from sensor_msgs.msg import JointState

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.common.errors import InputError
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import to_message
from samrl_ros.hardware import adapter
from samrl_ros.hardware.driver_file import driver_named, drivers_by_part
from samrl_ros.nodes.bridge.hardware_core import HardwareCore, HardwareLimits
from tests.hardware.fake_controller import TrajectoryController
from tests.outbox import KeptWords

pytestmark = pytest.mark.ros
CELL, TASK = cell_named(DEFAULT_CELL), task_named("peg_insertion")
START = TASK.start_joints(CELL)
ARMS = drivers_by_part(["franka_ros2", "flexiv_ros2"])
BEGAN_NS = 1_700_000_000_000_000_000
PERIOD_NS = 4_000_000
SPEC = CELL.tool_arm
LIMITS = HardwareLimits(0.1, 0.012, observe_only=False, judged=True, publish_tf=True)


class Rig(KeptWords):
    """The core with arms that stand where they are put; time goes on by joint states."""

    def __init__(self, limits: HardwareLimits = LIMITS, correction: CellCorrection = NO_CORRECTION) -> None:
        super().__init__()
        self.sent: list[tuple[str, Any]] = []
        self.now_ns = BEGAN_NS
        self.position = {role: START[role].copy() for role in ROLES}
        self.velocity = {role: np.zeros(7) for role in ROLES}
        self.core = HardwareCore(
            self,
            CELL,
            TASK,
            ARMS,
            limits,
            lambda: 1e-9 * self.now_ns,
            lambda r, m: self.sent.append((r, m)),
            correction,
        )

    def joint_state(self, role: str) -> JointState:
        names = list(ARMS[role].joints or {})
        message = JointState(header=to_message.header(self.now_ns), name=names[::-1])
        message.position = self.position[role][::-1].tolist()
        message.velocity = self.velocity[role][::-1].tolist()
        message.effort = [0.0] * 7
        return message

    def go_on(self, seconds: float) -> None:
        """Joint states of both arms at 250 Hz."""
        end = self.now_ns + round(1e9 * seconds)
        while self.now_ns < end:
            self.now_ns += PERIOD_NS
            for role in ROLES:
                self.core.hear(role, "joint_states", self.joint_state(role), 1e-9 * self.now_ns)

    def command(self, ahead: float = 0.0) -> None:
        """To the tool arm: stay, or `ahead` [rad] of where its first joint is."""
        zeros = np.zeros(7)
        target = self.position["tool_arm"] + ahead * np.eye(7)[0]
        value = ArmCommand(self.now_ns + 40_000_000, target, zeros, zeros, zeros)
        self.core.on_command("tool_arm", to_message.command(value, SPEC.joint_names), "manipulator")

    def in_an_episode(self, episode: int = 0) -> None:
        self.go_on(0.1)
        assert self.core.finish_preflight() == []
        self.go_on(0.1)
        self.core.start_episode(episode)
        self.core.begin_episode()
        self.go_on(0.2)


def test_nothing_is_passed_on_and_nothing_moves_before_the_preflight() -> None:
    rig = Rig()
    rig.position["tool_arm"] = np.rad2deg(START["tool_arm"])
    rig.core.announce()
    rig.go_on(0.1)
    rig.core.start_episode(0)
    rig.command()
    faults = rig.core.finish_preflight()
    assert any("order and units" in fault for fault in faults)
    with pytest.raises(InputError, match="pre-flight"):
        rig.core.begin_episode()
    rig.go_on(0.1)
    rig.command()
    assert rig.core.is_checking and not rig.sent and not rig.on(arm_topic("tool_arm", "joint_states"))


def test_another_arm_on_the_same_topic_is_passed_over() -> None:
    """franka_ros2 and flexiv_ros2 both publish /joint_states: each bridge part hears both."""
    rig = Rig()

    def hear_both(seconds: float) -> None:
        for _ in range(round(seconds / 0.004)):
            for part, other in (("tool_arm", "camera_arm"), ("camera_arm", "tool_arm")):
                rig.core.hear(part, "joint_states", rig.joint_state(other), 1e-9 * rig.now_ns)
            rig.go_on(0.004)

    hear_both(0.1)
    assert rig.core.finish_preflight() == []
    hear_both(0.1)
    rig.core.start_episode(0)
    rig.core.begin_episode()
    hear_both(0.3)
    rig.command()
    hear_both(0.02)
    assert rig.sent and rig.core.refused == 0
    assert all(list(m.name) == list(SPEC.joint_names) for m in rig.on(arm_topic("tool_arm", "joint_states")))


def test_a_driver_that_renames_its_joints_in_an_episode_stops_its_arm() -> None:
    rig = Rig()
    rig.in_an_episode()
    for number in range(400):
        rig.now_ns += PERIOD_NS
        renamed = rig.joint_state("tool_arm")
        renamed.name = [f"j{joint}" for joint in range(7)]
        rig.core.hear("tool_arm", "joint_states", renamed, 1e-9 * rig.now_ns)
        if number == 200:  # 0.8 s: a busy machine, or others' messages that overtake
            assert rig.on(cell_topic("safety_state"))[-1].level == b"\x00"
    safety = rig.on(cell_topic("safety_state"))[-1]
    assert safety.level == b"\x02" and "j0" in safety.message and "`joints`" in safety.message


def test_a_topic_with_others_joints_alone_names_them() -> None:
    rig = Rig()
    for _ in range(50):
        rig.now_ns += PERIOD_NS
        rig.core.hear("tool_arm", "joint_states", rig.joint_state("camera_arm"), 1e-9 * rig.now_ns)
        rig.core.hear("camera_arm", "joint_states", rig.joint_state("camera_arm"), 1e-9 * rig.now_ns)
    (fault,) = rig.core.finish_preflight()
    assert fault.startswith("tool_arm") and "correct `joints`" in fault


def test_a_joints_zero_is_taken_off_what_is_heard_and_put_onto_what_is_sent() -> None:
    """The driver's first joint reads 0.02 rad too much, and is told as much more."""
    zero = 0.02 * np.eye(7)[0]
    rig = Rig(correction=CellCorrection(encoder_zeros={"tool_arm": {SPEC.joint_names[0]: 0.02}}))
    rig.position["tool_arm"] = START["tool_arm"] + zero
    rig.in_an_episode()
    heard = rig.on(arm_topic("tool_arm", "joint_states"))[-1]
    np.testing.assert_allclose(heard.position, START["tool_arm"], atol=1e-12)
    for _ in range(10):
        still = np.zeros(7)
        value = ArmCommand(rig.now_ns + 40_000_000, START["tool_arm"], still, still, still)
        rig.core.on_command("tool_arm", to_message.command(value, SPEC.joint_names), "manipulator")
        rig.go_on(0.004)
    role, sent = rig.sent[-1]
    assert role == "tool_arm"
    np.testing.assert_allclose(sent.points[0].positions, START["tool_arm"] + zero, atol=1e-9)


def test_drivers_that_were_disturbed_are_watched_anew() -> None:
    rig = Rig()
    rig.position["tool_arm"] = np.rad2deg(START["tool_arm"])
    rig.go_on(0.1)
    assert rig.core.finish_preflight() and rig.core.is_checking
    rig.position["tool_arm"] = START["tool_arm"].copy()
    rig.core.watch_anew()
    rig.go_on(0.1)
    assert rig.core.finish_preflight() == [] and not rig.core.is_checking


def test_an_observer_hears_and_never_speaks_to_a_driver() -> None:
    rig = Rig(replace(LIMITS, observe_only=True))
    rig.go_on(0.02)
    rig.core.finish_preflight()
    rig.go_on(0.1)
    rig.command()
    assert len(rig.on(arm_topic("tool_arm", "joint_states"))) == 25 and not rig.sent
    with pytest.raises(InputError, match="only observes"):
        rig.core.start_episode(0)


def test_an_episode_begins_with_the_operators_word_after_a_gap() -> None:
    rig = Rig()
    rig.in_an_episode(3)
    ready = rig.on(cell_topic("sim_bridge/ready"))
    assert [m.episode for m in ready] == [3] and rig.core.episodes.running == 3
    stamps = [m.header.stamp.nanosec for m in rig.on(arm_topic("tool_arm", "joint_states"))]
    assert max(np.diff(stamps)) >= 150_000_000  # nodes take the arms as placed anew
    assert not rig.sent  # nobody has commanded
    rig.command()
    rig.go_on(0.008)
    assert {role for role, _ in rig.sent} == {"tool_arm"}
    rig.core.end_episode(3)
    sent = len(rig.sent)
    rig.command(0.001)
    rig.go_on(0.3)
    assert len(rig.sent) - sent < 30 and rig.sent[-1][1].points[-1].velocities.tolist() == [0.0] * 7
    rig.go_on(0.2)
    last = len(rig.sent)
    rig.command(0.001)
    rig.go_on(0.2)
    assert len(rig.sent) == last  # silence: others may move the arm now


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda rig: rig.position["tool_arm"].__setitem__(2, 0.5), "the task starts at"),
        (lambda rig: rig.velocity["camera_arm"].__setitem__(1, 0.1), "moves at 0.100 rad/s"),
        (lambda rig: rig.core.guards.estop("test"), "emergency stop"),
        (lambda rig: rig.core.episodes.end(0), "waits to be judged"),
    ],
)
def test_a_scene_is_not_ready(spoil: Callable[[Rig], None], says: str) -> None:
    rig = Rig()
    rig.in_an_episode()
    if says != "waits to be judged":
        rig.core.end_episode(0)
        assert rig.core.episodes.record_judgement(True) == ""
        rig.core.start_episode(1)
    spoil(rig)
    rig.go_on(0.02)
    with pytest.raises(InputError, match=says):
        rig.core.begin_episode()
    assert rig.core.episodes.running == -1


def test_the_operator_judges_and_is_asked_one_thing_at_a_time() -> None:
    rig = Rig()
    rig.in_an_episode()
    assert "no episode" in rig.core.episodes.record_judgement(True)
    rig.core.end_episode(0)
    rig.core.start_episode(1)
    assert rig.core.episodes.record_judgement(False) == ""
    asked = [json.loads(m.data)["asks"] for m in rig.on(cell_topic("operator/request"))]
    assert asked == ["scene", "nothing", "judgement", "judgement", "scene"]
    (word,) = rig.on(cell_topic("operator/judgement"))
    assert json.loads(word.data) == {"episode": 0, "success": False}


def test_what_a_driver_garbles_in_an_episode_stops_its_arm() -> None:
    rig = Rig()
    rig.in_an_episode()
    broken = rig.joint_state("tool_arm")
    broken.header = to_message.header(rig.now_ns + PERIOD_NS)
    broken.position = [float("nan")] * 7
    rig.core.hear("tool_arm", "joint_states", broken, 1e-9 * rig.now_ns)
    rig.go_on(0.02)
    safety = rig.on(cell_topic("safety_state"))[-1]
    assert safety.level == b"\x02" and "cannot be used" in safety.message and rig.core.refused == 1


def test_two_commanders_brake_the_arm() -> None:
    rig = Rig()
    rig.in_an_episode()
    rig.core.on_rivals("tool_arm", ["node 'a'", "node 'b'"])
    rig.go_on(0.01)
    assert "one commander" in rig.on(cell_topic("safety_state"))[-1].message
    assert rig.core.reset_safety() == ""


def test_a_controller_left_alone_brakes_within_the_limits() -> None:
    joints = ARMS["tool_arm"].joints or {}
    controller = TrajectoryController(sorted(joints, key=lambda n: joints[n]))
    velocity = 0.8 * SPEC.limits.velocity * np.array([1, -1, 0.5, 0, 0.1, -0.3, 1])
    zeros = np.zeros(7)
    point = ArmCommand(BEGAN_NS + 12_000_000, SPEC.home, velocity, zeros, zeros)
    message = adapter.controller_trajectory(point, joints, SPEC.limits)
    controller.take(message, BEGAN_NS, ArmReading(BEGAN_NS, SPEC.home - 0.012 * velocity, velocity, zeros))
    controller.sample(BEGAN_NS + 12_000_000)
    seen = [controller.sample(BEGAN_NS + 12_000_000 + k * 1_000_000) for k in range(1, 700)]
    position, speed, acceleration = (np.array([s[i] for s in seen if s is not None]) for i in range(3))
    assert np.all(np.abs(acceleration) <= SPEC.limits.acceleration * 1.001)
    assert np.all(np.abs(speed) <= np.abs(velocity) * (1 + 1e-9))
    assert not speed[-1].any()
    stopping = 0.5 * velocity * np.abs(velocity) / SPEC.limits.acceleration
    assert np.allclose(position[-1], SPEC.home + stopping, atol=1e-6)


@pytest.mark.parametrize(
    ("named", "says"),
    [
        (["franka_ros2", "tool_arm=flexiv_ros2"], "two drivers"),
        (["tool_arm=realsense_ros"], "needs one of kind arm"),
        (["gripper=franka_ros2"], "no part"),
        (["ur_driver"], "no driver is named"),
    ],
)
def test_drivers_are_for_parts(named: list[str], says: str) -> None:
    with pytest.raises(InputError, match=says):
        drivers_by_part(named)
    assert drivers_by_part(["tool_arm=flexiv_ros2"])["tool_arm"] == driver_named("flexiv_ros2")
