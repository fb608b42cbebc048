"""The bridge without its host: an emergency stop of both arms, its reset, and what it forbids."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.world import make_world
from samrl_core.common.errors import InputError
from samrl_ros.contract.topics import cell_topic
from tests.outbox import KeptWords

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
ACCELERATION = 1.0  # [rad/s2] of the first joint


class Rig(KeptWords):
    """A bridge on the mock world, its steady clock the simulated one."""

    def __init__(self) -> None:
        from samrl_ros.nodes.bridge.bridge_core import BridgeCore, BridgeRates

        super().__init__()
        self.cell, task = cell_named(), task_named("peg_insertion")
        self.world = make_world("mock", task, self.cell)
        steady = lambda: self.world.time_ns * 1e-9  # noqa: E731
        self.bridge = BridgeCore(self, self.world, self.cell, task, BridgeRates(), 0.1, None, steady)
        self.bridge.start_episode(0, 0)

    def tick(self, seconds: float) -> None:
        end = self.world.time_ns + round(seconds * 1e9)
        while self.world.time_ns < end:
            self.bridge.tick()

    def speed_up(self, seconds: float) -> None:
        """The tool arm's first joint under constant acceleration, commanded at 250 Hz."""
        from samrl_ros.conversions import to_message

        spec = self.cell.tool_arm
        start, zeros = self.world.read_arm("tool_arm").position, np.zeros(len(spec.joint_names))
        first = np.eye(len(zeros))[0]
        for k in range(1, round(seconds / 0.004) + 1):
            t = 0.004 * k
            position, velocity = start + first * ACCELERATION * t * t / 2, first * ACCELERATION * t
            command = ArmCommand(
                self.world.time_ns + 4_000_000, position, velocity, first * ACCELERATION, zeros
            )
            self.bridge.on_command("tool_arm", to_message.command(command, spec.joint_names))
            self.tick(0.004)

    def safety(self) -> tuple[int, dict[str, str]]:
        message = self.on(cell_topic("safety_state"))[-1]
        return message.level[0], {v.key: v.value for v in message.values}


def test_reset_frees_both_arms_or_neither() -> None:
    rig = Rig()
    rig.speed_up(0.2)
    assert rig.world.read_arm("tool_arm").velocity[0] > 0.1
    rig.bridge.guards.estop("asked for")
    refusal = rig.bridge.reset_safety()
    assert "tool_arm: the arm still moves" in refusal
    rig.tick(0.02)
    assert rig.safety() == (2, {"tool_arm": "ESTOP", "camera_arm": "ESTOP"})
    rig.tick(1.0)
    assert not rig.world.read_arm("tool_arm").velocity.any()
    assert rig.bridge.reset_safety() == ""
    rig.tick(0.02)
    assert rig.safety() == (0, {"tool_arm": "HOLD", "camera_arm": "HOLD"})


def test_no_episode_starts_while_an_emergency_stop_is_latched() -> None:
    rig = Rig()
    rig.bridge.guards.estop("asked for")
    with pytest.raises(InputError, match="estop_reset"):
        rig.bridge.start_episode(1, 1)
    assert rig.bridge.reset_safety() == ""
    rig.bridge.start_episode(1, 1)


def test_a_refused_command_is_forgotten_with_its_episode() -> None:
    from samrl_ros.conversions import to_message

    rig = Rig()
    names, here = rig.cell.tool_arm.joint_names, rig.world.read_arm("tool_arm").position
    zeros = np.zeros(len(names))
    bad = ArmCommand(rig.world.time_ns + 4_000_000, here + np.nan, zeros, zeros, zeros)
    rig.bridge.on_command("tool_arm", to_message.command(bad, names))
    rig.tick(0.02)
    assert rig.safety() == (2, {"tool_arm": "FAULT", "camera_arm": "HOLD"})
    assert np.array_equal(rig.world.read_arm("tool_arm").position, here)
    rig.bridge.start_episode(1, 1)
    assert rig.safety()[0] == 0


def test_an_arm_obeys_one_commander_at_a_time() -> None:
    """A smooth command of somebody else, within every limit, brakes the arm and names both."""
    from samrl_ros.conversions import to_message

    rig = Rig()
    rig.speed_up(0.1)
    names, here = rig.cell.tool_arm.joint_names, rig.world.read_arm("tool_arm")
    assert here.velocity[0] > 0.05
    stamp = rig.world.time_ns + 100_000_000  # newer than any of the commander's
    moved = ArmCommand(stamp, here.position + 0.1 * here.velocity, here.velocity, *(np.zeros((2, 7))))
    rig.bridge.on_command("tool_arm", to_message.command(moved, names), "a stranger")
    assert rig.bridge.guards.refused_commands == 1
    assert any("a stranger" in text and "one commander at a time" in text for _, text in rig.logs)
    rig.tick(0.3)
    assert rig.safety() == (2, {"tool_arm": "FAULT", "camera_arm": "HOLD"})
    assert np.abs(rig.world.read_arm("tool_arm").velocity).max() < 1e-3
    rig.bridge.start_episode(1, 1)
    rig.speed_up(0.02)
    assert rig.safety()[0] == 0


