"""When a stepper's field turned: its angle runs so fast that what stamps may be off by is no small part.

Between two poles of a belt axis at 0.75 m/s lie 0.5 ms. Stamps are tolerated within half a sample, as a
torque in proportion to the shift; a field that was read 0.2 ms early is a radian off, and its torque a sine
of that. So the shift is looked for first, the one that counts is taken from the command's stamps, and the
tolerance is that of what is left (Gauss-Newton: a nuisance parameter is linearised where it lies).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.equations import NOMINAL_SIGN, form_equations
from samrl_core.diagnosis.residuals.laws.late_law import explained_log_likelihood, late_law_change
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

STRAIGHT = 0.3  # [rad] of the field: up to here a shift's torque is in proportion to it, within 2 %
FAR = 1.5  # [rad] likewise: from here on a difference over the whole tolerance says nothing of a torque
COARSE, FINE = 41, 9  # shifts within the tolerance, and between two of them
CLEAR = 50.0  # [nat] that a shift must explain beyond friction, and friction beyond a shift
FAST = 95.0  # percentile of speeds that counts as fast


def with_field_time(
    fit: Sequence[ArmRecording], held_out: Sequence[ArmRecording]
) -> tuple[list[ArmRecording], list[ArmRecording], list[str]]:
    """Recordings whose commands are stamped when a stepper's field was there, and what was done.

    One shift for all, from the fitted ones alone, within what stamps are tolerated; none where it is in
    doubt, or so small that its torque is in proportion to it, nor where no field is fast.

    Args:
        fit: recordings of one arm.
        held_out: of the same arm.
    """
    fields = [field for field in map(_field, fit) if field is not None]
    if not fields:
        return list(fit), list(held_out), []
    most = max(field.tolerance_s for field in fields)
    if max(field.turned(most) for field in fields) <= FAR:
        return list(fit), list(held_out), []
    alone, rubbing = _best(fields, most, rubs=False), _best(fields, most, rubs=True)
    # A straight piece of the sine is friction's twin: friction must earn its place beside a shift.
    more = _log_likelihood(fields, rubbing, rubs=True) - _log_likelihood(fields, alone, rubs=False)
    shift = rubbing if more >= CLEAR else alone
    gain = _log_likelihood(fields, shift, rubs=more >= CLEAR) - _log_likelihood(fields, 0.0, rubs=True)
    if gain < CLEAR or max(field.turned(shift) for field in fields) <= STRAIGHT:
        return list(fit), list(held_out), []
    note = (
        f"the stepper's field follows the logged command by {1e3 * shift:+.2f} ms, within the"
        f" {1e3 * most:.2g} ms that stamps may be off by: the command is taken so much later"
    )
    return [_later(r, shift) for r in fit], [_later(r, shift) for r in held_out], [note]


def straight_time(motion: RecordedMotion, most: float) -> float:
    """Shift [s] over which a torque is differenced: `most`, or what keeps a fast field in proportion."""
    fastest = _field_speed(motion)
    return most if fastest * most <= FAR else STRAIGHT / fastest


def _field_speed(motion: RecordedMotion) -> float:
    """How fast the fastest field turns [rad/s]; 0 without one."""
    if motion.controller is None:
        return 0.0
    pitch = motion.controller.law.of_joints("pole_pitch", motion.joints)
    return float(np.max(pitch * np.percentile(np.abs(motion.full_velocity), FAST, axis=0)))


@dataclass(frozen=True, eq=False)
class _Field:
    """A recording of joints that a field turns."""

    motion: RecordedMotion
    residual: np.ndarray  # (N, J) of the dynamics, with the command as stamped
    otherwise: tuple[np.ndarray, ...]  # (N, J) friction per unit
    driven: np.ndarray  # joints
    tolerance_s: float

    def turned(self, shift: float) -> float:
        """Angle [rad] by which a shift [s] is off at speed."""
        return abs(shift) * _field_speed(self.motion)

    def log_likelihood(self, shift: float, *, rubs: bool) -> float:
        """Of what stays at a shift, with a noise level of its own for each joint (profile likelihood).

        `rubs` takes off friction of any size.
        """
        left = self.residual - self.motion.reduce(late_law_change(self.motion, shift))
        offset, others = np.ones(len(left)), self.otherwise if rubs else ()
        return sum(
            explained_log_likelihood(left[:, j], [offset, *(x[:, j] for x in others)]) for j in self.driven
        )


def _field(recording: ArmRecording) -> _Field | None:
    controller = recording.arm.controller
    if controller is None or recording.arm.urdf is None or recording.command is None:
        return None
    driven = np.flatnonzero(controller.law.of_joints("pole_pitch", len(recording.arm.joints)))
    if not len(driven):
        return None
    motion = RecordedMotion(recording, RigidArm(recording.arm))
    if not motion.computed or motion.command is None:
        return None
    residual = form_equations(motion).residual["dynamics"]
    speed = motion.sure_velocity
    rubs = (speed, smooth_sign(speed, NOMINAL_SIGN))
    tolerated = max(recording.arm.tolerances.stamp, 0.5 / motion.rate)
    return _Field(motion, residual, tuple(motion.reduce(x) for x in rubs), driven, tolerated)


def _best(fields: Sequence[_Field], most: float, *, rubs: bool) -> float:
    """The likeliest shift [s] within `most`."""
    coarse = np.linspace(-most, most, COARSE)
    best, step = _likeliest(fields, coarse, rubs), coarse[1] - coarse[0]
    return _likeliest(fields, np.clip(best + step * np.linspace(-1.0, 1.0, FINE), -most, most), rubs)


def _likeliest(fields: Sequence[_Field], shifts: np.ndarray, rubs: bool) -> float:
    return float(shifts[np.argmax([_log_likelihood(fields, float(s), rubs=rubs) for s in shifts])])


def _log_likelihood(fields: Sequence[_Field], shift: float, *, rubs: bool) -> float:
    return sum(field.log_likelihood(shift, rubs=rubs) for field in fields)


def _later(recording: ArmRecording, shift: float) -> ArmRecording:
    """At the same stamps, what was commanded `shift` before: stamps by themselves are taken for jitter.

    Between two samples nobody knows on which microstep the command was: it is not rounded once more.
    """
    command, controller = recording.command, recording.arm.controller
    assert command is not None and controller is not None
    time = command.time

    def before(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        # Accelerations bend a command by more microsteps between two samples than a line may miss.
        return Akima1DInterpolator(time, values, axis=0)(np.clip(time - shift, time[0], time[-1]))

    position, velocity, effort = map(before, (command.position, command.velocity, command.effort))
    law = replace(controller.law, command_step=0.0)
    return replace(
        recording,
        arm=replace(recording.arm, controller=replace(controller, law=law)),
        command=replace(command, position=position, velocity=velocity, effort=effort),
    )
