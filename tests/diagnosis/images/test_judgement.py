"""What the diagnosis of images calls a gap: chance of a false name, and masks that are too large."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from samrl_core.cell.types.image_recording import ImageRecording
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


@pytest.mark.thorough
def test_masks_that_are_too_large_are_said_to_be(recordings: list[ImageRecording]) -> None:
    """Three pixels all around are no error of camera, object or bases, and no cell without a gap."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
    first = recordings[0]
    grown = replace(first, mask=np.stack([cv2.dilate(m, kernel) for m in first.mask]))
    found, _ = diagnose([grown], [])
    assert found.verdict == "none_of_mine", [e.name for e in found.effects]
    assert any("masks are larger or smaller" in reason for reason in found.reasons)
