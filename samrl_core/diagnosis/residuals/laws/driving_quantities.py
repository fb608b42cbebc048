"""Quantities of a joint's motion and effort along which a residual may change."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.motion import RecordedMotion


def quantities_of(motion: RecordedMotion, effort: np.ndarray | None, joint: int) -> dict[str, np.ndarray]:
    """Quantities (N,) of a joint, by what they are called [rad, rad/s, rad/s2, N m, s].

    `effort` (N, J) [N m] is what its drives were asked for; None if nobody knows.
    """
    q, dq = motion.q[:, joint], motion.dq[:, joint]
    found = {
        "sign of velocity": np.tanh(dq / 0.01),
        "velocity": dq,
        "acceleration": motion.ddq[:, joint],
        "position": q,
        "sine of position": np.sin(q),
        "cosine of position": np.cos(q),
        "velocity squared, signed": dq * np.abs(dq),
        "time": motion.t - motion.t[0],
    }
    if effort is not None:
        found["commanded effort"] = effort[:, joint]
        found["rate of commanded effort"] = motion.derivative(effort[:, joint])
    return found
