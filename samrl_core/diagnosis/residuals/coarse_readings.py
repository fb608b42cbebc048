"""What the steps of a position reading make of accelerations, along the motion that was recorded.

Rounding is white noise while a joint passes many steps within the band's shortest period. One that turns back
or creeps stays within a step for longer: its error is then slow, and lies within the band. A filter that
expects accelerations' noise to rise with frequency raises it further, and an exact pendulum behind an encoder
of 4096 counts had a gap at its reversals.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.noise_color import NoiseColor

PHASES = 16  # places within a step at which the motion may lie; each is as probable
DITHERED = 0.6  # of a step: noise of more makes rounding white by itself


def coarse_steps(motion: RecordedMotion) -> np.ndarray:
    """Step (J,) of the readings that accelerations come from; 0 where none is, or noise makes it white."""
    if motion.raw_velocity is not None:
        return np.zeros(motion.joints)
    return np.where(motion.noise.position < DITHERED * motion.reading_step, motion.reading_step, 0.0)


def widen_where_coarse(
    sigma: np.ndarray, motion: RecordedMotion, inertia: np.ndarray, color: NoiseColor
) -> np.ndarray:
    """Noise (N, J) that is nowhere less than rounding makes of the recorded motion.

    Args:
        sigma: (N, J) otherwise [N m or N].
        motion: of the recording; nothing changes where no joint has a coarse step.
        inertia: (N, J, J) that turns accelerations into the channel's torque.
        color: that makes the noise of the channel white.
    """
    step = coarse_steps(motion)
    coarse = np.flatnonzero(step)
    if not len(coarse):
        return sigma
    steps = motion.full_position[:, coarse] / step[coarse]
    power = np.zeros_like(sigma)
    for k in range(PHASES):
        # Joints do not lie at the same place of their steps.
        phase = (np.mod(k * (2 * coarse + 1), PHASES) + 0.5) / PHASES
        error = np.zeros_like(motion.full_position)
        error[:, coarse] = (np.round(steps + phase) - steps - phase) * step[coarse]
        torque = np.einsum("nij,nj->ni", inertia, motion.acceleration_of(error)) / sigma
        power += np.stack([color.whitened(row, j) for j, row in enumerate(torque.T)], axis=1) ** 2
    # Nobody knows the place within a step: noise does not come and go from sample to sample.
    near = 1 + 2 * round(1.0 / (motion.band * motion.dt))
    power = ndimage.uniform_filter1d(power / PHASES, near, axis=0, mode="nearest")
    return sigma * np.sqrt(np.maximum(power, 1.0))
