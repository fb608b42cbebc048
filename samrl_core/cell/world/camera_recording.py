"""Plays a motion of both arms on a simulated world and keeps what a cell's camera records meanwhile."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.excitation.camera_views import CameraMotion
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.world.world import SimulatedWorld

JOINT_HZ = 250.0


def record_camera(
    world: SimulatedWorld, task: str, cell: CellSpec, motion: CameraMotion, name: str, image_hz: float = 10.0
) -> ImageRecording:
    """Images with the stamps that their driver gives, joint readings with theirs; calibration as stated."""
    period = cell.tool_arm.controller.period_s
    every_image, every_joint = round(1.0 / (image_hz * period)), round(1.0 / (JOINT_HZ * period))
    signals = {"camera_arm": motion.camera_arm, "tool_arm": motion.tool_arm}
    frames, joints = [], {role: ([], []) for role in ROLES}
    begin = world.time_ns
    for k in range(len(motion.time)):
        for role in ROLES:
            if k % every_joint == 0:
                reading = world.read_arm(role)
                joints[role][0].append(1e-9 * (reading.stamp_ns - begin))
                joints[role][1].append(reading.position)
            world.command(role, command_at(signals[role], k, world.time_ns))
        if k % every_image == 0:
            frames.append(world.read_camera())
        world.advance()
    read = {role: (np.array(t), np.array(q)) for role, (t, q) in joints.items()}
    return ImageRecording(
        name, "", "", task, cell.name, cell.intrinsics, cell.camera_in_flange, cell.camera_base_in_world,
        cell.tool_base_in_world, np.array([1e-9 * (f.stamp_ns - begin) for f in frames]),
        np.stack([f.color for f in frames]), np.stack([f.depth for f in frames]),
        np.stack([f.mask for f in frames]), *read["camera_arm"], *read["tool_arm"],
    )  # fmt: skip


def command_at(command: JointSignal, k: int, now_ns: int) -> ArmCommand:
    """A planned motion's sample as a command that is valid now, without feed-forward."""
    position, velocity, acceleration = command.position, command.velocity, command.acceleration
    assert position is not None and velocity is not None and acceleration is not None
    return ArmCommand(now_ns, position[k], velocity[k], acceleration[k], np.zeros(position.shape[1]))
