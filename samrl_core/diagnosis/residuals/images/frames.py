"""Which frames of a recording are compared, and in which size."""

from __future__ import annotations

import cv2
import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.residuals.images.rows import ComparedFrame
from samrl_core.diagnosis.residuals.images.scene import FrameGeometry, ImageScene

MOST_FRAMES = 24  # of one recording
CANDIDATES = 150
WIDTH = 160  # images are halved until they are no wider [px]
# By how much two frames must differ to count as far apart as each other: metres, radians, metres per second.
_PLACE, _TURN, _RATE = 0.15, 0.4, 0.05
_EDGE_S = 0.05  # at both ends, where velocities are not known


def compared_size(k: Intrinsics) -> tuple[Intrinsics, int]:
    """The lens for smaller images, and by which factor they are smaller."""
    factor = 1
    while k.width // factor > WIDTH and k.width % (2 * factor) == 0 and k.height % (2 * factor) == 0:
        factor *= 2
    f = float(factor)
    return Intrinsics(k.width // factor, k.height // factor, k.fx / f, k.fy / f, k.cx / f, k.cy / f), factor


def chosen_frames(scene: ImageScene, recording: ImageRecording) -> list[ComparedFrame]:
    """Frames that differ most in where camera and tool are and how fast they move, in order of time.

    Farthest points first (Gonzalez 1985): each next frame is the one that is least like those before.
    """
    known = (recording.camera_joint_time, recording.tool_joint_time)
    begin = max(float(t[0]) for t in known) + _EDGE_S
    end = min(float(t[-1]) for t in known) - _EDGE_S
    usable = np.flatnonzero((recording.time >= begin) & (recording.time <= end))
    candidates = (
        usable[np.unique(np.linspace(0, len(usable) - 1, CANDIDATES).astype(int))] if len(usable) else usable
    )
    views = [scene.view(recording, float(recording.time[i])) for i in candidates]
    labels = (scene.target_label,)
    shown = [bool(np.isin(recording.mask[i], labels).any()) for i in candidates]
    pairs = [(int(i), v) for i, v, s in zip(candidates, views, shown, strict=True) if s]
    if not pairs:
        return []
    features = np.stack([_features(view) for _, view in pairs])
    picked = [0]
    distance = np.linalg.norm(features - features[0], axis=1)
    while len(picked) < min(MOST_FRAMES, len(pairs)):
        picked.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(features - features[picked[-1]], axis=1))
    return [_reduced(scene, recording, *pairs[k]) for k in sorted(set(picked))]


def _features(view: FrameGeometry) -> np.ndarray:
    rate = view.camera_rate.copy()
    rate[:3] += np.cross(rate[3:], [0.0, 0.0, 0.35])
    tool = view.tool_rate[:3] + np.cross(view.tool_rate[3:], view.flange[:3, 3])
    return np.concatenate(
        [view.camera[:3, 3] / _PLACE, view.camera[:3, :3].ravel() / _TURN, view.flange[:3, 3] / _PLACE,
         rate[:3] / _RATE, tool / _RATE]
    )  # fmt: skip


def _reduced(scene: ImageScene, recording: ImageRecording, index: int, view: FrameGeometry) -> ComparedFrame:
    """Colours averaged, depth and labels of the middle pixel: nobody mixes those."""
    k = scene.intrinsics
    factor = recording.intrinsics.width // k.width
    middle = factor // 2
    color = recording.color[index].astype(np.float32) / 255.0
    if factor > 1:
        color = cv2.resize(color, (k.width, k.height), interpolation=cv2.INTER_AREA)
    depth = recording.depth[index][middle::factor, middle::factor]
    mask = recording.mask[index][middle::factor, middle::factor]
    return ComparedFrame(color, np.asarray(depth, dtype=float), mask, view)
