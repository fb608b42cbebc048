"""A world without physics: arms follow commands perfectly, the camera sees a grey table."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.chain import chain_points, checked_angles, link_poses
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.types.scene import Scene
from samrl_core.cell.world.command_check import checked_command, checked_role, holding
from samrl_core.cell.world.world import SimulatedWorld, Truth


class MockWorld(SimulatedWorld):
    """For tests of what stands around a world: no physics, no noise, no contact."""

    def __init__(self, task: Task, cell: CellSpec, scene: Scene | None = None) -> None:
        """Lay the scene of seed 0."""
        self._task, self._cell = task, cell
        scene = scene or task.scene(cell)
        self._tool = scene.tool
        self._nominal = {body.name: body.body_in_world for body in scene.bodies}
        loads = {
            "tool_arm": Payload(scene.tool.mass, scene.tool.center_of_mass, scene.tool.inertia),
            "camera_arm": Payload(cell.camera_mass, cell.camera_center_of_mass, cell.camera_inertia),
        }
        self._models = {r: ArmModel(cell.arm(r), cell.base_in_world(r), loads[r]) for r in ROLES}
        self._start = task.start_joints(cell)
        self._period_ns = round(cell.tool_arm.controller.period_s * 1e9)
        self._time_ns = 0
        self.reset(0)

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self._time_ns

    def reset(self, seed: int) -> None:
        """Sample the scene from `seed`, arms at the task's start joints."""
        start = self._task.sample_start(np.random.default_rng(seed).spawn(1)[0])
        self._poses = self._nominal | start.body_in_world
        self._chain_angles = checked_angles(self._tool.chain, start.chain_angles)
        self._commands = {role: holding(self._start[role], self._time_ns) for role in ROLES}
        self._states = {role: (self._start[role].copy(), np.zeros_like(self._start[role])) for role in ROLES}

    def command(self, role: str, command: ArmCommand) -> None:
        """Where the arm will be after the next `advance`.

        Raises:
            InputError: unknown role, or a field that is not one finite number per joint.
        """
        self._commands[role] = checked_command(command, len(self._cell.arm(checked_role(role)).joint_names))

    def advance(self) -> None:
        """One controller period; every arm is where its command says."""
        self._time_ns += self._period_ns
        self._states = {role: (c.position.copy(), c.velocity.copy()) for role, c in self._commands.items()}

    def read_arm(self, role: str) -> ArmReading:
        """Position and velocity as commanded; effort holds against gravity."""
        position, velocity = self._states[checked_role(role)]
        return ArmReading(self._time_ns, position.copy(), velocity.copy(), self.commanded_effort(role))

    def commanded_effort(self, role: str) -> np.ndarray:
        """Gravity torque at the present position (J,) [N m]."""
        return self._models[checked_role(role)].gravity(self._states[role][0])

    def read_camera(self) -> Frame:
        """Grey, at 0.5 m, without labels."""
        k = self._cell.intrinsics
        shape = (k.height, k.width)
        return Frame(
            self._time_ns,
            np.full((*shape, 3), 128, dtype=np.uint8),
            np.full(shape, 0.5, dtype=np.float32),
            np.zeros(shape, dtype=np.uint8),
        )

    def truth(self) -> Truth:
        """The sampled bodies at rest, the tip by forward kinematics, the sampled chain stiff."""
        flange_in_base = self._models["tool_arm"].flange_in_base(self._states["tool_arm"][0])
        tip = self._cell.tool_base_in_world @ flange_in_base @ self._tool.tip_in_flange
        links = link_poses(self._tool.chain, tip, self._chain_angles)
        return Truth(
            self._time_ns,
            {name: pose.position.copy() for name, pose in self._poses.items()},
            {name: pose.quat_xyzw.copy() for name, pose in self._poses.items()},
            dict.fromkeys(self._poses, 0.0),
            {name: float(pose.position[2]) for name, pose in self._poses.items()},
            tip.position,
            chain_points(self._tool.chain, links),
            -1,
            0.0,
        )

    def close(self) -> None:
        """Nothing to release."""
