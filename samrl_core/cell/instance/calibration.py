"""Calibration: where camera, arms and joint zeros really are, against what the cell was calibrated to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.instance.difference import difference

_HAND_EYE = (
    "Zivid, hand-eye residuals: below 1 mm and 1 deg for small arms if right; 3.2 mm, 0.76 deg on average"
    " with a sagging mount"
)
_BASES = "ASSUMPTION: two arms registered by touching points, three times the touch's 0.5 mm when careless"
_ZEROS = (
    "libfranka issue 53 and robot-arm-kinematic-calibration issue 1: Pandas are 10 mm off in places; encoder"
    " zeros stand for all of the kinematic error here, 0.5 mrad at 0.8 m is 0.4 mm"
)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Errors of what was calibrated: true = nominal and error."""

    hand_eye_position: np.ndarray = difference(
        "camera in its flange, along the flange's axes", "m", "normal", 0.0007, 0.003, _HAND_EYE, (3,)
    )
    hand_eye_rotation: np.ndarray = difference(
        "camera in its flange, rotation vector", "rad", "normal", 0.003, 0.012, _HAND_EYE, (3,)
    )
    camera_base_position: np.ndarray = difference(
        "base of the camera arm in world", "m", "normal", 0.0007, 0.003, _BASES, (3,)
    )
    camera_base_rotation: np.ndarray = difference(
        "base of the camera arm in world, rotation vector", "rad", "normal", 0.001, 0.004, _BASES, (3,)
    )
    tool_arm_zeros: np.ndarray = difference(
        "encoder zeros of the tool arm: what is read less what is",
        "rad",
        "normal",
        0.0005,
        0.002,
        _ZEROS,
        ("tool_arm",),
    )
    camera_arm_zeros: np.ndarray = difference(
        "encoder zeros of the camera arm: what is read less what is",
        "rad",
        "normal",
        0.0005,
        0.002,
        _ZEROS,
        ("camera_arm",),
    )

    def zeros(self, role: str) -> np.ndarray:
        """Encoder zeros of an arm (J,) [rad]."""
        return {"tool_arm": self.tool_arm_zeros, "camera_arm": self.camera_arm_zeros}[role]
