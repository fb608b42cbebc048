"""System identification without a diagnosis: all numbers of a cell's correction fitted to images at once.

What SimOpt does (Chebotar et al. 2019, "Closing the Sim-to-Real Loop"): one wide Gaussian over all parameters
of the simulation, moved until rendered and recorded observations agree. There the parameters are sampled,
because the simulator has no gradients; here they are found by Gauss-Newton on the renderer's own, from the
same frames, residuals and noise as the diagnosis has them, so that nothing but the selection differs. What a
correction does not hold (zeros of joints, clocks, the held part, paint) is left open as far as the diagnosis
lets it be off. Nothing is named, and nothing is left at its stated value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.calibration.cell_correction import NUMBERS, CellCorrection
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.pose import Pose
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2
from samrl_core.diagnosis.residuals.images.linearisation import (
    OF_LENS,
    linearised,
    most_probable,
    rows_at,
)
from samrl_core.diagnosis.residuals.images.object_pose import solved_object
from samrl_core.diagnosis.residuals.images.rows import CHANNELS, joined
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.poses import rigid

OF_CORRECTION = ("hand_eye", "base", "depth_scale", "depth_offset", *OF_LENS)


def fit_at_once(recordings: Sequence[ImageRecording]) -> CellCorrection:
    """The correction of which the recordings are most probable; numbers beyond `NUMBERS` end there.

    Args:
        recordings: of one camera and scene.

    Raises:
        InputError: the object is in no image.
    """
    first = recordings[0]
    scene = ImageScene(first, compared_size(first.intrinsics)[0])
    frames = [frame for recording in recordings for frame in chosen_frames(scene, recording)]
    pose = solved_object(scene, frames, first.tolerances, DEPTH_NOISE_PER_Z2)
    stated, noise = first.tolerances, DEPTH_NOISE_PER_Z2
    point = linearised(scene, frames, pose, noise, stated, OF_CORRECTION)
    made = [rows_at(scene, frame, pose, noise, point) for frame in frames]
    rows = {c: joined([m[c] for m in made]) for c in CHANNELS}
    found = most_probable({c: r for c, r in rows.items() if len(r.value)}, stated, OF_CORRECTION)
    numbers = {name: float(found[name][0]) for name in ("depth_scale", "depth_offset")}
    for group, names in OF_LENS.items():
        numbers |= dict(zip(names, map(float, found[group]), strict=True))
    bases = first.camera_base_in_world.inverse() @ first.tool_base_in_world
    return CellCorrection(
        _moved(first.camera_in_flange, found["hand_eye"]),
        _moved(bases, found["base"]),
        {name: float(np.clip(value, -NUMBERS[name], NUMBERS[name])) for name, value in numbers.items()},
    )


def _moved(stated: Pose, twist: np.ndarray) -> Pose:
    return Pose.from_matrix(stated.matrix() @ rigid.exp(twist)[0])
