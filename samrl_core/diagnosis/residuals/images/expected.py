"""What images from given views would tell, before any is taken: columns of the model's own renderings.

A view's Fisher information is J' J over the noise of its rows (Gaussian noise). Views are worth the logarithm
of the posterior's volume that they take away, Bayesian D-optimality (Chaloner and Verdinelli 1995, eq. 5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import subspace_angles

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.image_recording import LEAST_FRAMES, ImageRecording, ImageTolerances
from samrl_core.diagnosis.residuals.images.frames import compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2
from samrl_core.diagnosis.residuals.images.noise import FREE
from samrl_core.diagnosis.residuals.images.rows import ComparedFrame, Rows, frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.images.spreads import SIZES, stated_spreads

NOISE = {"depth": 0.0022, "mask": 0.52, "color": 0.065}  # of tiles, per shape: medians over typical cells
OPEN = (  # nobody states them
    "object", "light", "tint", "shading", "paint_object", "paint_static", "white_object", "white_static",
)  # fmt: skip
# What may be the cause; all else is within its tolerance.
CAUSES = (
    "hand_eye", "base", "camera_zeros", "tool_zeros", "focal", "centre", "radial", "tangential",
    "depth_scale", "depth_offset", "object_scale",
)  # fmt: skip
LEFT_OUT = ("depth_pattern", "depth_noise")  # 128 columns that no view tells from each other; no motion


def still_recording(task: str, cell: str, joints: Mapping[str, np.ndarray]) -> ImageRecording:
    """A recording without content: both arms stand; for geometry alone."""
    spec = cell_named(cell)
    k = spec.intrinsics
    shape = (LEAST_FRAMES, k.height, k.width)
    time = np.linspace(0.0, 1.0, LEAST_FRAMES)
    ends = np.array([-1.0, 2.0])
    return ImageRecording(
        "expected", "", "", task, cell, k, spec.camera_in_flange, spec.camera_base_in_world,
        spec.tool_base_in_world, time, np.zeros((*shape, 3), np.uint8), np.full(shape, np.nan, np.float32),
        np.zeros(shape, np.uint8), ends, np.stack([joints["camera_arm"]] * 2), ends,
        np.stack([joints["tool_arm"]] * 2),
    )  # fmt: skip


def expected_scene(recording: ImageRecording) -> ImageScene:
    """The scene in the size in which its images would be compared."""
    return ImageScene(recording, compared_size(recording.intrinsics)[0])


def expected_rows(scene: ImageScene, recording: ImageRecording, time: float) -> dict[str, Rows]:
    """Rows of an image at a time of a recording, as the model itself sees it, object and lens as stated."""
    view = scene.view(recording, time)
    vertices = scene.vertices(view, np.eye(4))
    rendered, shaded = scene.render(vertices), scene.render(vertices, shaded=True)
    depth = rendered.xyz.numpy()[..., 2].astype(float)
    depth[~np.isfinite(rendered.depth.numpy())] = np.nan
    frame = ComparedFrame(shaded.color.numpy(), depth, rendered.label.numpy(), view)
    return frame_rows(scene, frame, np.eye(4), DEPTH_NOISE_PER_Z2)


def stacked_columns(frames: Sequence[Mapping[str, Rows]], name: str) -> np.ndarray:
    """Columns (N, p) of a name over all rows of all frames, in units of their noise."""
    parts = []
    for made in frames:
        for channel, noise in NOISE.items():
            rows = made[channel]
            empty = np.zeros((SIZES[name], len(rows.value)))
            parts.append((rows.columns.get(name, empty) / (noise * rows.shape)).T)
    return np.concatenate(parts)


class ViewInformation:
    """The information of views that were taken, and what one more would add; `camera_motion` asks for it."""

    def __init__(self, task: str, cell: str, joints: Mapping[str, np.ndarray]) -> None:
        """Begin without any, from where both arms stand (J,) [rad]."""
        self._still = still_recording(task, cell, joints)
        self._scene = expected_scene(self._still)
        stated = stated_spreads(ImageTolerances())
        self._names = [n for n in stated if n not in LEFT_OUT]
        self._widths = np.concatenate(
            [np.full(SIZES[n], FREE[n]) if n in (*CAUSES, *OPEN) else stated[n] for n in self._names]
        )
        self._total = np.eye(len(self._widths))

    def gain(self, joints: Mapping[str, np.ndarray]) -> float:
        """Information [nat] that a view from these joints would add."""
        more = np.linalg.slogdet(self._total + self._of(joints))[1]
        return 0.5 * float(more - np.linalg.slogdet(self._total)[1])

    def take(self, joints: Mapping[str, np.ndarray]) -> None:
        """Count a view."""
        self._total = self._total + self._of(joints)

    @property
    def nat(self) -> float:
        """Information of all views that were taken [nat]."""
        return 0.5 * float(np.linalg.slogdet(self._total)[1])

    def deviations(self, name: str) -> np.ndarray:
        """Standard deviations (p,) of a name's amplitudes after the views, all else open as stated."""
        starts = np.concatenate([[0], np.cumsum([SIZES[n] for n in self._names])])
        k = self._names.index(name)
        covariance = np.linalg.inv(self._total)
        block = slice(int(starts[k]), int(starts[k + 1]))
        return self._widths[block] * np.sqrt(np.diag(covariance)[block])

    def _of(self, joints: Mapping[str, np.ndarray]) -> np.ndarray:
        at = replace(
            self._still,
            camera_joints=np.stack([joints["camera_arm"]] * 2),
            tool_joints=np.stack([joints["tool_arm"]] * 2),
        )
        rows = [expected_rows(self._scene, at, 0.5)]
        design = np.concatenate([stacked_columns(rows, n) for n in self._names], axis=1) * self._widths
        return design.T @ design


Parts = Sequence[Mapping[str, float]]  # of an effect: names of columns times factors, added up in each part


def smallest_angle(frames: Sequence[Mapping[str, Rows]], first: Parts, second: Parts) -> float:
    """Smallest angle [deg] between what two effects do to the images, object and exposure open.

    NaN where one of them does nothing.
    """
    free = np.concatenate([stacked_columns(frames, n) for n in OPEN], axis=1)
    basis, sizes, _ = np.linalg.svd(free, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes.max()]
    spaces = []
    for parts in (first, second):
        columns = np.concatenate([_added(frames, names) for names in parts], axis=1)
        left = columns - basis @ (basis.T @ columns)
        before, norms = np.linalg.norm(columns, axis=0), np.linalg.norm(left, axis=0)
        shown = norms > np.maximum(1e-6 * before, 1e-12)
        spaces.append(left[:, shown] / norms[shown])
    if any(s.shape[1] == 0 for s in spaces):
        return float("nan")
    return float(np.degrees(np.min(subspace_angles(*spaces))))


def _added(frames: Sequence[Mapping[str, Rows]], names: Mapping[str, float]) -> np.ndarray:
    return np.sum([factor * stacked_columns(frames, name) for name, factor in names.items()], axis=0)
