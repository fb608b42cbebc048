"""What the cell believes at one instant, and what is asked of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.camera import Camera
from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class ArmReading:
    """One reading of an arm's joint sensors."""

    stamp_ns: int  # time of the measurement [ns]
    position: np.ndarray  # (J,) [rad]
    velocity: np.ndarray  # (J,) [rad/s]
    effort: np.ndarray  # (J,) link-side torque, gravity included [N m]


@dataclass(frozen=True, eq=False)
class ArmCommand:
    """One point that an arm's controller tracks, valid at `stamp_ns`."""

    stamp_ns: int  # time of validity [ns]
    position: np.ndarray  # (J,) [rad]
    velocity: np.ndarray  # (J,) [rad/s]
    acceleration: np.ndarray  # (J,) [rad/s2]
    effort: np.ndarray  # (J,) feed-forward torque without gravity [N m]


@dataclass(frozen=True, eq=False)
class Frame:
    """One RGB-D reading with its segmentation, aligned to the colour camera."""

    stamp_ns: int  # [ns]
    color: np.ndarray  # (H, W, 3) uint8
    depth: np.ndarray  # (H, W) float32 [m], NaN where unmeasured
    mask: np.ndarray  # (H, W) uint8 segmentation label, 0 background


@dataclass(frozen=True, eq=False)
class Observation:
    """A frame with the camera pose and arm readings of the same stamp, from measured joints.

    Raises:
        InputError: an image is empty, of the wrong shape or type, or has no finite depth at all.
    """

    frame: Frame
    camera: Camera  # pose computed from measured joints and the nominal calibration
    tool_arm: ArmReading
    camera_arm: ArmReading

    def __post_init__(self) -> None:
        k = self.camera.intrinsics
        shape = (k.height, k.width)
        f = self.frame
        for name, image, expected, dtype in (
            ("color", f.color, (*shape, 3), np.uint8),
            ("depth", f.depth, shape, np.float32),
            ("mask", f.mask, shape, np.uint8),
        ):
            if image.shape != expected or image.dtype != dtype:
                raise InputError(
                    f"{name} image is {image.shape} {image.dtype}, camera_info promises {expected} "
                    f"{np.dtype(dtype)}; check the driver's encoding and resolution"
                )
        if not np.isfinite(f.depth).any():
            raise InputError("depth image has no finite pixel; check the depth stream and the exposure")

    @property
    def stamp_ns(self) -> int:
        """Stamp of the image [ns]."""
        return self.frame.stamp_ns
