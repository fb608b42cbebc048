"""Recordings of a cell's camera: colour, depth and mask, with the joints of both arms and the calibration."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.errors import InputError

LEAST_FRAMES = 6


@dataclass(frozen=True)
class ImageTolerances(StatedTolerances):
    """How far camera, cell and scene may be off and still count as nominal.

    Half widths of what is plausible, unless `stated_as` differs. Defaults are those of a cell that was
    calibrated with care: root three times the standard deviations of `typical` cell instances, whose sources
    stand in `samrl_core.cell.instance`.
    """

    camera_position: float = 0.0012  # of the camera in its flange, per axis [m]
    camera_rotation: float = 0.005  # per axis [rad]
    base_position: float = 0.0012  # of one arm's base in the other's, per axis [m]
    base_rotation: float = 0.0018  # per axis [rad]
    encoder: float = 0.0009  # zero of each joint [rad]
    focal: float = 0.005  # of each focal length, as a fraction
    centre: float = 0.005  # of the principal point, as a fraction of the image's size
    radial: float = 0.035  # Brown's k1 and k2
    tangential: float = 0.0009  # Brown's p1 and p2
    depth_scale: float = 0.007  # as a fraction
    depth_offset: float = 0.0018  # [m]
    depth_shift: float = 0.007  # of depth against colour, per image axis, as a fraction of the width
    depth_noise: float = 0.4  # of its standard deviation, logarithm
    depth_bend: float = 0.0005  # the same, smooth over the image, per mode: where a driver resamples depth
    depth_pattern: float = 0.0007  # the same per tile, lasting over frames
    stamp: float = 0.005  # of images against joint readings, constant [s]
    held_position: float = 0.001  # of the held part in the flange, per axis [m]
    held_rotation: float = 0.014  # per axis [rad]
    object_size: float = 0.01  # of the task's object, as a fraction
    object_height: float = 0.002  # of the object over the table [m]
    object_tilt: float = 0.012  # of the object, per axis [rad]
    outline: float = 1.0  # by which a segmenter's outlines lie outside of the true ones [px]
    outline_bend: float = 0.001  # of outlines, smooth over the image, per mode, as a fraction of the width
    brightness: float = 0.17  # of light and exposure together, as a fraction
    tint: float = 0.09  # of the light's hue: red up and blue down, or both up and green down, as a fraction
    shading: float = 0.12  # of how well the object is lit against how it is drawn, as a fraction
    paint: float = 0.06  # of each of the object's colours against its CAD colour, 1 is white
    table_paint: float = 0.3  # of the table's grey and hue: nobody states them, and shadows lie on it


@dataclass(frozen=True, eq=False)
class ImageRecording:
    """Images at increasing stamps, and where the joints were.

    Raises:
        InputError: shapes that do not fit, too few frames, or stamps that do not increase.
    """

    name: str
    source: str
    sha256: str
    task: str  # whose scene the camera sees, by name
    cell: str  # arms and their shapes, by name
    intrinsics: Intrinsics
    camera_in_flange: Pose
    camera_base_in_world: Pose
    tool_base_in_world: Pose
    time: np.ndarray  # (N,) stamps of the images [s]
    color: np.ndarray  # (N, H, W, 3) uint8
    depth: np.ndarray  # (N, H, W) float32, NaN where there is none [m]
    mask: np.ndarray  # (N, H, W) uint8 labels
    camera_joint_time: np.ndarray  # (M,) [s]
    camera_joints: np.ndarray  # (M, J) [rad]
    tool_joint_time: np.ndarray  # (K,) [s]
    tool_joints: np.ndarray  # (K, J) [rad]
    camera: str = "camera"
    tolerances: ImageTolerances = field(default_factory=ImageTolerances)

    def __post_init__(self) -> None:
        n, size = len(self.time), (self.intrinsics.height, self.intrinsics.width)
        if n < LEAST_FRAMES:
            raise InputError(
                f"{self.name} has {n} images with depth and mask, at least {LEAST_FRAMES} needed"
            )
        shapes = {"color": (n, *size, 3), "depth": (n, *size), "mask": (n, *size)}
        for name, shape in shapes.items():
            if np.shape(getattr(self, name)) != shape:
                raise InputError(
                    f"{self.name}: {name} has shape {np.shape(getattr(self, name))}, camera_info and stamps"
                    f" say {shape}"
                )
        for name in ("time", "camera_joint_time", "tool_joint_time"):
            stamps = getattr(self, name)
            if len(stamps) < 2 or not float(np.min(np.diff(stamps))) > 0:
                raise InputError(f"{self.name}: {name} must hold two stamps or more that increase")
        for name in ("camera", "tool"):
            joints, stamps = getattr(self, f"{name}_joints"), getattr(self, f"{name}_joint_time")
            if len(joints) != len(stamps) or not np.isfinite(joints).all():
                raise InputError(
                    f"{self.name}: {name}_joints has shape {joints.shape}, must be finite, one a stamp"
                )

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.time[-1] - self.time[0])

    def joints_at(self, arm: str, time: float) -> np.ndarray:
        """Positions (J,) of `camera` or `tool` at a time, between readings [rad]."""
        stamps, values = getattr(self, f"{arm}_joint_time"), getattr(self, f"{arm}_joints")
        return np.array([np.interp(time, stamps, values[:, j]) for j in range(values.shape[1])])

    def part(self, keep: np.ndarray) -> ImageRecording:
        """The frames of a mask or of indices (K,)."""
        return replace(
            self, time=self.time[keep], color=self.color[keep], depth=self.depth[keep], mask=self.mask[keep]
        )
