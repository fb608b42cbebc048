"""What noisy positions leave in torques: by the accelerations and the springs that are made of them."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.signal_noise import is_fast, unknown_acceleration
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm


def acceleration_noise(motion: RecordedMotion, rigid: RigidArm) -> np.ndarray:
    """Torque noise (J,) that band-limited noisy accelerations leave in inverse dynamics."""
    variance = motion.acceleration_noise(0.0, motion.band)
    some = motion.q[:: max(1, len(motion.q) // 20)]
    mass = np.mean(rigid.mass_matrix(some) ** 2, axis=0)
    return np.sqrt(mass @ variance)


def spring_noise(motion: RecordedMotion, rigid: RigidArm) -> np.ndarray:
    """Torque noise (J,) of stated springs: what they make of the readings' noise, or of a coarse step.

    A joint that is slow stays within a step for long, and no filter takes the error of that off.
    """
    noise = np.sqrt(motion.band_share) * motion.noise.position
    return np.abs(rigid.spring_stiffness) * np.maximum(noise, motion.reading_step / np.sqrt(12.0))


def unknown_wider(sigma: np.ndarray, motion: RecordedMotion, rigid: RigidArm) -> np.ndarray:
    """A slow log knows some accelerations no better than half of its samples would."""
    if is_fast(motion.rate):
        return sigma
    reading = motion.reading
    unknown = np.abs(motion.reduce(unknown_acceleration(reading.values, motion.rate, reading.order)))
    mass = np.abs(rigid.mass_matrix(motion.q)) + np.diag(joint_dynamics(motion.recording.arm).armature)
    return np.hypot(sigma, np.einsum("nij,nj->ni", mass, unknown))