def test_a_stamp_far_ahead_of_reception_is_refused() -> None:
    from samrl_ros.conversions import to_message

    rig = Rig()
    names, here = rig.cell.tool_arm.joint_names, rig.world.read_arm("tool_arm").position
    far = ArmCommand(rig.world.time_ns + 300_000_000, here, *(np.zeros((3, 7))))
    rig.bridge.on_command("tool_arm", to_message.command(far, names))
    rig.tick(0.02)
    assert rig.safety() == (2, {"tool_arm": "FAULT", "camera_arm": "HOLD"})
    assert any("0.300 s ahead" in text and "0.15" in text for _, text in rig.logs)


def test_dropped_commands_are_logged_once_a_second() -> None:
    from samrl_ros.conversions import to_message

    rig = Rig()
    rig.speed_up(0.02)
    names, here = rig.cell.tool_arm.joint_names, rig.world.read_arm("tool_arm").position
    old = to_message.command(ArmCommand(rig.world.time_ns - 8_000_000, here, *(np.zeros((3, 7)))), names)
    for _ in range(5):
        rig.bridge.on_command("tool_arm", old)
    warnings = [text for level, text in rig.logs if level == "warn"]
    assert len(warnings) == 1 and "not newer than one already taken" in warnings[0]
    assert rig.safety()[0] == 0


def test_commanded_efforts_bear_the_stamp_of_the_states_they_were_made_of() -> None:
    rig = Rig()
    rig.said.clear()
    rig.tick(0.1)

    def stamps(topic: str) -> list[int]:
        heard = [m.header.stamp for name, m in rig.said if name == topic]
        return [s.sec * 1_000_000_000 + s.nanosec for s in heard]

    for role in ("tool_arm", "camera_arm"):
        states, efforts = stamps(f"/cell/{role}/joint_states"), stamps(f"/cell/{role}/commanded_effort")
        assert len(efforts) == pytest.approx(len(states), abs=1) and len(efforts) > 20
        # the newest state's torque is sent one period later
        assert set(efforts[1:]) <= set(states)


def test_a_second_commander_of_a_stopped_arm_is_told_once() -> None:
    rig = Rig()
    rig.bridge.guards.estop("asked for")
    for _ in range(3):
        rig.bridge.guards.on_rivals("tool_arm", ["node 'manipulator'", "node 'stranger'"])
    rig.tick(0.01)
    told = [text for level, text in rig.logs if "2 publishers" in text]
    assert len(told) == 1 and "stopped already" in told[0] and rig.safety()[1]["tool_arm"] == "ESTOP"
    assert rig.bridge.reset_safety() == ""
    rig.bridge.guards.on_rivals("tool_arm", ["node 'manipulator'", "node 'stranger'"])
    rig.tick(0.01)
    assert rig.safety()[1]["tool_arm"] == "FAULT"


def test_a_correction_is_announced_and_goes_into_the_images() -> None:
    from samrl_core.cell.calibration.cell_correction import CellCorrection
    from samrl_core.cell.types.pose import Pose
    from samrl_ros.contract.topics import camera_topic
    from samrl_ros.conversions import from_message
    from samrl_ros.nodes.bridge.bridge_core import BridgeCore, BridgeRates

    cell, task, hears = cell_named(), task_named("peg_insertion"), KeptWords()
    world = make_world("mock", task, cell)
    nominal = cell.camera_in_flange
    found = CellCorrection(
        Pose(nominal.position + 0.01, nominal.quat_xyzw), numbers={"depth_offset": 0.02, "depth_scale": 0.1}
    )
    bridge = BridgeCore(hears, world, cell, task, BridgeRates(), 0.1, None, lambda: 0.0, found)
    bridge.announce()
    announced = from_message.calibration(hears.on(camera_topic("calibration"))[-1].data)
    np.testing.assert_allclose(announced["camera_in_flange"].position, nominal.position + 0.01)
    bridge.start_episode(0, 0)
    read = world.read_camera().depth
    for _ in range(200):
        bridge.tick()
    depth = from_message.image(hears.on(camera_topic("depth/image_rect_raw"))[-1])
    kept = np.isfinite(read) & np.isfinite(depth)
    assert kept.mean() > 0.3
    np.testing.assert_allclose(depth[kept], (read[kept] - 0.02) / 1.1, atol=1e-4)


def test_a_joints_zero_is_taken_off_the_joint_states() -> None:
    from samrl_core.cell.calibration.cell_correction import CellCorrection
    from samrl_ros.contract.topics import arm_topic
    from samrl_ros.nodes.bridge.bridge_core import BridgeCore, BridgeRates

    cell, task, hears = cell_named(), task_named("peg_insertion"), KeptWords()
    world = make_world("mock", task, cell)
    found = CellCorrection(encoder_zeros={"camera_arm": {cell.camera_arm.joint_names[2]: 0.01}})
    bridge = BridgeCore(hears, world, cell, task, BridgeRates(), 0.1, None, lambda: 0.0, found)
    bridge.start_episode(0, 0)
    said = hears.on(arm_topic("camera_arm", "joint_states"))[-1].position
    away = world.read_arm("camera_arm").position - np.array(said)
    np.testing.assert_allclose(away, 0.01 * np.eye(len(said))[2], atol=1e-9)
