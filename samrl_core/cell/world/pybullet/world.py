"""The simulated cell: two torque-controlled arms, a table and the task's bodies in PyBullet.

Nothing here reads the time of day, so a seed and a sequence of calls give the same readings each time.
"""

from __future__ import annotations

import math
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet

from samrl_core.cell.instance.cell_instance import CellInstance, InstanceName, draw_instance
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Scene
from samrl_core.cell.world.command_check import checked_command, checked_role, holding
from samrl_core.cell.world.drive import Drive
from samrl_core.cell.world.image_errors import noise_of
from samrl_core.cell.world.pybullet.arm import PyBulletArm
from samrl_core.cell.world.pybullet.bodies import PyBulletBodies, soften
from samrl_core.cell.world.pybullet.body_files import Mounted, camera_housing
from samrl_core.cell.world.pybullet.camera import Picture, TinyCamera
from samrl_core.cell.world.pybullet.chain import PyBulletChain
from samrl_core.cell.world.pybullet.impedance import impedance_effort
from samrl_core.cell.world.pybullet.looks import arm_meshes, build_clutter, casters_of
from samrl_core.cell.world.pybullet.real_camera import RealCamera
from samrl_core.cell.world.pybullet.slides import Slides
from samrl_core.cell.world.sensor_noise import RgbdSensor
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.table import TABLE_FRICTION, build_table
from samrl_core.cell.world.true_cell import TrueScene, true_cell, true_load, true_pose, true_scene
from samrl_core.cell.world.world import SimulatedWorld, Truth
from samrl_core.common.errors import InputError

ARM_LABELS = {"tool_arm": 3, "camera_arm": 4}
STILL = 0.001  # joints that move less during half an exposure, all together, smear no image [rad]


