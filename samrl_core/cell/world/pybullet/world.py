"""The simulated cell: two torque-controlled arms, a table and the task's bodies in PyBullet.

Nothing here reads the time of day, so a seed and a sequence of calls give the same readings each time.
"""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pybullet

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Scene
from samrl_core.cell.world.command_check import checked_command, checked_role, holding
from samrl_core.cell.world.pybullet.arm import PyBulletArm
from samrl_core.cell.world.pybullet.bodies import PyBulletBodies, soften
from samrl_core.cell.world.pybullet.body_files import Mounted
from samrl_core.cell.world.pybullet.camera import TinyCamera
from samrl_core.cell.world.pybullet.chain import PyBulletChain
from samrl_core.cell.world.pybullet.impedance import impedance_effort
from samrl_core.cell.world.sensor_noise import RgbdSensor
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.table import TABLE_FRICTION, build_table
from samrl_core.cell.world.world import SimulatedWorld, Truth
from samrl_core.common.errors import InputError

ARM_LABELS = {"tool_arm": 3, "camera_arm": 4}
# Housing of the RealSense D435 (datasheet: 90 x 25 x 25 mm); it ends short of the optical frame.
CAMERA_HALF_EXTENTS = (0.045, 0.0125, 0.0125)  # [m]
CAMERA_COLOR = (0.8, 0.8, 0.82)


