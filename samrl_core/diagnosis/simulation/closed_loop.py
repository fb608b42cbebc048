"""Closed-loop simulation of an arm under its described controller: many plants, one command."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError, LimitError
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.simulation import Simulation


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
    """Simulator of one described arm under its controller.

    A controller period: command (delay, low-pass) -> controller at the measured position and velocity ->
    commanded effort (delay, lost packets, low-pass, rate limit, saturation, gain, offset, ripple) -> rotor
    less friction -> transmission -> link-side torque -> links, cable, mount -> reading. Friction and rotor
    inertia act upstream of the torque sensor.

    Integration is semi-implicit Euler, dq' = dq + h ddq, q' = q + h dq', with friction, springs and dampers
    of the drive implicit in dq'. Commands between two stamps are interpolated linearly, before the first and
    after the last they are held; a command without velocity has zero velocity, one without effort no
    feed-forward.
    """

    def __init__(self, model: LoopModel) -> None:
        self.model = model
        self.arm = model.arm

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
        enabled: JointSignal | None = None,
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
            enabled: effort 1 while the drives give torque, 0 while they are switched off; the last one holds.
            keep_diverged: leave a diverged plant's samples NaN from there on instead of raising.

        Raises:
            InputError: shapes, stamps or values that do not fit.
            DivergenceError: a plant that is unstable.
        """
        model = self.model
        groups = model.groups(plants)
        start_q = model.start_values("start_position", start_position, len(plants))
        start_v = model.start_values("start_velocity", start_velocity, len(plants))
        steps = model.steps(duration_s)
        if record_every < 1:
            raise InputError(f"record_every is {record_every}; it must be at least 1")
        every = record_every * model.substeps

        def run(members: list[int], mount: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
            simulation = Simulation(
                self.model,
                mount,
                [plants[i] for i in members],
                command,
                steps,
                every,
                position_log=position_log,
                enabled=enabled,
            )
            simulation.start(start_q[members], start_v[members])
            failed = simulation.run()
            return simulation.records(), failed

        jobs = [(list(part), mount) for members, mount in groups for part in _parts(members, model.threads)]
        if model.threads > 1:
            run(jobs[0][0][:1], jobs[0][1])  # loads the kernels before the threads do, for good
            with ThreadPoolExecutor(model.threads) as pool:
                results = list(pool.map(lambda job: run(*job), jobs))
        else:
            results = [run(*job) for job in jobs]
        channels = [np.empty((len(plants), *part.shape[1:])) for part in results[0][0]]
        failures = []
        for (members, _), (parts, failed) in zip(jobs, results, strict=True):
            failures += [(members[row], int(k), int(j)) for row, (k, j) in enumerate(failed) if k >= 0]
            for whole, part in zip(channels, parts, strict=True):
                whole[members] = part
        time = np.arange(len(channels[0][0])) * (every * model.step_s)
        if failures and not keep_diverged:
            plant, k, joint = min(failures)
            raise DivergenceError(
                plant, model.joint_name(plants[plant], joint), k * model.step_s, len(failures) - 1
            )
        for plant, k, _ in failures:
            for channel in channels:
                channel[plant, time >= (k - 1) * model.step_s] = np.nan
        return Rollouts(time, *channels)


def _parts(members: list[int], threads: int) -> list[list[int]]:
    return [list(part) for part in np.array_split(members, min(threads, len(members)))]
