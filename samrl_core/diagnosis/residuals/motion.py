"""A recording brought to one clock: uniform samples, and the same zero-phase band for every channel.

All channels pass the same low-pass before they are compared, so that filtering adds no misfit
(parallel filtering of inverse-dynamics identification; Gautier 1997, "Dynamic identification of robots
with power model", and every later work on the subject).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from samrl_core.cell.types.arm_description import HELD, ArmController
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.laws import commanded_speed
from samrl_core.diagnosis.residuals.laws.control_law import LawTerms, held_values, law_terms
from samrl_core.diagnosis.residuals.laws.tracked_command import track_command
from samrl_core.diagnosis.residuals.signals.low_pass import find_any_filter, find_offline_filter
from samrl_core.diagnosis.residuals.signals.sample_times import SampleTimes, sample_times
from samrl_core.diagnosis.residuals.signals.signal_band import SignalBand, nearest, onto_grid
from samrl_core.diagnosis.residuals.signals.signal_noise import (
    Noise,
    Reading,
    is_difference,
    is_fast,
    noise_behind,
    quantum,
    tells_accelerations,
    white_noise,
    without_differences,
    without_filtered_rate,
)
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

BAND_HZ = 25.0  # what is compared; above it sensor noise in accelerations outweighs what arms do
DIFFERENCED_HZ = 15.0  # the same where no velocity was recorded
MAX_RATE_HZ = 1000.0
SLOW_PERIOD_S = 0.003  # of a controller, from which on it matters when within it a torque acts
SAME_PERIOD = 0.75  # of a log's: a controller that is faster sends torques that are not logged


class RecordedMotion(SignalBand):
    """Signals of one recording: `full` rate (F, J) and, with a bar in the formulas, band-limited (N, J).

    Attributes that the recording cannot give are None. Times are stamps of the recording's own axis, which a
    block of it keeps; `elapsed` counts from its first sample, `session` from that of the first recording.
    """

    def __init__(self, recording: ArmRecording, arm: RigidArm | None, start_s: float = 0.0) -> None:
        """Resample and filter; `start_s` is the time since the first recording's start (for slow drifts)."""
        self.recording, self.arm, self.start_s = recording, arm, start_s
        states = without_filtered_rate(without_differences(recording.states), DIFFERENCED_HZ)
        self.taken = sample_times(states.time, states.position, states.velocity, states.filtered_velocity)
        ticks = self.taken.ticks
        period = float(np.median(np.diff(ticks)))
        stride = max(1, round(1.0 / (period * MAX_RATE_HZ)))
        rate = 1.0 / (period * stride)
        # Accelerations that are twice differenced from positions are noise from a lower frequency on.
        differenced = states.velocity is None
        band = min(DIFFERENCED_HZ if differenced else BAND_HZ, rate / 5.0)
        dynamic = is_fast(rate) or (self.has_torque and tells_accelerations(states, rate))
        super().__init__(rate, band, float(ticks[-1] - ticks[0]), dynamic)
        self.joints = len(recording.arm.joints)
        self.time = np.arange(ticks[0], ticks[-1] + 0.5 / rate, 1.0 / rate)
        self.raw_position, self.raw_velocity, self.raw_effort, self.filtered_velocity = (
            onto_grid(self.taken, x, self.time, self.holds_commands)
            for x in (states.position, states.velocity, states.effort, states.filtered_velocity)
        )
        position = self.raw_position
        if position is None or states.position is None:
            raise ValueError(f"{recording.name} has no positions")
        self.reading_step = quantum(states.position)  # (J,) of the log's own grid
        read = states.position[nearest(self.taken.time, self.time)]
        self.kept = np.diff(read, axis=0, prepend=np.nan) == 0.0  # (F, J) readings of the sample before
        self.full_position = self.smooth(position)
        if self.raw_velocity is not None:
            self.full_velocity = self.smooth(self.raw_velocity)
        else:
            self.full_velocity = np.gradient(self.full_position, 1.0 / rate, axis=0)
        self.full_acceleration = np.gradient(self.full_velocity, 1.0 / rate, axis=0)
        self.enabled = self._enabled()  # (F, J) 1 where the drives give torque
        self.given = self._commanded(recording.commanded_effort)  # (F, J) as recorded
        self.computed = self.given is None and self._law_gives_torque()
        if self.computed:
            limit = self.limit()
            self.given = np.clip(self.described_law.total, -limit, limit)
        self.raw_commanded = None if self.given is None else self.motor_torque(self._held(self.given))

        self.t = self._pick(self.time)  # (N,)
        self.q = self.reduce(position)
        if self.raw_velocity is not None:
            moved = self._filtered(self.raw_velocity)
            self.dq, self.ddq = self._pick(moved), self._pick(self._derivative(moved, 1))
        else:
            moved = self._filtered(position)
            self.dq, self.ddq = (self._pick(self._derivative(moved, order)) for order in (1, 2))
        self.tau = None if self.raw_effort is None else self.reduce(self.raw_effort)
        self.u = None if self.raw_commanded is None else self.reduce(self.raw_commanded)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def elapsed(self) -> np.ndarray:
        """Times (F,) since the first sample [s]."""
        return self.time - self.time[0]

    @property
    def session(self) -> np.ndarray:
        """Times (N,) since the first recording's start [s], recordings one after another."""
        return self.start_s + self.t - self.time[0]

    @property
    def has_torque(self) -> bool:
        """Whether a torque was recorded, of the drives or behind the gears."""
        return self.recording.commanded_effort is not None or self.recording.states.effort is not None

    @cached_property
    def recorded_command(self) -> JointSignal | None:
        """The command as it was recorded, with its goals' speed where the law uses that; None without one."""
        command = self.recording.command
        if command is None or len(command) < 2:
            return None
        if is_difference(command) or commanded_speed.is_goals_own(self):
            command = commanded_speed.with_goals_speed(self, command)
        return command

    @cached_property
    def command(self) -> JointSignal | None:
        """What the controller tracked, on the full-rate grid; None where no command was recorded."""
        return None if self.recorded_command is None else self.as_tracked(self.recorded_command)

    def as_tracked(self, command: JointSignal, late: float = 0.0) -> JointSignal | None:
        """A command on the full-rate grid, `late` [s] after its stamps; what it lacks is zero."""
        return track_command(self, command, late)

    @property
    def holds_commands(self) -> bool:
        """Whether the described controller keeps each command until the next one."""
        return self.controller is not None and self.controller.between_commands == HELD

    @property
    def controller(self) -> ArmController | None:
        """As described."""
        return self.recording.arm.controller

    @cached_property
    def drive_input(self) -> JointSignal | None:
        """What drives a closed loop: the command, or the recorded effort of a motor without a loop."""
        if self.controller is None or not self.controller.law.open_loop:
            return self.command
        if self.given is None or self.raw_position is None:
            return None
        still = np.zeros_like(self.raw_position)
        return JointSignal(self.time, still, still, None, self.given)

    @property
    def logs_damped_velocity(self) -> bool:
        """Whether the velocity that the law damps was recorded; else it is differenced from positions."""
        return self.filtered_velocity is not None or self.raw_velocity is not None

    @property
    def damped_velocity(self) -> np.ndarray:
        """Velocity (F, J) that the law damps: as the drive reports it where that is recorded."""
        for read in (self.filtered_velocity, self.raw_velocity):
            if read is not None:
                return read
        return self.full_velocity

    @cached_property
    def asked(self) -> np.ndarray | None:
        """Torque (F, J) at standstill that the drives were asked for, as recorded."""
        if self.given is None or self.controller is None or not self.controller.law.after_back_emf:
            return self.given
        # As read, like the law's: a smoothed reading would hide its noise from the law's residual.
        speed = self.raw_velocity if self.raw_velocity is not None else self.full_velocity
        return self.given + self.controller.law.of_joints("back_emf", self.joints) * speed

    def limit(self) -> np.ndarray:
        """(J,) of the controller's output [N m]; infinite where none is stated."""
        assert self.controller is not None
        limit = np.full(self.joints, np.inf) if self.arm is None else self.arm.effort_limits()
        if self.controller.effort_limit is not None:
            limit = np.minimum(limit, self.controller.effort_limit)
        return limit

    def law(
        self, command: JointSignal | None = None, lag: int = 0, described: ArmController | None = None
    ) -> LawTerms:
        """The described law at the measured states, or that of another command or controller.

        `lag` shifts the states by samples, but for their weight.
        """
        command, controller = command or self.command, described or self.controller
        assert command is not None and controller is not None and self.raw_position is not None
        position, velocity = self.raw_position, self.damped_velocity
        if lag:
            position, velocity = np.roll(position, lag, axis=0), np.roll(velocity, lag, axis=0)
        if (ticks := self._ticks) is not None:
            position, velocity = position[ticks], velocity[ticks]
            parts = (command.position, command.velocity, command.effort)
            at = [None if part is None else part[ticks] for part in parts]
            command = JointSignal(self.time, at[0], at[1], None, at[2])
        return law_terms(
            controller, command, position, velocity, self._compensated, self.limit(), 1.0 / self.rate,
            self.enabled,
        )  # fmt: skip

    @cached_property
    def _ticks(self) -> np.ndarray | None:
        """Sample (F,) at which the controller last read, where it thinks more slowly than the log is."""
        assert self.controller is not None
        period = self.controller.period_s
        if period < 1.5 / self.rate:
            return None
        elapsed = self.time - self.time[0]
        return np.round(np.floor(elapsed / period + 1e-6) * period * self.rate).astype(int)

    def left_by_law(self, command: JointSignal, late: float) -> np.ndarray | None:
        """Torque (F, J) that the law gives with a command so late [s] beyond the one that was asked for.

        None where no torque was recorded, or of a command that the law does not follow.
        """
        tracked = self.as_tracked(command, late)
        if tracked is None or self.asked is None:
            return None
        limit = self.limit()
        return np.clip(self.law(tracked).total, -limit, limit) - self.asked

    def law_change(self, command: JointSignal) -> np.ndarray:
        """Torque (F, J) by which the law gives more with the recorded command than with this one.

        Within its limits, as it is compared: a stiff loop told the right goal too early asks for what no
        drive gives, and nothing of that beyond the limit is in the residual.
        """
        plain = self._without_steps
        if plain is None:
            own, other = self.described_law.total, self.law(command).total
        else:  # samples do not show what a rounded command does between them: it would explain its own noise
            own, other = self.law(described=plain).total, self.law(command, described=plain).total
        limit = self.limit()
        return np.clip(own, -limit, limit) - np.clip(other, -limit, limit)

    @cached_property
    def _without_steps(self) -> ArmController | None:
        """The controller with a command that is not rounded; None where the described one does not round."""
        controller = self.controller
        if controller is None or not np.any(controller.law.of_joints("command_step", self.joints) > 0):
            return None
        return replace(controller, law=replace(controller.law, command_step=0.0))

    @cached_property
    def described_law(self) -> LawTerms:
        """The described law along the recording."""
        return self.law()

    @cached_property
    def _compensated(self) -> np.ndarray | float:
        """Gravity torque (F, J) that the controller adds."""
        assert self.controller is not None and self.raw_position is not None
        return (
            self.arm.gravity(self.raw_position) if self.arm and self.controller.gravity_compensation else 0.0
        )

    def _held(self, asked: np.ndarray) -> np.ndarray:
        """Torque (F, J) as it acts: held over the controller's period, so half of that later."""
        if self.controller is None or self._ticks is not None or np.any(self.controller.law.pole_pitch):
            return asked
        period = self.controller.period_s
        return self.delayed(asked, 0.5 * period) if self.computed or period > SLOW_PERIOD_S else asked

    def motor_torque(self, asked: np.ndarray) -> np.ndarray:
        """Torque (F, J) of the motors at what is asked of them: switched, less what their speed takes."""
        if self.controller is None:
            return asked
        law = self.controller.law
        if self.recording.commanded_effort is not None and law.after_back_emf:
            return np.where(self.enabled > 0, asked, -self.back_emf_loss)
        return self.enabled * asked - self.back_emf_loss

    @cached_property
    def back_emf_loss(self) -> np.ndarray:
        """Torque (F, J) that the motors lose to their speed."""
        if self.controller is None:
            return np.zeros_like(self.full_velocity)
        law = self.controller.law
        powered = np.ones_like(self.enabled) if law.braked else self.enabled
        return law.of_joints("back_emf", self.joints) * powered * self.full_velocity

    def _enabled(self) -> np.ndarray:
        assert self.raw_position is not None
        flags = self.recording.torque_enabled
        if flags is None or flags.effort is None or not len(flags):
            return np.ones_like(self.raw_position)
        return (held_values(flags.time, flags.effort, self.time) > 0).astype(float)

    @property
    def holds_every_torque(self) -> bool:
        """Whether the log is known to hold the torque of every period of the controller, as it was sent."""
        if self.computed or self.controller is None:
            return False
        return self.controller.period_s > SAME_PERIOD / self.rate

    def _law_gives_torque(self) -> bool:
        """Without a recorded torque, a law that is known says what the drives were asked for."""
        return (
            self.dynamic
            and self.arm is not None
            and self.controller is not None
            and not self.controller.law.open_loop
            and self.command is not None
        )

    @cached_property
    def noise(self) -> Noise:
        """White noise levels of the raw channels, behind filters as it is within the band."""
        filtered = (self.raw_velocity, self.raw_effort, None if self.computed else self.given)
        speed, sensor, drive = (find_any_filter(x, self.rate, self.band) for x in filtered)
        place = find_offline_filter(self.raw_position, self.rate, self.band)
        read = (self.raw_position, self.raw_velocity, self.raw_effort, self.raw_commanded)
        position, velocity, effort, sent = (
            np.zeros(self.joints) if x is None else noise_behind(x, behind)
            for x, behind in zip(read, (place, speed, sensor, drive), strict=True)
        )
        # While a coarse encoder rests it is silent: rests must not speak for the motion.
        position = np.maximum(position, self.reading_step / np.sqrt(12.0))
        if self.computed and self.controller is not None:
            assert self.given is not None
            # Before it is held: the mean of two samples is half as noisy where white noise is looked for.
            sent = np.maximum(white_noise(self.given, self.rate), self.controller.stiffness * position)
        return Noise(position, velocity, effort, sent, sensor, drive)

    @cached_property
    def sure_acceleration(self) -> np.ndarray:
        """Accelerations (F, J) at full rate as far as they are motion.

        What multiplies accelerations must not multiply their noise: that is in the residual as well, and any
        inertia, real or tolerated, would seem to explain it (errors in variables; Soderstrom 2007).
        """
        return self.sure_by(self.full_acceleration, self.reading.values, self.reading.deviation)

    @cached_property
    def sure_velocity(self) -> np.ndarray:
        """Velocities (F, J) likewise: noise would turn a friction's sign many times at every reversal."""
        return self.sure_by(self.full_velocity, self.reading.values, self.reading.deviation)

    @cached_property
    def reading(self) -> Reading:
        """What velocities and accelerations come from: recorded velocities, else positions."""
        if self.raw_velocity is not None:
            return Reading(self.raw_velocity, self.noise.velocity, 1)
        assert self.raw_position is not None
        return Reading(self.raw_position, self.noise.position, 2)

    @cached_property
    def sure_ddq(self) -> np.ndarray:
        """The same band-limited (N, J)."""
        same = self.sure_acceleration is self.full_acceleration
        return self.ddq if same else self.reduce(self.sure_acceleration)

    @cached_property
    def sure_torque(self) -> np.ndarray:
        """Motors' torque (F, J) as far as it is no noise."""
        assert self.raw_commanded is not None
        return self.sure(self.raw_commanded, self.noise.commanded_effort)

    @cached_property
    def sure_effort(self) -> np.ndarray:
        """Link-side effort (F, J) as far as it is no noise."""
        assert self.raw_effort is not None
        return self.sure(self.raw_effort, self.noise.effort)

    def velocity_noise(self) -> np.ndarray:
        """Variance (J,) [rad2/s2] that white position noise has in velocities within the band."""
        return np.asarray(self.noise.position**2 * (2.0 / self.rate) * (2 * np.pi) ** 2 * self.band**3 / 3.0)

    def acceleration_noise(self, low: float, high: float) -> np.ndarray:
        """Variance (J,) [rad2/s4] of accelerations between two frequencies [Hz] by white sensor noise."""
        if self.raw_velocity is not None:
            power = self.noise.velocity**2 * (2.0 / self.rate) * (2 * np.pi) ** 2 * (high**3 - low**3) / 3.0
        else:
            power = self.noise.position**2 * (2.0 / self.rate) * (2 * np.pi) ** 4 * (high**5 - low**5) / 5.0
        return np.asarray(power)

    def _commanded(self, commanded: JointSignal | None) -> np.ndarray | None:
        if commanded is None or commanded.effort is None:
            return None
        return onto_grid(self.times_of(commanded.time, commanded.effort), commanded.effort, self.time)

    def times_of(self, time: np.ndarray, values: np.ndarray) -> SampleTimes:
        """When the samples of a channel were taken: with the states, where its stamps are theirs."""
        return self.taken if np.array_equal(time, self.recording.states.time) else sample_times(time, values)
