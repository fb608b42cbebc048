"""Which tiles of a world's images its cause changes: the same world rendered with it and without.

Both are recorded with one motion and one seed, so that noise, clutter and light are the same and what differs
is the cause's. Tiles are those in which a diagnosis compares, row by row.
"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.image_recording import ImageRecording

TILES = 8  # along each side of the image; a test holds it to that of reports, which a maker does not know
LEAST_PIXELS = 12  # of a tile and surface, in an image
NEIGHBOUR = np.sqrt(2.0)  # deviation of a difference of two, against that of one


def tile_changes(caused: ImageRecording, without: ImageRecording) -> dict[str, np.ndarray]:
    """Size of the change (64,) by channel, root mean square over images; NaN where nothing is compared.

    depth [m]: median over a surface that both see. mask [px]: pixels that change label, by those of outlines.
    color [1 is white]: median of that surface's grey. depth_noise [log]: spread between neighbours.
    """
    height, width = without.depth.shape[1:]
    v, u = np.mgrid[0:height, 0:width]
    tiles = (v * TILES // height) * TILES + u * TILES // width
    squares: dict[str, list[np.ndarray]] = {c: [] for c in ("depth", "color", "depth_noise")}
    changed, outline = np.zeros(TILES**2), np.zeros(TILES**2)
    for k in range(min(len(caused.time), len(without.time))):
        same = caused.mask[k] == without.mask[k]
        edge = _outline(without.mask[k])
        changed += np.bincount(tiles[~same], minlength=TILES**2)
        outline += np.bincount(tiles[edge], minlength=TILES**2)
        both = same & np.isfinite(caused.depth[k]) & np.isfinite(without.depth[k])
        grey = (np.asarray(r.color[k], float).mean(axis=2) / 255.0 for r in (caused, without))
        values = {
            "depth": caused.depth[k].astype(float) - without.depth[k],
            "color": np.subtract(*grey),
        }
        for channel, difference in values.items():
            squares[channel].append(_medians(difference, both, tiles) ** 2)
        spreads = [_spreads(r.depth[k].astype(float), both & ~edge, tiles) for r in (caused, without)]
        squares["depth_noise"].append(np.log(spreads[0] / spreads[1]) ** 2)
    out = {channel: np.sqrt(_means(np.stack(found))) for channel, found in squares.items()}
    out["mask"] = np.where(outline >= LEAST_PIXELS, changed / np.maximum(outline, 1.0), np.nan)
    return out


def _outline(mask: np.ndarray) -> np.ndarray:
    """Pixels (H, W) whose right or lower neighbour has another label."""
    edge = np.zeros(mask.shape, dtype=bool)
    edge[:, :-1] |= mask[:, 1:] != mask[:, :-1]
    edge[:-1] |= mask[1:] != mask[:-1]
    return edge


def _medians(values: np.ndarray, use: np.ndarray, tiles: np.ndarray) -> np.ndarray:
    out = np.full(TILES**2, np.nan)
    for tile in np.unique(tiles[use]):
        there = values[use & (tiles == tile)]
        if len(there) >= LEAST_PIXELS:
            out[tile] = np.median(there)
    return out


def _spreads(depth: np.ndarray, use: np.ndarray, tiles: np.ndarray) -> np.ndarray:
    step = (depth[:, 1:] - depth[:, :-1]) / NEIGHBOUR
    ok = use[:, 1:] & use[:, :-1] & np.isfinite(step)
    out = np.full(TILES**2, np.nan)
    for tile in np.unique(tiles[:, 1:][ok]):
        there = step[ok & (tiles[:, 1:] == tile)]
        if len(there) >= 4 * LEAST_PIXELS:
            out[tile] = max(float(np.median(np.abs(there - np.median(there)))), 1e-6)
    return out


def _means(squares: np.ndarray) -> np.ndarray:
    """Of images (N, 64) in which a tile can be compared."""
    seen = np.isfinite(squares)
    with np.errstate(invalid="ignore"):
        return np.where(seen, squares, 0.0).sum(axis=0) / np.where(seen.any(axis=0), seen.sum(axis=0), np.nan)