class PyBulletWorld(SimulatedWorld):
    """The cell and a task in a physics client of its own.

    The torque that `read_arm` reports is that of the motor: PyBullet's joints have no rotor inertia, and no
    friction unless the settings ask for it, so that the link side has the same.

    Args:
        task: whose bodies and tool are built.
        cell: the arms, as calibrated: what the controllers believe.
        settings: physics and noise.
        scene: in place of the task's own, as with a heavier tool.
        instance: in what the true cell differs from `cell` and the task's scene; None for nothing.

    Raises:
        InputError: the cell, the task or the settings cannot be built.
    """

    def __init__(
        self,
        task: Task,
        cell: CellSpec,
        settings: WorldSettings | None = None,
        scene: Scene | None = None,
        instance: CellInstance | None = None,
    ) -> None:
        """Build the cell and lay the scene of seed 0."""
        self._cell = cell
        self._settings = settings or WorldSettings()
        self._instance = instance or draw_instance(InstanceName(), cell)
        if scene is not None and not self._instance.is_nominal:
            raise InputError(f"a scene of its own and cell instance {self._instance.name} exclude each other")
        pliant = math.exp(self._instance.parts.stiffness)
        self._settings = replace(self._settings, contact_stiffness=pliant * self._settings.contact_stiffness)
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
        self._nominal = scene or task.scene(cell)
        self._true_cell = true_cell(cell, self._instance)
        made = true_scene(task, cell, self._instance)
        self._made = made if scene is None else TrueScene(task, scene, made.target)
        self._scene = self._made.scene
        self._drives = {role: Drive(cell.arm(role), role, self._instance, self._period_ns) for role in ROLES}
        self._start = task.start_joints(cell)
        self._time_ns = 0
        self._client = pybullet.connect(pybullet.DIRECT)
        self._closed = False
        # The files are read as they are loaded; kept longer, a killed process would leave them behind.
        with tempfile.TemporaryDirectory(prefix="samrl_world_") as files, ExitStack() as undo:
            folder = Path(files)
            undo.callback(self.close)  # unless all of this succeeds
            self._configure()
            self._arms, self._models = self._build_arms(folder)
            nominal = self._instance.is_nominal
            table = build_table(self._client, True, nominal, self._made.task.surface_height)
            soften(self._client, table, TABLE_FRICTION, self._settings)
            self._bodies = PyBulletBodies(self._client, self._scene.bodies, folder, self._settings)
            self._slides = Slides(self._client, self._scene.bodies, self._bodies.index, self._settings)
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
            self._camera, self._real_camera = self._build_cameras()
            self._sensor = RgbdSensor(noise_of(self._settings.rgbd_noise, self._instance), cell.intrinsics)
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
        """The nominal scene, which is what was built where nothing differs."""
        return self._nominal

    @property
    def camera_latency_ns(self) -> int:
        """See `SimulatedWorld`; whole controller periods."""
        return round(self._instance.timing.camera_latency / self._period_s) * self._period_ns

    def reset(self, seed: int) -> None:
        """Lay the scene anew, arms at the task's start joints and at rest; the clock goes on."""
        self._require_open()
        generators = np.random.default_rng(seed).spawn(4)
        scene_rng, self._joint_rng, self._camera_rng, self._error_rng = generators
        start = self._made.task.sample_start(scene_rng)
        poses = {body.name: body.body_in_world for body in self._scene.bodies} | start.body_in_world
        if not self._instance.is_nominal:
            self._bodies.forget_contacts()
            target, parts = self._made.target, self._instance.parts
            poses = {
                body.name: true_pose(body, poses[body.name], body.name in target, parts)
                for body in self._scene.bodies
            }
        self._bodies.place(poses)
        if self._real_camera is not None:
            self._real_camera.begin()
        self._commands: dict[str, ArmCommand] = {}
        self._efforts: dict[str, np.ndarray] = {}
        self._readings: dict[str, ArmReading] = {}
        for role in ROLES:
            self._drives[role].restart()
            self._arms[role].place(self._drives[role].true_position(self._start[role]))
            self._commands[role] = holding(self._start[role], self._time_ns)
            self._efforts[role] = self._models[role].gravity(self._start[role])
        self._chain.place(start.chain_angles, self._tip_in_world())
        self._first_contact_ns, self._peak_force = -1, 0.0
        self._slides.begin(start.slides, self._tip_in_world().position)
        self._measure()

    def command(self, role: str, command: ArmCommand) -> None:
        """Set what an arm's controller tracks from the next `advance` on.

        Raises:
            InputError: unknown role, or a field that is not one finite number per joint.
        """
        joints = len(self._cell.arm(checked_role(role)).joint_names)
        tracked = self._drives[role].send(checked_command(command, joints), self._time_ns)
        if tracked is not None:
            self._commands[role] = tracked

    def advance(self) -> None:
        """One controller period: control law on the newest readings, physics, new readings."""
        self._require_open()
        for role in ROLES:
            spec, reading, drive = self._cell.arm(role), self._readings[role], self._drives[role]
            self._commands[role] = drive.arrived(self._time_ns) or self._commands[role]
            effort = impedance_effort(
                spec.controller,
                spec.limits,
                self._commands[role],
                reading.position,
                reading.velocity,
                self._models[role].gravity(reading.position),
            )
            self._efforts[role] = effort
            self._arms[role].push(drive.torque(effort))
        if self._scene.tool.chain:
            self._chain.push(self._tip_in_world())
        if self._slides.waiting:
            self._slides.start_those_due(self._tip_in_world().position)
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
        """Image from where the camera truly is, with the stamp that its driver gives."""
        self._require_open()
        camera_in_world = self._arms["camera_arm"].flange_in_world() @ self._true_cell.camera_in_flange
        if self._real_camera is None:
            picture = self._camera.render(camera_in_world)
        else:
            picture = self._exposed(self._real_camera, camera_in_world)
        color, depth, mask = self._sensor.read(self._camera_rng, picture.color, picture.depth, picture.mask)
        timing = self._instance.timing
        late_ns = round(1e9 * (timing.clock_offset + timing.stamp_late))
        return Frame(max(0, self._time_ns + late_ns), color, depth, mask)

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
        """Disconnect; twice is harmless."""
        if not self._closed:
            self._closed = True
            pybullet.disconnect(physicsClientId=self._client)

    def _exposed(self, camera: RealCamera, middle: Pose) -> Picture:
        """What a camera sees while its arm moves at the present joint velocities."""
        position, velocity = self._arms["camera_arm"].state()
        half = 0.5 * self._instance.optics.exposure_time
        if float(np.abs(velocity).sum()) * half < STILL:
            return camera.take((middle,), self._error_rng)
        before, after = (
            self._true_camera_arm.flange_in_world(position + t * velocity) @ self._true_cell.camera_in_flange
            for t in (-half, half)
        )
        return camera.take(camera.exposures(middle, before, after), self._error_rng)

    def _build_cameras(self) -> tuple[TinyCamera, RealCamera | None]:
        """The ideal one, and the real one of a cell that differs."""
        settings, cell = self._settings, self._cell
        labels, light, shadow = self._labels(), settings.light_direction, settings.shadow
        ideal = TinyCamera(self._client, cell.intrinsics, labels, light, shadow)
        if self._instance.is_nominal:
            return ideal, None
        base = self._true_cell.camera_base_in_world
        self._true_camera_arm = ArmModel(cell.camera_arm, base, None)
        casters, fixed = casters_of(cell, self._arms, self._scene, self._bodies.index)
        height = self._made.task.surface_height
        fixed += build_clutter(self._client, self._instance, height)
        real = RealCamera(
            self._client, self._instance, cell.intrinsics, labels, light, casters, fixed, height
        )
        return ideal, real

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

    def _build_arms(self, folder: Path) -> tuple[dict[str, PyBulletArm], dict[str, ArmModel]]:
        cell, true, tool = self._cell, self._true_cell, self._scene.tool
        mounted = {"tool_arm": Mounted.of_tool(tool), "camera_arm": camera_housing(cell)}
        # What the controllers are told; a held part that slipped changes no load here.
        told_of = {
            "tool_arm": (
                self._nominal.tool.mass,
                self._nominal.tool.center_of_mass,
                self._nominal.tool.inertia,
            ),
            "camera_arm": (cell.camera_mass, cell.camera_center_of_mass, cell.camera_inertia),
        }
        arms, models = {}, {}
        for role in ROLES:
            spec, base, load = cell.arm(role), true.base_in_world(role), mounted[role]
            chain, tip = (tool.chain, tool.tip_in_flange) if role == "tool_arm" else ((), Pose.identity())
            share = self._settings.joint_friction if role == "tool_arm" else 0.0
            friction = share * spec.limits.effort + self._drives[role].friction
            mass, center = true_load(role, load.mass, load.center_of_mass, self._instance)
            borne = replace(load, mass=mass, center_of_mass=center)
            meshes = {} if self._instance.is_nominal else arm_meshes(cell, role, tool, folder)
            arms[role] = PyBulletArm(self._client, spec, base, borne, folder, chain, tip, friction, meshes)
            told = Payload(*told_of[role])
            models[role] = ArmModel(spec, cell.base_in_world(role), told)
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
            state, drive = self._arms[role].state(), self._drives[role]
            noise = self._joint_rng.standard_normal((3, state.shape[1])) * self._noise_std[role]
            self._readings[role] = ArmReading(
                self._time_ns,
                drive.read_position(state[0]) + noise[0],
                state[1] + noise[1],
                drive.read_effort(self._efforts[role], state[1]) + noise[2],
            )
