"""Closed-loop simulation of an arm under its described controller: many plants, one command."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from samrl_core.dynamics.plant_arrays import FREE_EFFORT, TEETH_PER_EFFORT
from samrl_core.dynamics.plant_parameters import PlantParameters
from samrl_core.dynamics.rigid_arm import RigidArm
from samrl_core.dynamics.simulation import Simulation, Tree, sampled
from samrl_core.errors import InputError, LimitError
from samrl_core.types.arm_description import ArmDescription
from samrl_core.types.arm_recording import JointSignal

if TYPE_CHECKING:
    from samrl_core.dynamics.gradients import Gradient
    from samrl_core.dynamics.jacobian import Jacobian


class DivergenceError(LimitError):
    """A simulated plant left all bounds. `plant`, `joint` and `time_s` name the first one."""

    def __init__(self, plant: int, joint: str, time_s: float, others: int) -> None:
        more = f" ({others} other plants too)" if others else ""
        super().__init__(
            f"plant {plant} diverged at {time_s:.4f} s in {joint}: faster than 1e4 rad/s or no number{more}; "
            f"its parameters make the loop unstable at this period: soften the gains or use substeps"
        )
        self.plant, self.joint, self.time_s = plant, joint, time_s


@dataclass(frozen=True, eq=False)
class Rollouts:
    """What B plants did, as the real arm would have recorded it; T samples, J joints, float64."""

    time: np.ndarray  # (T,) [s] from 0
    position: np.ndarray  # (B, T, J) reading of the encoders [rad or m]
    velocity: np.ndarray  # (B, T, J) [rad/s or m/s]
    effort: np.ndarray  # (B, T, J) reading of the link-side torque sensors [N m or N]
    commanded_effort: np.ndarray  # (B, T, J) what the controller asked for [N m or N]


class ClosedLoop:
    """Simulator of one described arm.

    A controller period: command (delay, low-pass) -> controller at the measured position and velocity ->
    commanded effort (delay, lost packets, low-pass, rate limit, saturation, gain, offset, ripple) -> rotor
    less friction -> transmission -> link-side torque -> links, cable, mount -> reading. Friction and rotor
    inertia act upstream of the torque sensor.

    Integration is semi-implicit Euler, dq' = dq + h ddq, q' = q + h dq', with friction, springs and dampers
    of the drive implicit in dq'. Commands between two stamps are interpolated linearly, before the first and
    after the last they are held; a command without velocity has zero velocity, one without effort no
    feed-forward.

    An effort of sample k acts over the period that starts at k (`efforts="start"`), or over the one that
    ends there, as a driver publishes it that reports what it has just applied (`efforts="end"`; the first
    sample is then the torque that holds the arm).

    Raises:
        InputError: a description without URDF or controller, or gains that do not fit its joints.
    """

    def __init__(
        self,
        arm: ArmDescription,
        device: str = "cpu",
        *,
        substeps: int = 1,
        efforts: str = "start",
        threads: int = 1,
    ) -> None:
        """Read the URDF; `substeps` integration steps to a period, plants spread over `threads`."""
        if arm.controller is None:
            raise InputError(f"{arm.role} has no controller; a closed loop needs one")
        if substeps < 1 or threads < 1 or efforts not in ("start", "end"):
            raise InputError(
                f"substeps {substeps} and threads {threads} must be at least 1; "
                f"efforts '{efforts}' must be 'start' or 'end'"
            )
        self.arm = arm
        self.rigid = RigidArm(arm)
        self.device = device
        self.substeps, self.threads = substeps, threads
        self.shift = 0 if efforts == "start" else substeps
        self.step_s = arm.controller.period_s / substeps
        joints = len(arm.joints)
        control = arm.controller
        if control.joints != arm.joints:
            raise InputError(
                f"the controller drives {control.joints}, the arm has {arm.joints}; list the same joints"
            )
        limits = self.rigid.effort_limits() if control.effort_limit is None else control.effort_limit
        self.effort_limit = _per_joint("effort limit", limits, joints)
        self.stiffness = _per_joint("stiffness", control.stiffness, joints)
        self.damping = _per_joint("damping", control.damping, joints)
        self.armature = _per_joint("armature", 0.0 if control.armature is None else control.armature, joints)
        self.gravity = np.asarray(control.gravity, dtype=float)
        limits = np.where(np.isfinite(self.effort_limit), self.effort_limit, FREE_EFFORT)
        self.teeth = TEETH_PER_EFFORT * limits
        self.hints: dict[int, np.ndarray] = {}  # inertia each joint feels, per tree; filled on first use
        self.trees = {mount: Tree(self.rigid, mount) for mount in (0, 2)}

    def rollout(
        self,
        command: JointSignal,
        start_position: np.ndarray,
        start_velocity: np.ndarray,
        plants: Sequence[PlantParameters],
        duration_s: float,
        *,
        record_every: int = 1,
        position_log: JointSignal | None = None,
        keep_diverged: bool = False,
    ) -> Rollouts:
        """Simulate plants under one command.

        Args:
            command: what the controller tracks; stamps in seconds, 0 is the start.
            start_position: (J,) or (B, J), as measured at the start; encoder errors are taken off, and
                springs start wound up by gravity.
            start_velocity: (J,) or (B, J), as measured.
            plants: B of them.
            duration_s: of the rollout; sample times are 0, record_every periods, ... up to it.
            record_every: controller periods from one sample to the next.
            position_log: position and velocity that the controller reads in place of the simulated ones.
            keep_diverged: leave a diverged plant's samples NaN from there on instead of raising.

        Raises:
            InputError: shapes, stamps or values that do not fit.
            DivergenceError: a plant that is unstable.
        """
        groups = self.groups(plants)
        start_q = self.start_values("start_position", start_position, len(plants))
        start_v = self.start_values("start_velocity", start_velocity, len(plants))
        steps = self.steps(duration_s)
        if record_every < 1:
            raise InputError(f"record_every is {record_every}; it must be at least 1")
        every = record_every * self.substeps

        def run(members: list[int], mount: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
            simulation = Simulation(
                self, mount, [plants[i] for i in members], command, steps, every, position_log=position_log
            )
            simulation.start(start_q[members], start_v[members])
            failed = simulation.run()
            return simulation.records(), failed

        jobs = [(list(part), mount) for members, mount in groups for part in _parts(members, self.threads)]
        if self.threads > 1:
            run(jobs[0][0][:1], jobs[0][1])  # loads the kernels before the threads do, for good
            with ThreadPoolExecutor(self.threads) as pool:
                results = list(pool.map(lambda job: run(*job), jobs))
        else:
            results = [run(*job) for job in jobs]
        channels = [np.empty((len(plants), *part.shape[1:])) for part in results[0][0]]
        failures = []
        for (members, _), (parts, failed) in zip(jobs, results, strict=True):
            failures += [(members[row], int(k), int(j)) for row, (k, j) in enumerate(failed) if k >= 0]
            for whole, part in zip(channels, parts, strict=True):
                whole[members] = part
        time = np.arange(len(channels[0][0])) * (every * self.step_s)
        if failures and not keep_diverged:
            plant, k, joint = min(failures)
            raise DivergenceError(
                plant, self.joint_name(plants[plant], joint), k * self.step_s, len(failures) - 1
            )
        for plant, k, _ in failures:
            for channel in channels:
                channel[plant, time >= (k - 1) * self.step_s] = np.nan
        return Rollouts(time, *channels)

    def gradient(
        self,
        command: JointSignal,
        start_position: np.ndarray,
        start_velocity: np.ndarray,
        plants: Sequence[PlantParameters],
        duration_s: float,
        loss: Callable[[Rollouts], tuple[np.ndarray, Rollouts]],
        *,
        record_every: int = 1,
    ) -> Gradient:
        """Gradient of a loss by the adjoint method; see `samrl_core.dynamics.gradients.gradient`."""
        from samrl_core.dynamics.gradients import gradient  # its kernels are loaded only where wanted

        return gradient(
            self, command, start_position, start_velocity, plants, duration_s, loss, record_every=record_every
        )

    def jacobian(
        self,
        command: JointSignal,
        start_position: np.ndarray,
        start_velocity: np.ndarray,
        plant: PlantParameters,
        duration_s: float,
        wrt: Sequence[tuple[str, int | tuple[int, int] | None]],
        *,
        record_every: int = 1,
    ) -> Jacobian:
        """Jacobian of one plant's channels by differences; see `samrl_core.dynamics.jacobian.jacobian`."""
        from samrl_core.dynamics.jacobian import jacobian

        return jacobian(
            self, command, start_position, start_velocity, plant, duration_s, wrt, record_every=record_every
        )

    def groups(self, plants: Sequence[PlantParameters]) -> list[tuple[list[int], int]]:
        """Indices of the plants that share a tree, and the number of joints of their mount."""
        if len(plants) == 0:
            raise InputError("no plants to simulate; pass at least PlantParameters()")
        rigid = [i for i, plant in enumerate(plants) if np.isinf(plant.mount_stiffness)]
        swinging = [i for i, plant in enumerate(plants) if np.isfinite(plant.mount_stiffness)]
        return [(members, mount) for members, mount in ((rigid, 0), (swinging, 2)) if members]

    def steps(self, duration_s: float) -> int:
        """Integration steps, the one that starts at the last sample included."""
        if not (np.isfinite(duration_s) and duration_s >= 0):
            raise InputError(f"duration is {duration_s} s; it must be finite and not negative")
        return int(np.floor(duration_s / (self.step_s * self.substeps) + 1e-6)) * self.substeps + 1

    def joint_name(self, plant: PlantParameters, joint: int) -> str:
        """Name of a joint of the tree."""
        mount = 0 if np.isinf(plant.mount_stiffness) else 2
        return (
            ("mount x", "mount y")[joint]
            if joint < mount
            else self.arm.joints[self.trees[0].order[joint - mount]]
        )

    def commands(self, command: JointSignal, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity and feed-forward (steps, J) at every integration step, description's order."""
        if command.position is None:
            raise InputError("the command has no positions; the controller needs them")
        time = np.arange(steps) * self.step_s
        shape = (steps, len(self.arm.joints))
        position = sampled("command", command.time, command.position, time, shape[1])
        velocity, effort = (
            np.zeros(shape) if values is None else sampled("command", command.time, values, time, shape[1])
            for values in (command.velocity, command.effort)
        )
        return position, velocity, effort

    def start_values(self, name: str, values: np.ndarray, plants: int) -> np.ndarray:
        """Checked start (B, J) of all plants."""
        array = np.asarray(values, dtype=float)
        joints = len(self.arm.joints)
        if array.shape not in ((joints,), (plants, joints)):
            raise InputError(
                f"{name} has shape {array.shape}; it must be ({joints},) or ({plants}, {joints})"
            )
        if not np.isfinite(array).all():
            raise InputError(f"{name} has values that are not finite: {array}")
        return np.broadcast_to(array, (plants, joints)).copy()


def _parts(members: list[int], threads: int) -> list[list[int]]:
    return [list(part) for part in np.array_split(members, min(threads, len(members)))]


def _per_joint(name: str, values: object, joints: int) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.shape not in ((), (joints,)) or np.isnan(array).any() or (array < 0).any():
        raise InputError(f"controller's {name} is {values}; it must be ({joints},) and not negative")
    return np.broadcast_to(array, (joints,)).astype(float)
