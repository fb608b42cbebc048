"""Where the object stands: a nuisance that is solved at the nominal calibration and then stays open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.images.rows import LEAST_PIXELS, ComparedFrame, frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.images.spreads import object_spreads
from samrl_core.diagnosis.residuals.poses import rigid

COARSE_ROUNDS, FINE_ROUNDS = 4, 3
FRAMES = 8  # that the pose is solved from
NOISE = {"depth": 0.002, "mask": 0.6}


def solved_object(
    scene: ImageScene, frames: Sequence[ComparedFrame], stated: ImageTolerances, noise_per_z2: float
) -> np.ndarray:
    """Transform (4, 4) about the object's origin, in world's axes.

    Raises:
        InputError: the object is in no image.
    """
    step = max(1, len(frames) // FRAMES)
    used = list(frames[::step])[:FRAMES]
    pose = np.eye(4)
    for _ in range(COARSE_ROUNDS):
        shift = _middle_shift(scene, used, pose)
        pose[:2, 3] += shift[:2]
    # What is stated (height, tilt) stays as stated: its prior must not follow what a wrong depth makes of it.
    spread = object_spreads(stated) * np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    for _ in range(FINE_ROUNDS):
        design, y = [], []
        for frame in used:
            rows = frame_rows(scene, frame, pose, noise_per_z2)
            for channel, noise in NOISE.items():
                made = rows[channel]
                if len(made.value):
                    weight = 1.0 / (noise * made.shape / np.median(made.shape))
                    weight = weight / np.sqrt(1.0 + (made.value * weight / 3.0) ** 2)
                    design.append((made.columns["object"] * weight).T)
                    y.append(made.value * weight)
        a, b = np.concatenate(design) * spread, np.concatenate(y)
        twist = spread * np.linalg.solve(a.T @ a + np.eye(6), a.T @ b)
        small = rigid.exp(twist)[0]
        turned = np.eye(4)
        turned[:3, :3] = small[:3, :3] @ pose[:3, :3]
        turned[:3, 3] = pose[:3, 3] + twist[:3]
        pose = turned
    return pose


def _middle_shift(scene: ImageScene, frames: Sequence[ComparedFrame], pose: np.ndarray) -> np.ndarray:
    """Mean difference (3,) between where the object's surface is seen and where the model has it [m]."""
    k = scene.intrinsics
    u, v = np.meshgrid((np.arange(k.width) + 0.5 - k.cx) / k.fx, (np.arange(k.height) + 0.5 - k.cy) / k.fy)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1)
    shifts = []
    for frame in frames:
        seen = (frame.mask == scene.target_label) & np.isfinite(frame.depth)
        rendered = scene.render(scene.vertices(frame.view, pose))
        model = rendered.color.numpy()[..., 0] > 0.99
        if min(seen.sum(), model.sum()) < LEAST_PIXELS:
            continue
        turn = frame.view.camera[:3, :3]
        there = np.median((rays * frame.depth[..., None])[seen], axis=0)
        here = np.median(rendered.xyz.numpy()[model], axis=0)
        shifts.append(turn @ (there - here))
    if not shifts:
        raise InputError(
            f"the object {scene.body} (label {scene.target_label}) is in no image, or not where the task may"
            " put it; check the mask's labels, the calibration and --scene"
        )
    return np.median(shifts, axis=0)
