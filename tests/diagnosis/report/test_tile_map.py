"""Maps of tiles instead of lines where samples are of images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.report.figures import overlay_figure
from samrl_core.diagnosis.report.tile_map import darkest, tile_maps
from samrl_core.diagnosis.result import Overlay


def _overlay() -> Overlay:
    """Three frames; tile 9 is off by 2 and once, by clutter, by 50; the effect halves that."""
    tiles = np.tile([0, 9, 63], 3)
    seen = np.where(tiles == 9, 2.0, 0.5)
    seen[1] = 50.0
    time = np.repeat([0.0, 0.1, 0.2], 3)
    return Overlay("C", "camera", "depth", "m", time, seen, np.zeros(9), 0.5 * seen, tiles=tiles)


def test_a_map_has_the_typical_error_of_each_tile() -> None:
    (_, before), (name, after) = tile_maps(_overlay(), "with it")
    assert before.shape == (8, 8) and name == "with it"
    assert before[1, 1] == 2.0 and before[0, 0] == 0.5 and before[7, 7] == 0.5
    assert np.count_nonzero(np.isfinite(before)) == 3
    assert after[1, 1] == 1.0 and darkest(tile_maps(_overlay(), "")) == 2.0


def test_images_are_drawn_as_maps_and_signals_as_lines() -> None:
    for tiles, kind in ((_overlay().tiles, "heatmap"), (None, "scatter")):
        drawn = overlay_figure(replace(_overlay(), tiles=tiles), 100, "with it").to_plotly_json()
        assert {t["type"] for t in drawn["data"]} == {kind}


def test_a_map_without_anything_compared_is_drawn() -> None:
    nothing = replace(_overlay(), measured=np.full(9, np.nan), with_effect=None)
    assert len(overlay_figure(nothing, 100, "").to_plotly_json()["data"]) == 1
