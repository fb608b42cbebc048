"""Maps of an image's tiles: how far the model is off in each, before and with the named effect.

Samples of one frame have one stamp, so a line through them in time would join tile to tile: a saw.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.diagnosis.result import Overlay

LEAST_SIDE = 8  # tiles along each side of the image, at least
SHADES = ((0.0, "#ffffff"), (0.5, "#f0b35a"), (1.0, "#8a2d0f"))  # from no error to the largest


def tile_maps(o: Overlay, effect_label: str) -> list[tuple[str, np.ndarray]]:
    """Name and typical error (side, side) in the overlay's unit; NaN where nothing was compared."""
    assert o.tiles is not None
    shown = [("nominal model", o.nominal), (effect_label, o.with_effect)]
    return [(name, _by_tile(o.measured - s, o.tiles)) for name, s in shown if s is not None]


def _by_tile(error: np.ndarray, tiles: np.ndarray) -> np.ndarray:
    """Median size of the errors: what stands in few frames (clutter) must not outshine the rest."""
    side = max(LEAST_SIDE, math.isqrt(int(np.max(tiles, initial=0))) + 1)
    out = np.full(side * side, np.nan)
    for tile in np.unique(tiles):
        there = np.abs(error[tiles == tile])
        if np.isfinite(there).any():
            out[tile] = np.nanmedian(there)
    return out.reshape(side, side)


def darkest(maps: list[tuple[str, np.ndarray]]) -> float:
    """The error that has the darkest shade, the same in all maps."""
    return max((float(np.nanmax(m)) for _, m in maps if np.isfinite(m).any()), default=1.0) or 1.0


def tile_figure(o: Overlay, effect_label: str) -> dict:
    """Data and layout of a plotly figure: the maps side by side, in one scale."""
    maps = tile_maps(o, effect_label)
    most, width = darkest(maps), 1.0 / len(maps)
    data, annotations = [], []
    layout = {"height": 430, "margin": {"l": 30, "r": 20, "t": 46, "b": 20}, "annotations": annotations}
    for k, (name, values) in enumerate(maps):
        end = "" if k == 0 else str(k + 1)
        shown = [[None if not math.isfinite(v) else float(f"{v:.4g}") for v in row] for row in values]
        data.append(
            {
                "type": "heatmap", "z": shown, "zmin": 0.0, "zmax": most, "xgap": 1, "ygap": 1,
                "colorscale": [list(s) for s in SHADES], "showscale": k == len(maps) - 1,
                "colorbar": {"title": {"text": o.unit}}, "xaxis": f"x{end}", "yaxis": f"y{end}",
                "hovertemplate": f"%{{z:.4g}} {o.unit}<extra></extra>",
            }
        )  # fmt: skip
        domain = [k * width, (k + 1) * width - 0.06]
        plain = {"showticklabels": False, "showgrid": False, "zeroline": False}
        layout[f"xaxis{end}"] = {"domain": domain, "anchor": f"y{end}", **plain}
        layout[f"yaxis{end}"] = {
            "autorange": "reversed", "scaleanchor": f"x{end}", "anchor": f"x{end}", **plain,
        }  # fmt: skip
        annotations.append(
            {
                "text": f"{name}: median error per tile", "x": float(np.mean(domain)), "y": 1.06,
                "xref": "paper", "yref": "paper", "showarrow": False,
            }
        )  # fmt: skip
    return {"data": data, "layout": layout}