class PyBulletWorld(SimulatedWorld):
    """The cell and a task in a physics client of its own.

    The torque that `read_arm` reports is that of the motor: PyBullet's joints have no rotor inertia, and no
    friction unless the settings ask for it, so that the link side has the same.

    Args:
        task: whose bodies and tool are built.
        cell: the arms, as calibrated; the world is built exactly to it.
        settings: physics and noise.
        scene: in place of the task's own, as with a heavier tool.

    Raises:
        InputError: the cell, the task or the settings cannot be built.
    """

    def __init__(
        self, task: Task, cell: CellSpec, settings: WorldSettings | None = None, scene: Scene | None = None
    ) -> None:
        """Build the cell and lay the scene of seed 0."""
        self._task, self._cell = task, cell
        self._settings = settings or WorldSettings()
        for role in ROLES:
            period = cell.arm(role).controller.period_s
            if period != cell.arm(ROLES[0]).controller.period_s:
                raise InputError(f"controller periods differ: {role} has {period} s; give both arms the same")
            if np.any(cell.arm(role).armature):
                raise InputError(
                    f"{role} has rotor inertia {cell.arm(role).armature} kg m2; PyBullet's joints cannot "
                    f"hold any, give this world an arm without"
                )
        self._period_s = cell.tool_arm.controller.period_s
        self._period_ns = round(self._period_s * 1e9)
        self._scene = scene or task.scene(cell)
        self._start = task.start_joints(cell)
        self._time_ns = 0
        self._folder = tempfile.TemporaryDirectory(prefix="samrl_world_")
        self._client = pybullet.connect(pybullet.DIRECT)
        self._closed = False
        with ExitStack() as undo:
            undo.callback(self.close)  # unless all of this succeeds
            self._configure()
            self._arms, self._models = self._build_arms()
            soften(self._client, build_table(self._client, solid=True), TABLE_FRICTION, self._settings)
            self._bodies = PyBulletBodies(
                self._client, self._scene.bodies, Path(self._folder.name), self._settings
            )
            tool_arm, chain = self._arms["tool_arm"], self._scene.tool.chain
            self._chain = PyBulletChain(
                self._client,
                tool_arm.body,
                tool_arm.link_index,
                chain,
                self._period_s,
                np.array(self._settings.gravity),
            )
            self._tool_links = frozenset({tool_arm.payload_link, *self._chain.links})
            self._camera = TinyCamera(
                self._client,
                cell.intrinsics,
                self._labels(),
                self._settings.light_direction,
                self._settings.shadow,
            )
            self._sensor = RgbdSensor(self._settings.rgbd_noise, cell.intrinsics)
            noise = self._settings.joint_noise
            self._noise_std = {role: noise.stack(len(cell.arm(role).joint_names)) for role in ROLES}
            self.reset(0)
            undo.pop_all()

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self._time_ns

    @property
    def scene(self) -> Scene:
        """The nominal scene that was built."""
        return self._scene

    def reset(self, seed: int) -> None:
        """Lay the scene anew, arms at the task's start joints and at rest; the clock goes on."""
        self._require_open()
        scene_rng, self._joint_rng, self._camera_rng = np.random.default_rng(seed).spawn(3)
        start = self._task.sample_start(scene_rng)
        poses = {body.name: body.body_in_world for body in self._scene.bodies} | start.body_in_world
        self._bodies.place(poses)
        self._commands: dict[str, ArmCommand] = {}
        self._efforts: dict[str, np.ndarray] = {}
        self._readings: dict[str, ArmReading] = {}
        for role in ROLES:
            self._arms[role].place(self._start[role])
            self._commands[role] = holding(self._start[role], self._time_ns)
            self._efforts[role] = self._models[role].gravity(self._start[role])
        self._chain.place(start.chain_angles, self._tip_in_world())
        self._first_contact_ns, self._peak_force = -1, 0.0
        self._measure()

    def command(self, role: str, command: ArmCommand) -> None:
        """Set what an arm's controller tracks from the next `advance` on.

        Raises:
            InputError: unknown role, or a field that is not one finite number per joint.
        """
        joints = len(self._cell.arm(checked_role(role)).joint_names)
        self._commands[role] = checked_command(command, joints)

    def advance(self) -> None:
        """One controller period: control law on the newest readings, physics, new readings."""
        self._require_open()
        for role in ROLES:
            spec, reading = self._cell.arm(role), self._readings[role]
            effort = impedance_effort(
                spec.controller,
                spec.limits,
                self._commands[role],
                reading.position,
                reading.velocity,
                self._models[role].gravity(reading.position),
            )
            self._efforts[role] = effort
            self._arms[role].push(effort)
        if self._scene.tool.chain:
            self._chain.push(self._tip_in_world())
        pybullet.stepSimulation(physicsClientId=self._client)
        self._time_ns += self._period_ns
        self._bodies.watch()
        forces = self._arms["tool_arm"].normal_forces(self._tool_links)
        if forces and max(forces) > 0.0:
            self._peak_force = max(self._peak_force, sum(forces))
            if self._first_contact_ns < 0:
                self._first_contact_ns = self._time_ns
        self._measure()

    def read_arm(self, role: str) -> ArmReading:
        """Newest reading: true state and link-side torque, with the sensors' noise.

        Raises:
            InputError: unknown role.
        """
        return self._readings[checked_role(role)]

    def commanded_effort(self, role: str) -> np.ndarray:
        """Torque that the controller sent last, after clipping (J,) [N m].

        Raises:
            InputError: unknown role.
        """
        return self._efforts[checked_role(role)].copy()

    def read_camera(self) -> Frame:
        """Image from where the camera truly is."""
        self._require_open()
        camera_in_world = self._arms["camera_arm"].flange_in_world() @ self._cell.camera_in_flange
        picture = self._camera.render(camera_in_world)
        color, depth, mask = self._sensor.read(self._camera_rng, picture.color, picture.depth, picture.mask)
        return Frame(self._time_ns, color, depth, mask)

    def truth(self) -> Truth:
        """For evaluation only."""
        self._require_open()
        poses = self._bodies.poses()
        return Truth(
            self._time_ns,
            {name: pose.position.copy() for name, pose in poses.items()},
            {name: pose.quat_xyzw.copy() for name, pose in poses.items()},
            self._bodies.speeds(),
            self._bodies.peak_heights(),
            self._tip_in_world().position.copy(),
            self._chain.points(),
            self._first_contact_ns,
            self._peak_force,
        )

    def close(self) -> None:
        """Disconnect and remove the files that were written; twice is harmless."""
        if not self._closed:
            self._closed = True
            pybullet.disconnect(physicsClientId=self._client)
            self._folder.cleanup()

    def _tip_in_world(self) -> Pose:
        return self._arms["tool_arm"].flange_in_world() @ self._scene.tool.tip_in_flange

    def _require_open(self) -> None:
        if self._closed:
            raise InputError("this world is closed; make a new one")

    def _configure(self) -> None:
        pybullet.setGravity(*self._settings.gravity, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._period_s,
            numSolverIterations=self._settings.solver_iterations,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            # A file of the same name may have held something else in an earlier world.
            enableFileCaching=0,
            physicsClientId=self._client,
        )

    def _build_arms(self) -> tuple[dict[str, PyBulletArm], dict[str, ArmModel]]:
        cell, tool = self._cell, self._scene.tool
        housing = Box(CAMERA_HALF_EXTENTS, Pose(cell.camera_center_of_mass, np.array([0.0, 0.0, 0.0, 1.0])))
        camera = Mounted(
            (housing,),
            (CAMERA_COLOR,),
            cell.camera_mass,
            cell.camera_center_of_mass,
            cell.camera_inertia,
            TABLE_FRICTION,
        )
        mounted = {"tool_arm": Mounted.of_tool(tool), "camera_arm": camera}
        arms, models = {}, {}
        for role in ROLES:
            spec, base, load = cell.arm(role), cell.base_in_world(role), mounted[role]
            chain, tip = (tool.chain, tool.tip_in_flange) if role == "tool_arm" else ((), Pose.identity())
            friction = self._settings.joint_friction if role == "tool_arm" else 0.0
            folder = Path(self._folder.name)
            arms[role] = PyBulletArm(self._client, spec, base, load, folder, chain, tip, friction)
            models[role] = ArmModel(spec, base, Payload(load.mass, load.center_of_mass, load.inertia))
        return arms, models

    def _labels(self) -> dict[tuple[int, int], int]:
        labels = {
            (arm.body, link): ARM_LABELS[role] for role, arm in self._arms.items() for link in arm.links
        }
        tool_arm = self._arms["tool_arm"]
        labels[tool_arm.body, tool_arm.payload_link] = self._scene.tool.label
        for index, link in zip(self._chain.links, self._scene.tool.chain, strict=True):
            labels[tool_arm.body, index] = link.label
        for body in self._scene.bodies:
            labels[self._bodies.index[body.name], -1] = body.label
        return labels

    def _measure(self) -> None:
        for role in ROLES:
            state = self._arms[role].state()
            noise = self._joint_rng.standard_normal((3, state.shape[1])) * self._noise_std[role]
            self._readings[role] = ArmReading(
                self._time_ns, state[0] + noise[0], state[1] + noise[1], self._efforts[role] + noise[2]
            )
