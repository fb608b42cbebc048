"""Plays excitation trajectories on a world, one controller period at a time, and notes what a cell records.

The world is driven through the border that hardware fills too: commands in, readings out. The command
guard sits before it, as in the bridge. Gains are those of the arm's spec, so a driver is started with
them; nothing but a simulation can mount a load by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from samrl_core.cell.control.guard import CommandGuard
from samrl_core.cell.excitation.clearance import ArmLine
from samrl_core.cell.excitation.runs import Run, heavier, with_controller
from samrl_core.cell.excitation.signal import (
    from_velocity,
    minimum_jerk_length,
    minimum_jerk_velocity,
    sample_times,
)
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.robots.urdf import description_of
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.arm_description import ArmDescription, NominalTool
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.world import make_world
from samrl_core.cell.world.camera_recording import command_at
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import LimitError

ARM_DISTANCE = 0.25  # least distance of the two arms' middle lines, two link diameters [m]
_SETTLE_S = 1.0  # at the first pose before the recording starts [s]
_SHARE = 0.3  # of velocity and acceleration limits, on the way to the first pose
_CANDIDATES = 200  # places to wait at
_LOOKED_AT = 60  # poses of a path at which distances are taken

Progress = Callable[[str, float, float], None]  # (what, done [s], of [s])


class CellPlayer:
    """Records one arm; the other waits out of its way."""

    def __init__(self, role: str, task: Task, cell: CellSpec, world_kind: str, seed: int) -> None:
        self._role, self._other = role, next(r for r in ROLES if r != role)
        self._task, self._cell = task, cell
        self._kind, self._seed = world_kind, seed
        self._loads = nominal_payloads(cell, task.scene(cell).tool)
        self._lines = {r: ArmLine(cell.arm(r), self._loads[r], cell.base_in_world(r)) for r in ROLES}

    def record(self, run: Run, progress: Progress) -> ArmRecording:
        """Play a run: the other arm aside, to the first pose, rest, then record.

        Raises:
            LimitError: the guard refused a command, or the arms would come too near.
            InputError: the world cannot be made.
        """
        loaded = heavier(self._loads[self._role], run.extra_mass)
        spec = with_controller(self._cell.arm(self._role), run.controller)
        cell = replace(self._cell, **{self._role: spec})
        scene = self._task.scene(cell)
        if loaded is not None and run.extra_mass:  # at the load's centre of mass
            if self._role == "camera_arm":
                cell = replace(cell, camera_mass=loaded.mass)
            else:
                scene = replace(scene, tool=replace(scene.tool, mass=loaded.mass))
        world = make_world(self._kind, self._task, cell, scene=scene)
        try:
            world.reset(self._seed)
            stage = _Stage(world, cell, progress)
            self._approach(stage, run)
            states, tracked, effort = stage.play(self._role, run.command, run.name)
        finally:
            world.close()
        gravity = self._cell.base_in_world(self._role).rotation.T @ np.array([0.0, 0.0, -9.81])
        tool = None if loaded is None else NominalTool(loaded.mass, loaded.center_of_mass, loaded.inertia)
        description = ArmDescription(
            role=self._role,
            joints=spec.joint_names,
            urdf=description_of(spec),
            controller=replace(run.controller, gravity=tuple(float(g) for g in gravity)),
            tool=tool,
        )
        return ArmRecording(run.name, "", "", description, states, tracked, effort)

    def _approach(self, stage: _Stage, run: Run) -> None:
        """The other arm first, for it may stand in the way."""
        assert run.command.position is not None
        here, there = stage.position(self._role), run.command.position[0]
        way = np.linspace(here, there, _LOOKED_AT)
        step = max(1, len(run.command) // _LOOKED_AT)
        swept = np.concatenate([way, run.command.position[::step]])
        if self._lines[self._role].clearance(way).worst < -0.05:  # homes stand low over the table
            raise LimitError(
                f"the way of '{self._role}' to the first pose comes too near to the table or the arm itself; "
                "move the arm nearer to that pose first"
            )
        waiting = self._waiting_place(stage, here, swept)
        if waiting is not None:
            stage.move(self._other, waiting, f"{self._other} aside")
        stage.move(self._role, there, f"{self._role} to its first pose")
        stage.rest(_SETTLE_S)

    def _waiting_place(self, stage: _Stage, here: np.ndarray, swept: np.ndarray) -> np.ndarray | None:
        """Where the other arm is out of the way, None where it is already.

        Raises:
            LimitError: no place was found.
        """
        line = self._lines[self._other]
        mine = np.concatenate([self._lines[self._role].points(q)[0] for q in swept])
        still = self._lines[self._role].points(here)[0]
        now = stage.position(self._other)
        if _distance(line.points(now)[0], mine) > ARM_DISTANCE:
            return None
        limits = self._cell.arm(self._other).limits
        rng = np.random.default_rng(0)
        for spread in np.linspace(0.3, 2.0, _CANDIDATES):
            place = np.clip(
                now + rng.uniform(-spread, spread, len(now)), limits.lower + 0.1, limits.upper - 0.1
            )
            if line.clearance(place[None]).worst < 0.0:
                continue
            if _distance(line.points(place)[0], mine) < ARM_DISTANCE:
                continue
            way = np.linspace(now, place, 15)
            near = min(_distance(line.points(q)[0], still) for q in way)
            start = _distance(line.points(now)[0], still)
            if near >= min(start, ARM_DISTANCE) - 0.02 and line.clearance(way[1:]).worst > -0.05:
                return place
        raise LimitError(
            f"'{self._other}' finds no place out of the way of '{self._role}'; "
            "record with the other arm removed or parked, or with smaller motions"
        )


class _Stage:
    """A world under guard: moves arms, holds the others, and notes one of them."""

    def __init__(self, world: SimulatedWorld, cell: CellSpec, progress: Progress) -> None:
        self._world, self._cell, self._progress = world, cell, progress
        self._period_ns = round(cell.tool_arm.controller.period_s * 1e9)
        self._guards = {r: CommandGuard(cell.arm(r).limits, cell.arm(r).joint_names) for r in ROLES}
        self._goal = {r: world.read_arm(r).position.copy() for r in ROLES}

    def position(self, role: str) -> np.ndarray:
        """Where an arm is commanded to be (J,) [rad]."""
        return self._goal[role].copy()

    def rest(self, duration_s: float) -> None:
        """Both arms stay."""
        for _ in range(round(duration_s * 1e9 / self._period_ns)):
            self._step({})

    def move(self, role: str, goal: np.ndarray, what: str) -> None:
        """Straight in joint space, minimum jerk."""
        limits, here = self._cell.arm(role).limits, self._goal[role]
        way = goal - here
        if np.abs(way).max() < 1e-9:
            return
        length = minimum_jerk_length(way, _SHARE * limits.velocity, _SHARE * limits.acceleration)
        time = sample_times(max(1.0, length), self._period_ns * 1e-9)
        velocity = minimum_jerk_velocity(time, 0.0, float(time[-1]), way)
        self.play(role, from_velocity(time, velocity, here), what)

    def play(
        self, role: str, command: JointSignal, what: str
    ) -> tuple[JointSignal, JointSignal, JointSignal]:
        """Command a motion and return readings, what was tracked, and the torque sent to the drives.

        Row k is the controller's period k: position and velocity that it read, the command it tracked, the
        torque that its law made of both, and the torque sensor's value of the period that begins there
        (which a sensor gives at the period's end).

        Raises:
            LimitError: the guard refused a command.
        """
        count, joints = len(command), len(self._goal[role])
        rows = {name: np.empty((count, joints)) for name in ("q", "dq", "tau", "cq", "cdq", "cddq", "u")}
        for k in range(count):
            reading = self._world.read_arm(role)
            rows["q"][k], rows["dq"][k] = reading.position, reading.velocity
            tracked = self._step({role: command_at(command, k, self._world.time_ns)})[role]
            rows["cq"][k], rows["cdq"][k] = tracked.position, tracked.velocity
            rows["cddq"][k], rows["u"][k] = tracked.acceleration, self._world.commanded_effort(role)
            rows["tau"][k] = self._world.read_arm(role).effort
            if k % 200 == 0 or k == count - 1:
                self._progress(what, float(command.time[k]), float(command.time[-1]))
        time = command.time.copy()
        return (
            JointSignal(time, rows["q"], rows["dq"], effort=rows["tau"]),
            JointSignal(time, rows["cq"], rows["cdq"], rows["cddq"], np.zeros((count, joints))),
            JointSignal(time, effort=rows["u"]),
        )

    def _step(self, commands: dict[str, ArmCommand]) -> dict[str, ArmCommand]:
        now_ns = self._world.time_ns
        now_s = now_ns * 1e-9
        tracked = {}
        for role in ROLES:
            reading, guard = self._world.read_arm(role), self._guards[role]
            if role in commands:  # without, the guard holds the arm where it is
                guard.accept(commands[role], reading, now_s, now_s)
                self._goal[role] = commands[role].position
            tracked[role] = guard.tick(reading, now_s, now_s)
            self._world.command(role, tracked[role])
        self._world.advance()
        return tracked


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    squares = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None] - 2.0 * a @ b.T
    return float(np.sqrt(max(0.0, squares.min())))
