"""Light so strong that colours are at the end of their range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2
from samrl_core.diagnosis.residuals.images.rows import frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene

GAIN = 2.2


def test_a_colour_at_the_end_of_its_range_does_not_deny_the_light(recordings: list[ImageRecording]) -> None:
    scene = ImageScene(recordings[0], compared_size(recordings[0].intrinsics)[0])
    frame = chosen_frames(scene, recordings[0])[0]
    lit = GAIN * frame.color
    cut, before = (
        frame_rows(scene, replace(frame, color=color), np.eye(4), DEPTH_NOISE_PER_Z2)["color"]
        for color in (np.minimum(lit, 1.0), frame.color)
    )
    assert np.mean(lit > 1.0) > 0.2, "nothing is cut off: the test shows nothing"
    light, slope = cut.columns["light"][0], before.columns["light"][0]
    same = len(light) == len(slope)
    assert same and np.all(light <= slope + 1e-12) and np.any(light < 0.8 * slope)
    # One size explains what light does to all tiles, cut off or not.
    grown = cut.value - before.value
    found, steep = (float(x @ grown / (x @ x)) for x in (light, slope))
    share = float(np.median(1.0 + before.value / slope))  # of the light that the model expects
    assert abs(found / share - (GAIN - 1.0)) < 0.15
    assert np.std(grown - found * light) < 0.6 * np.std(grown - steep * slope)
