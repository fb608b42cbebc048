"""The described controller along a recording: what it makes of a command and of the states that it read.

One formula for every kind (see `DriveLaw`); the terms stand apart because effects scale them one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import JointSignal

ROUNDED = tuple((x, 1.0 / 21.0) for x in np.linspace(-1.1, 1.1, 21).tolist())
"""Nodes and weights over a step of a reading, in half steps: so many that a punch at its edge is not missed.

A little beyond the step: a log's digits are rounded once more.
"""
WOUND = 0.3  # ASSUMPTION: share of the limit that an integral may have held when a recording began


@dataclass(frozen=True, eq=False)
class LawTerms:
    """Torque at standstill by its causes, each (F, J) [N m]; not clipped."""

    spring: np.ndarray  # what the stiffness makes of the error
    punch: np.ndarray  # sets in beyond the dead band, whatever the stiffness
    damper: np.ndarray
    integral: np.ndarray
    stiff_integral: np.ndarray  # the part of the integral that the stiffness scales too
    rest: np.ndarray  # feed-forward and gravity

    @property
    def total(self) -> np.ndarray:
        """What the controller asks for before its limit."""
        return self.spring + self.punch + self.damper + self.integral + self.rest


def position_error(controller: ArmController, command: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Error (F, J) that the spring feels: rounded command less position, less the dead band."""
    joints, law = position.shape[1], controller.law
    step = law.of_joints("command_step", joints)
    rounded = np.where(step > 0, np.round(command / np.where(step > 0, step, 1.0)) * step, command)
    return dead_zone(controller, rounded - position)


def dead_zone(controller: ArmController, error: np.ndarray) -> np.ndarray:
    """Error (F, J) less the dead band."""
    band = controller.law.of_joints("dead_band", error.shape[1])
    return np.sign(error) * np.maximum(np.abs(error) - band, 0.0)


def spring_torque(controller: ArmController, error: np.ndarray) -> np.ndarray:
    """Torque (F, J) of an error beyond the dead band."""
    joints, law = error.shape[1], controller.law
    pitch = law.of_joints("pole_pitch", joints)
    safe = np.where(pitch > 0, pitch, 1.0)
    straight = controller.stiffness * error
    return np.where(pitch > 0, controller.stiffness / safe * np.sin(safe * error), straight)


def punch_torque(controller: ArmController, error: np.ndarray) -> np.ndarray:
    """Torque (F, J) that sets in beyond the dead band, whatever the stiffness."""
    return controller.law.of_joints("punch", error.shape[1]) * np.sign(error)


def squared_rounding_error(controller: ArmController, error: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Mean squared error (F, J) of the torque that logged errors (F, J) make, by a reading's step (J,).

    The controller read more finely than the log: at a dead band's edge nobody knows on which side it was.
    What a straight spring would be off by is no part of it.
    """

    def torque(shift: np.ndarray | float) -> np.ndarray:
        beyond = dead_zone(controller, error + shift)
        return spring_torque(controller, beyond) + punch_torque(controller, beyond)

    logged = torque(0.0)
    squares = np.sum([w * (torque(0.5 * node * step) - logged) ** 2 for node, w in ROUNDED], axis=0)
    return np.maximum(squares - (controller.stiffness * step) ** 2 / 12.0, 0.0)


def law_terms(
    controller: ArmController,
    command: JointSignal,
    position: np.ndarray,
    velocity: np.ndarray,
    gravity: np.ndarray | float,
    limit: np.ndarray,
    period_s: float,
    enabled: np.ndarray,
) -> LawTerms:
    """The law's terms at measured states.

    Args:
        controller: gains and law.
        command: position, velocity and effort (F, J) on the states' samples.
        position: (F, J) as read.
        velocity: (F, J) as read.
        gravity: torque (F, J) that is compensated, or zero.
        limit: (J,) of the output; infinite where there is none.
        period_s: of the samples.
        enabled: (F, J) one where torque is on; integrals start anew with it.
    """
    assert command.position is not None and command.velocity is not None and command.effort is not None
    joints, law = position.shape[1], controller.law
    error = position_error(controller, command.position, position)
    lag = law.of_joints("velocity_share", joints) * command.velocity - velocity
    spring, damper = spring_torque(controller, error), controller.damping * lag
    punch, rest = punch_torque(controller, error), command.effort + gravity
    rate = law.of_joints("integral", joints) * error + law.of_joints("velocity_integral", joints) * lag
    integral = np.zeros_like(spring)
    for j in np.flatnonzero(np.any(rate != 0.0, axis=0)):
        others = spring[:, j] + punch[:, j] + damper[:, j] + rest[:, j]
        integral[:, j] = _integrated(rate[:, j] * period_s, others, float(limit[j]), enabled[:, j])
    stiff = np.zeros_like(spring)
    if law.cascaded:
        stiff = np.cumsum(law.of_joints("integral", joints) * error * period_s, axis=0)
    return LawTerms(spring, punch, damper, integral, stiff, rest)


def _integrated(steps: np.ndarray, others: np.ndarray, limit: float, enabled: np.ndarray) -> np.ndarray:
    """Running sum (F,) of steps that stands still while the output is clipped the same way."""
    whole = np.cumsum(steps)
    if np.all(np.abs(others + whole) <= limit) and np.all(enabled > 0):
        return whole
    out, held = [], 0.0
    for step, other, on in zip(steps.tolist(), others.tolist(), enabled.tolist(), strict=True):
        raw = other + held + step
        if on <= 0:
            held = 0.0
        elif abs(raw) <= limit or raw * step < 0:
            held += step
        out.append(held)
    return np.array(out)


def held_values(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The last of some values (N, J) at other times (F,); the first one before them."""
    index = np.searchsorted(time, at + 1e-9, side="right") - 1
    return values[np.clip(index, 0, len(values) - 1)]
