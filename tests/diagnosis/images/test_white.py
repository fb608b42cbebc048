"""Light on painted surfaces, and so strong that colours are at the end of their range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2
from samrl_core.diagnosis.residuals.images.rows import frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene

DIM, GAIN = 0.4, 2.2


def test_light_has_one_size_on_any_paint_and_where_colours_end_at_white(
    recordings: list[ImageRecording],
) -> None:
    scene = ImageScene(recordings[0], compared_size(recordings[0].intrinsics)[0])
    frame = chosen_frames(scene, recordings[0])[0]
    before, dim, cut = (
        frame_rows(scene, replace(frame, color=color), np.eye(4), DEPTH_NOISE_PER_Z2)["color"]
        for color in (np.minimum(g * frame.color, 1.0) for g in (1.0, DIM, GAIN))
    )
    (light,) = before.columns["light"]
    assert np.ptp(before.value / light) > 0.3, "all paint is as expected: the test shows nothing"
    np.testing.assert_allclose(dim.value - before.value, light * np.log(DIM), atol=1e-6)
    assert np.mean(GAIN * frame.color > 1.0) > 0.2, "nothing is cut off: the test shows nothing"
    np.testing.assert_allclose(cut.columns["light"][0], light)
    assert abs(np.median((cut.value - before.value) / light) - np.log(GAIN)) < 0.1
    as_cut = np.log(np.minimum(GAIN * frame.color, 1.0).mean() / frame.color.mean())
    assert np.log(GAIN) - as_cut > 0.15, "colours as they are would say the same: the test shows nothing"
