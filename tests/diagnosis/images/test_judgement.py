"""What the diagnosis of images calls a gap: chance of a false name, and masks that are too large."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import InstanceName, draw_instance
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.image_recording import ImageRecording, ImageTolerances
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.selection.selection import needed_evidence


@pytest.mark.parametrize("chance", [0.2, 0.05])
@pytest.mark.parametrize("spread", [2.0, 4.0])
def test_a_false_name_is_as_rare_as_stated(chance: float, spread: float) -> None:
    """Evidence of 24 errors of normal prior, each seen once in noise of one, where there is none."""
    seen = np.random.default_rng(0).standard_normal((20_000, 24))
    width = 1.0 + spread**2
    evidence = 0.5 * seen**2 * (1.0 - 1.0 / width) - 0.5 * np.log(width)
    named = float(np.mean(evidence.max(axis=1) > needed_evidence(24, chance)))
    assert 0.0 < named < chance


@pytest.mark.slow
def test_masks_that_are_too_large_are_said_to_be(recordings: list[ImageRecording]) -> None:
    """Three pixels all around are no error of camera, object or bases, and no cell without a gap."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
    first = recordings[0]
    grown = replace(first, mask=np.stack([cv2.dilate(m, kernel) for m in first.mask]))
    found, _ = diagnose([grown], [])
    assert found.verdict == "none_of_mine", [e.name for e in found.effects]
    assert any("masks are larger or smaller" in reason for reason in found.reasons)


def test_light_and_paint_are_tolerated_as_far_as_typical_cells_differ() -> None:
    """Half widths are root three standard deviations; what is stated wider hides an exposure."""
    cells = [draw_instance(InstanceName("typical", seed), cell_named()) for seed in range(400)]
    light = np.array([(1.0 + c.look.light_strength) * (1.0 + c.optics.exposure) - 1.0 for c in cells])
    paint = np.array([c.look.target_colour for c in cells])
    stated = ImageTolerances()
    assert stated.brightness == pytest.approx(np.sqrt(3.0) * light.std(), rel=0.15)
    assert stated.paint == pytest.approx(np.sqrt(3.0) * paint.std(), rel=0.15)
    assert stated.tint == pytest.approx(np.sqrt(3.0) * np.std([c.look.light_warmth for c in cells]), rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "verdict"), [(0.4, "effect"), (0.87, "no_gap")])
def test_an_exposure_darkens_object_and_table_alike(
    recordings: list[ImageRecording], gain: float, verdict: str
) -> None:
    """Each alone may be painted darker; both by as much is the light, beyond what an installation has."""
    dark = [replace(r, color=np.round(gain * r.color).astype(np.uint8)) for r in recordings]
    found, _ = diagnose(dark[:1], dark[1:])
    assert found.verdict == verdict, found.reasons
    if verdict == "effect":
        assert found.effects[0].name == "lighting@cell"
        assert found.effects[0].parameters["g"].value == pytest.approx(gain - 1.0, abs=0.15)
    # Both reports say that what lies between is where light begins to be seen.
    (light,) = (one for one in found.least_sizes if one.family == "lighting")
    assert 0.4 - 1.0 < light.stated[0] < 0.87 - 1.0 < light.exact[0] < 0.0
