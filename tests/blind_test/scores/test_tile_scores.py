"""Tiles and the bound by information: made-up answers, and changes of made-up images."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.blind_test.camera_worlds import tiles
from samrl_core.blind_test.camera_worlds.tiles import tile_changes
from samrl_core.blind_test.scores.outcome import Outcome, SealedTruth
from samrl_core.blind_test.scores.tile_scores import bound_scores, tile_iou, tile_scores
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial

HAND_EYE = {"family": "hand_eye", "place": "sensor:camera"}


def _outcome(verdict: str, stand_out: list[int], changed: list[int]) -> Outcome:
    sizes = {"x": {"value": 0.004, "unit": "m"}}
    effect = {**HAND_EYE, "severity": 1.0, "form": "T0", "parameters": sizes}
    truth = SealedTruth("c000", "single", "pybullet", "camera", (effect,), 1.0)
    estimate = {"value": 0.0048, "unit": "m", "ci95": [0.0048 - 1.96 * 6e-4, 0.0048 + 1.96 * 6e-4]}
    report: dict[str, Any] = {
        "verdict": verdict,
        "effects": [{**HAND_EYE, "role": "primary", "parameters": {"x": estimate}}],
        "tiles": [{"channel": "depth", "side": 8, "compared": list(range(10)), "stand_out": stand_out}],
        "information": {"hand_eye@sensor:camera": {"x": 4e-4}},
    }
    change = np.zeros(64)
    change[changed] = 0.004
    return Outcome(truth, report, tiles={"depth": change})


def test_worlds_and_reports_count_the_same_tiles() -> None:
    assert tiles.TILES == ImageTrial.tiles_along_side


def test_iou_counts_compared_tiles_alone() -> None:
    assert tile_iou(_outcome("effect", [1, 2, 3], [2, 3, 4, 60])) == pytest.approx(2 / 4)
    assert tile_iou(_outcome("effect", [2], [2])) == 1.0
    assert tile_iou(_outcome("effect", [1], [])) is None
    assert tile_iou(_outcome("no_gap", [2], [2])) == 0.0


def test_a_missed_gap_stays_in_the_denominator() -> None:
    missed = _outcome("no_gap", [2], [2])
    missed = replace(missed, truth=replace(missed.truth, id="c001"))
    found = tile_scores([_outcome("effect", [2], [2]), missed])
    assert found["median"] == 0.5 and (found["half"]["successes"], found["half"]["trials"]) == (1, 2)
    assert (found["half_of_detected"]["successes"], found["half_of_detected"]["trials"]) == (1, 1)
    assert tile_scores([])["median"] is None


def test_errors_and_intervals_in_least_deviations() -> None:
    found = bound_scores([_outcome("effect", [2], [2]), _outcome("no_gap", [], [])])
    assert found["error"] == {"c000": pytest.approx(2.0)}
    assert found["stated_median"] == pytest.approx(1.5)


def test_tiles_that_a_cause_changes() -> None:
    """Depth 5 mm longer in the upper left quarter, an outline moved by two pixels elsewhere."""
    cell = cell_named()
    k = Intrinsics(64, 64, 60.0, 60.0, 32.0, 32.0)
    pose, n, ends = cell.camera_in_flange, 6, np.array([0.0, 1.0])
    depth = np.full((n, 64, 64), 0.5, np.float32)
    mask = np.zeros((n, 64, 64), np.uint8)
    mask[:, 40:, 43:] = 1
    without = ImageRecording(
        "A", "", "", "peg_insertion", cell.name, k, pose, pose, pose, np.linspace(0, 1, n),
        np.full((n, 64, 64, 3), 99, np.uint8), depth, mask, ends, np.zeros((2, 7)), ends, np.zeros((2, 7)),
    )  # fmt: skip
    longer, shifted = depth.copy(), np.zeros_like(mask)
    longer[:, :32, :32] += 0.005
    shifted[:, 40:, 45:] = 1
    found = tile_changes(replace(without, depth=longer, mask=shifted), without)
    expected = np.zeros((8, 8))
    expected[:4, :4] = 0.005
    np.testing.assert_allclose(found["depth"].reshape(8, 8), expected, atol=1e-6)
    # The outline crosses each lower tile of the sixth column in 8 pixels: too short alone to be compared.
    assert np.nanmax(found["color"]) == 0.0
    changed = found["mask"].reshape(8, 8)
    assert np.isnan(changed[0, 0]) and np.nanmax(changed) > 1.0
