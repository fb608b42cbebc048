"""What rounded logs leave in the torque of a law that read its positions more finely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.residuals.laws.control_law import position_error, squared_rounding_error
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.signal_noise import sample_detail

LONGEST_S = 1.0  # ASSUMPTION: so long a slow axis keeps a reading, and its error


def rounding_noise(motion: RecordedMotion, raw: np.ndarray) -> np.ndarray:
    """Standard deviation (J,) of what rounded positions leave in a law less the recorded effort (F, J) [N m].

    Differences of neighbours do not show it while an axis is slow. No more than the residual shows over some
    time: a drive that reads the log's own counts leaves nothing.
    """
    assert motion.controller is not None
    most = motion.controller.stiffness * motion.reading_step / np.sqrt(12.0)
    longest = min(LONGEST_S * motion.rate, (len(raw) - 1) / 2)
    strides = [2**k for k in range(int(np.log2(max(longest, 1.0))) + 1)]
    return np.minimum(most, np.max([sample_detail(raw, s) for s in strides], axis=0))


def widen_where_held(sigma: np.ndarray, motion: RecordedMotion, rounded: np.ndarray) -> np.ndarray:
    """Noise (N, J), larger where a reading is kept: its error, of deviation (J,), is then not white.

    As white noise over the band it is in `sigma` already.
    """
    if not np.any(rounded > 0):
        return sigma
    found = motion.reduce_variance(np.broadcast_to(rounded**2, motion.kept.shape), motion.kept)
    return np.hypot(sigma, np.sqrt(np.maximum(found - motion.band_share * rounded**2, 0.0)))


def widen_at_edges(sigma: np.ndarray, motion: RecordedMotion) -> np.ndarray:
    """Noise (N, J) of a law's torque, larger where readings may lie on either side of a dead band's edge."""
    controller, command, read = motion.controller, motion.command, motion.raw_position
    assert controller is not None and command is not None and read is not None
    assert command.position is not None
    wide = replace(controller, law=replace(controller.law, dead_band=0.0))
    error = position_error(wide, command.position, read)
    variance = squared_rounding_error(controller, error, motion.reading_step)
    if not np.any(variance > 0):
        return sigma
    return np.hypot(sigma, np.sqrt(motion.reduce_variance(variance, motion.kept)))
