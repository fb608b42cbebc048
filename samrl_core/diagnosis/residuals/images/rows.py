"""Residuals of one frame, tile by tile, and what moves them.

Depth is compared within surfaces, far from any edge. Outlines are compared across edges alone, as shifts in
pixels along the image's two axes; what moves them comes from the renderer's adjoint, one image per row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from samrl_core.diagnosis.residuals.images.bends import bend_modes
from samrl_core.diagnosis.residuals.images.colors import COLORS, compare_colors
from samrl_core.diagnosis.residuals.images.flows import Flows, flows, lens_flows
from samrl_core.diagnosis.residuals.images.scene import OBJECT, STATIC, FrameGeometry, ImageScene

TILES = 8  # along each side of the image
LEAST_PIXELS = 12  # of a tile that is compared
EDGE_M = 0.01  # difference of depth between neighbours that is an edge
FAR_PX = 2  # from any edge, of pixels within a surface
BLUR = 0.016  # of outlines, share of the image's width: shifts up to it stay linear
LEAST_OUTLINE = 0.3  # squared gradient of an outline in a tile, below which it says nothing
ROBUST = 1.4826
UNSEEN = 255  # label of pixels that a corrected lens did not see
CHANNELS = ("depth", "mask", "color", "depth_noise")
UNITS = {"depth": "m", "mask": "px", "color": "1", "depth_noise": "log"}
OF_CHANNEL = {  # columns that are no flow, by channel
    "depth": (
        "depth_scale",
        "depth_offset",
        "depth_shift",
        "depth_bend",
        "depth_pattern",
        "depth_nearest",
    ),
    "mask": ("outline_object", "outline_tip", "outline_bend"),
    "color": ("light", "tint", "shading", "paint_object", "paint_static", "white_object", "white_static"),
    "depth_noise": ("depth_noise",),
}


@dataclass(frozen=True, eq=False)
class Rows:
    """Residuals of one channel of one frame."""

    value: np.ndarray  # (n,)
    tile: np.ndarray  # (n,) index, row by row
    shape: np.ndarray  # (n,) noise of each row against others of its channel
    columns: dict[str, np.ndarray]  # name -> (p, n); a name that is missing moves nothing
    # (n,) index of the surface and colour, of rows of colours; (0,) of others
    surface: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))


@dataclass(frozen=True, eq=False)
class ComparedFrame:
    """One frame as recorded, in the size in which it is compared."""

    color: np.ndarray  # (H, W, 3) 0..1
    depth: np.ndarray  # (H, W) [m]
    mask: np.ndarray  # (H, W)
    view: FrameGeometry
    beside: np.ndarray | None = None  # (2, H, W) from where depth was read to the pixel, along u and v [px]


def frame_rows(
    scene: ImageScene,
    frame: ComparedFrame,
    object_pose: np.ndarray,
    noise_per_z2: float,
    vertices: np.ndarray | None = None,
) -> dict[str, Rows]:
    """Rows of every channel with the object at a transform (4, 4); noise of depth at 1 m [m].

    `vertices` (V, 3) in the camera's axes stand in for those of the stated cell.
    """
    vertices = scene.vertices(frame.view, object_pose) if vertices is None else vertices
    object_at = scene.origin + object_pose[:3, 3]
    moving = flows(scene, frame.view, vertices, scene.group, object_at)
    rendered, shaded = scene.render(vertices), scene.render(vertices, shaded=True)
    shares = rendered.color.numpy().astype(float)
    points = rendered.xyz.numpy().astype(float)
    risen = np.zeros(frame.depth.shape)
    if frame.beside is not None:
        risen = _risen(points[..., 2], frame.beside)
        frame = replace(frame, depth=frame.depth + risen)
    label = rendered.label.numpy().copy()
    label[~np.isfinite(rendered.depth.numpy())] = 255
    inside = _inside(scene, frame, points[..., 2], label)
    return {
        "depth": _depth_rows(scene, frame, points, inside, object_at, risen),
        "color": _color_rows(scene, frame, shaded.color.numpy().astype(float), inside),
        "depth_noise": _noise_rows(frame, points[..., 2], inside, noise_per_z2),
        "mask": _mask_rows(scene, frame, shares, label, vertices, moving),
    }


def _risen(z: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """By how much surfaces (H, W) are deeper so many pixels (2, H, W) on, by the model's own slopes.

    Depth is never mixed between pixels, which would also smooth its noise. Slopes across an edge mean
    nothing, but no pixel near one is compared. A driver that resampled depth before by the nearest pixel
    gave each the depth of that pixel's ray, and there is nothing to add: `depth_nearest` leaves that open.
    """
    slope_v, slope_u = np.gradient(z)
    return beside[0] * slope_u + beside[1] * slope_v


def _tiles(height: int, width: int) -> np.ndarray:
    """(H, W) index of each pixel's tile."""
    v, u = np.mgrid[0:height, 0:width]
    return (v * TILES // height) * TILES + u * TILES // width


def _bends(row: np.ndarray, column: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    """Modes (9, N) at pixels of an image of a size (H, W)."""
    height, width = size
    return bend_modes(2.0 * column / width - 1.0, 2.0 * row / height - 1.0)


def _inside(
    scene: ImageScene, frame: ComparedFrame, z: np.ndarray, label: np.ndarray
) -> dict[int, np.ndarray]:
    """Pixels (H, W) within the object and the table, far from edges of model and recording."""
    clean = np.isfinite(frame.depth) & (frame.depth > 0)
    kernel = np.ones((3, 3), np.uint8)
    step = cv2.dilate(z.astype(np.float32), kernel) - cv2.erode(z.astype(np.float32), kernel)
    tilt = ROBUST * float(np.median(step[label != 255])) if (label != 255).any() else 0.0
    edge = (step > max(EDGE_M, 3.0 * tilt)) | (label == 255)
    far = cv2.dilate(edge.astype(np.uint8), np.ones((2 * FAR_PX + 1,) * 2, np.uint8)) == 0
    out = {}
    for group, wanted in ((STATIC, 0), (OBJECT, scene.target_label)):
        both = ((label == wanted) & (frame.mask == wanted)).astype(np.uint8)
        both = cv2.erode(both, np.ones((2 * FAR_PX + 1,) * 2, np.uint8), borderValue=0) > 0
        out[group] = both & far & clean
    return out


def _depth_rows(
    scene: ImageScene,
    frame: ComparedFrame,
    points: np.ndarray,
    inside: dict[int, np.ndarray],
    object_at: np.ndarray,
    risen: np.ndarray,
) -> Rows:
    k, z = scene.intrinsics, points[..., 2]
    dv, du = np.gradient(z)
    tiles = _tiles(*z.shape)
    value, where, shape, columns = [], [], [], []
    for group, mask in inside.items():
        index = np.flatnonzero(mask)
        if not len(index):
            continue
        at, zs = points.reshape(-1, 3)[index], z.ravel()[index]
        slope_u, slope_v = du.ravel()[index], dv.ravel()[index]
        error = frame.depth.ravel()[index] - zs
        moves = flows(scene, frame.view, at, np.full(len(at), group), object_at)
        along: Flows = {}
        for name, d in moves.items():
            shift_u = k.fx * (d[..., 0] - at[:, 0] / zs * d[..., 2]) / zs
            shift_v = k.fy * (d[..., 1] - at[:, 1] / zs * d[..., 2]) / zs
            along[name] = d[..., 2] - slope_u * shift_u - slope_v * shift_v
        along["depth_scale"], along["depth_offset"] = zs[None], np.ones((1, len(zs)))
        along["depth_shift"] = -k.width * np.stack([slope_u, slope_v])  # depth beside the colours
        along["depth_nearest"] = risen.ravel()[None, index]
        bends = _bends(index // k.width, index % k.width, z.shape)
        along["depth_bend"] = np.concatenate([bends * slope for slope in along["depth_shift"]])
        of_tile = tiles.ravel()[index]
        order = np.argsort(of_tile, kind="stable")
        found, starts, counts = np.unique(of_tile[order], return_index=True, return_counts=True)
        means = {n: np.add.reduceat(a[:, order], starts, axis=1) / counts for n, a in along.items()}
        for i in np.flatnonzero(counts >= LEAST_PIXELS):
            tile, chosen = int(found[i]), order[starts[i] : starts[i] + counts[i]]
            value.append(float(np.median(error[chosen])))
            where.append(tile)
            shape.append(float(np.mean(zs[chosen]) ** 2 * np.sqrt(64.0 / counts[i] + 0.15)))
            of_row = {name: mean[:, i] for name, mean in means.items()}
            of_row["depth_pattern"] = np.zeros(2 * TILES**2)
            of_row["depth_pattern"][2 * tile : 2 * tile + 2] = of_row["depth_shift"]
            columns.append(of_row)
    return _stacked(value, where, shape, columns)


def _color_rows(
    scene: ImageScene, frame: ComparedFrame, model: np.ndarray, inside: dict[int, np.ndarray]
) -> Rows:
    """Each colour of a surface in a tile against the model's: e log(seen / e) for e expected."""
    tiles = _tiles(*model.shape[:2])
    means, medians, groups, where = [], [], [], []
    for group, mask in inside.items():
        for tile in np.unique(tiles[mask]):
            chosen = mask & (tiles == tile)
            if chosen.sum() < LEAST_PIXELS:
                continue
            means.append(model[chosen].mean(axis=0))
            medians.append(np.median(frame.color[chosen], axis=0))
            groups.append(group)
            where.append(int(tile))
    if not where:
        return _stacked([], [], [], [])
    lit = np.stack([scene.find_brightest(group) for group in groups])
    colors = compare_colors(np.array(means), np.array(medians), np.array(groups), lit)
    tiles_of_rows = np.tile(where, COLORS)
    return Rows(colors.value, tiles_of_rows, colors.noise, colors.columns, colors.surface)


def _noise_rows(
    frame: ComparedFrame, z: np.ndarray, inside: dict[int, np.ndarray], noise_per_z2: float
) -> Rows:
    """Logarithm of the spread of depth between neighbours, against what is stated of the sensor."""
    error = (frame.depth - z) / (noise_per_z2 * np.maximum(z, 1e-3) ** 2)
    step = (error[:, 1:] - error[:, :-1]) / np.sqrt(2.0)
    ok = inside[STATIC][:, 1:] & inside[STATIC][:, :-1]
    tiles = _tiles(*z.shape)[:, 1:]
    value, where, shape, columns = [], [], [], []
    for tile in np.unique(tiles[ok]):
        chosen = step[ok & (tiles == tile)]
        if len(chosen) < 4 * LEAST_PIXELS:
            continue
        spread = ROBUST * float(np.median(np.abs(chosen - np.median(chosen))))
        value.append(float(np.log(max(spread, 1e-3))))
        where.append(int(tile))
        shape.append(1.0)
        columns.append({"depth_noise": np.ones(1)})
    return _stacked(value, where, shape, columns)


def _mask_rows(
    scene: ImageScene,
    frame: ComparedFrame,
    shares: np.ndarray,
    label: np.ndarray,
    vertices: np.ndarray,
    moving: Flows,
) -> Rows:
    """Shifts of the outlines of object and tip along u and v."""
    height, width = label.shape
    sigma = BLUR * width
    reach = int(np.ceil(2.0 * sigma))
    kernel = np.ones((2 * reach + 1,) * 2, np.uint8)
    tiles = _tiles(height, width)
    wanted = {0: scene.target_label, 1: scene.tool_label}
    # What the model knows roughly only (the arm, the hand) must not be near.
    coarse = ((label == scene.tool_label) & (shares[..., 1] < 0.5)) | np.isin(label, (3,))
    coarse |= np.isin(frame.mask, (3, UNSEEN))
    # A rim one pixel wide is the tip's own edge, of which its label has more and its share less than half.
    coarse = cv2.morphologyEx(coarse.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    border = np.ones((height, width), np.uint8)
    border[reach:-reach, reach:-reach] = 0
    value, where, shape, weights, growth, lens = [], [], [], [], [], []
    moved = _pixel_shifts(scene)
    for channel, name in wanted.items():
        modelled = shares[..., channel]
        if modelled.sum() < LEAST_PIXELS:
            continue
        recorded = (frame.mask == name).astype(float)
        other = wanted[1 - channel]
        near_other = cv2.dilate((frame.mask == other).astype(np.uint8), kernel) > 0
        unsure = cv2.dilate(coarse.astype(np.uint8), kernel) > 0
        use = ~(near_other | unsure | (border > 0))
        smooth, seen = _blurred(modelled, sigma), _blurred(recorded, sigma)
        slope_v, slope_u = np.gradient(smooth)
        steep = np.hypot(slope_u, slope_v)
        falls = {n: -(slope_u * d[..., 0] + slope_v * d[..., 1]) for n, d in moved.items()}
        for axis, slope in enumerate((slope_u, slope_v)):
            for tile in np.unique(tiles[use & (steep > 0.02)]):
                w = np.where(use & (tiles == tile), slope, 0.0)
                strength = float((w * slope).sum())
                if strength < LEAST_OUTLINE:
                    continue
                w = -w / strength
                value.append(float((w * (seen - smooth)).sum()))
                where.append(int(tile))
                shape.append(float(np.sqrt(1.0 / strength + 0.1)))
                image = np.zeros((height, width, 3), np.float32)
                image[..., channel] = _blurred(w, sigma)
                weights.append(image)
                grown = [0.0, 0.0]
                grown[channel] = float((w * steep).sum())
                growth.append((axis, grown))
                lens.append({n: np.einsum("vu,pvu->p", w, f) for n, f in falls.items()})
    if not value:
        return _stacked([], [], [], [])
    gradients = scene.gradients(vertices, np.stack(weights))
    columns = {
        name: np.einsum("pvi,nvi->pn", d, gradients, optimize=True)
        for name, d in moving.items()
        if name not in moved
    }
    columns |= {name: np.stack([of_row[name] for of_row in lens], axis=1) for name in moved}
    grown = np.array([g for _, g in growth])
    columns["outline_object"], columns["outline_tip"] = grown[:, 0][None], grown[:, 1][None]
    along, tile = np.array([axis for axis, _ in growth]), np.array(where)
    row, column = (tile // TILES + 0.5) * height / TILES, (tile % TILES + 0.5) * width / TILES
    bends = width * _bends(row, column, label.shape)
    columns["outline_bend"] = np.concatenate([bends * (along == axis) for axis in (0, 1)])
    return Rows(np.array(value), np.array(where), np.array(shape), columns)


def _pixel_shifts(scene: ImageScene) -> Flows:
    """Shifts (p, H, W, 2) [px] of the image by its lens, which moves pixels and not vertices.

    A distortion bends an edge between two vertices: what they do says little of what its middle does.
    """
    k = scene.intrinsics
    u, v = np.meshgrid((np.arange(k.width) + 0.5 - k.cx) / k.fx, (np.arange(k.height) + 0.5 - k.cy) / k.fy)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1)
    of_lens = lens_flows(k, rays.reshape(-1, 3))
    return {n: d.reshape(len(d), *u.shape, 3)[..., :2] * [k.fx, k.fy] for n, d in of_lens.items()}


def joined(rows: Sequence[Rows]) -> Rows:
    """Rows of several frames, one after the other."""
    filled = [r for r in rows if len(r.value)]
    if not filled:
        return Rows(np.zeros(0), np.zeros(0, dtype=int), np.zeros(0), {})
    names = [n for n in filled[0].columns if all(n in r.columns for r in filled)]
    return Rows(
        np.concatenate([r.value for r in filled]),
        np.concatenate([r.tile for r in filled]),
        np.concatenate([r.shape for r in filled]),
        {n: np.concatenate([r.columns[n] for r in filled], axis=1) for n in names},
        np.concatenate([r.surface for r in filled]),
    )


def _blurred(image: np.ndarray, sigma: float) -> np.ndarray:
    return cv2.GaussianBlur(image.astype(np.float64), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)


def _stacked(
    value: list[float], where: list[int], shape: list[float], columns: list[dict[str, np.ndarray]]
) -> Rows:
    names = list(columns[0]) if columns else []
    return Rows(
        np.array(value, dtype=float), np.array(where, dtype=int), np.array(shape, dtype=float),
        {name: np.stack([c[name] for c in columns], axis=1) for name in names},
    )  # fmt: skip
