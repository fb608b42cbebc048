"""What a drive's residual says of a joint at rest: little, as friction holds whatever there is to hold."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.noise_color import NoiseColor

REST_SPEED = 0.004  # [rad/s] below it friction is whatever holds the arm, between its two bounds
REST_SHARE = 0.01  # of the effort limit: how far friction at rest may be from any formula


def widen_at_rest(
    sigma: np.ndarray, motion: RecordedMotion, scale: np.ndarray, color: NoiseColor
) -> np.ndarray:
    """Noise (N, J) of drives with what friction holds at rest, anything between its bounds, in it.

    Nor do samples say much at which torque was switched: within one nobody knows when.

    Args:
        sigma: (N, J) otherwise [N m or N].
        motion: of the recording.
        scale: (J,) effort limits.
        color: that makes the noise of the channel white.
    """
    speed = motion.sure_velocity
    # A speed tells rest no better than its noise allows, recorded or differenced.
    recorded = motion.raw_velocity is not None
    noise = motion.band_share * motion.noise.velocity**2 if recorded else motion.velocity_noise()
    slow = np.hypot(REST_SPEED, 2.0 * np.sqrt(noise))
    resting = motion.reduce(np.exp(-((speed / slow) ** 2)))
    # Nor than its own filter leaves of a stop: that cuts off what does not stand out of noise.
    missed = np.abs(motion.dq - motion.reduce(speed))
    missed = np.where(missed > 3.0 * np.sqrt(noise), missed, 0.0)  # what it cuts off besides is noise
    window = 1 + 2 * round(0.5 / (motion.band * motion.dt))
    unsure = np.hypot(slow, 2.0 * ndimage.maximum_filter1d(missed, window, axis=0))
    resting = np.maximum(resting, np.exp(-((motion.dq / unsure) ** 2)))
    # Stated friction holds from one bound to the other, where its formula turns. It is slow: a filter that
    # makes the noise of accelerations white would raise it above what is allowed here.
    held = np.hypot(REST_SHARE * scale, 2.0 * joint_dynamics(motion.recording.arm).friction) * color.raised
    sigma = np.hypot(sigma, held * np.clip(resting, 0.0, 1.0))
    switched = np.abs(np.diff(motion.enabled, axis=0, prepend=motion.enabled[:1]))
    if not np.any(switched):
        return sigma
    near = switched + np.roll(switched, 1, axis=0) + np.roll(switched, -1, axis=0)
    return np.hypot(sigma, scale * np.abs(motion.reduce(near)))
