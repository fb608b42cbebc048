"""Light on painted surfaces, and so strong that colours are at the end of their range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2
from samrl_core.diagnosis.residuals.images.rows import frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.images.white import HUE, WHITE, without_white

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
    hidden = (cut.columns["white_object"] + cut.columns["white_static"]).sum(axis=0)
    assert not before.columns["white_static"].any() and np.mean(hidden > 0.02 * light) > 0.2
    for group in ("object", "static"):
        for of_color in cut.columns[f"white_{group}"] / light:
            assert len(np.unique(of_color[of_color > 0].round(9))) <= 1, "tiles of one surface differ"
    assert abs(np.median((cut.value - before.value) / light) - np.log(GAIN)) < 0.1
    as_cut = np.log(np.minimum(GAIN * frame.color, 1.0).mean() / frame.color.mean())
    assert np.log(GAIN) - as_cut > 0.15, "colours as they are would say the same: the test shows nothing"


def test_what_white_hides_is_told_with_how_sure_it_is() -> None:
    """One of three colours at white in 4000 surfaces of random hue: right on average, and as far off as said.

    Taken from the other colours alone, or as if it were white, it would be too dark.
    """
    rng = np.random.default_rng(1)
    expected = np.tile([0.7, 0.4, 0.4], (4000, 1))
    light = rng.uniform(0.1, 0.7, len(expected))
    hue = HUE * rng.standard_normal(len(expected))
    true = expected * np.exp(light[:, None])
    true[:, 0] *= np.exp(hue)
    at_white = true[:, 0] >= WHITE
    whole, hidden = without_white(expected, np.minimum(true, WHITE), np.zeros(len(expected), dtype=int))
    error = np.log(whole / true)[at_white, 0]
    assert abs(error.mean()) < 0.01
    assert np.mean(np.log(np.maximum(expected * np.exp(light[:, None]), 1.0) / true)[at_white, 0]) < -0.05
    assert 0.9 < error.std() / np.sqrt(np.mean(hidden[at_white, 0] ** 2)) < 1.1
    np.testing.assert_array_equal(whole[:, 1:], true[:, 1:])
    assert not hidden[~at_white].any() and not hidden[:, 1:].any()
