"""Hole and peg's end in one image by their colours: how the one lies beside the other, in pixels.

A mask says roughly where a part is. A segmenter's boundary wanders by a pixel or two, and depth that is off
by a centimetre in a cell that nobody calibrated turns a block by ten degrees to fit. A bore is dark in a
bright face, and a peg has a colour that the face has not, so that both are known to half a pixel (as a thread
is, msgs_docs/decisions/0026). In one image the errors of camera and arms shift both alike: what is left of
them is how high the peg's end is over the face, which touching it tells.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.scene import Rgb

_MASK_RIM = 3  # a mask's boundary may be off by so much [px]
_FEWEST = 30  # pixels of a part whose colour is taken from them
_DARK = 0.55  # of the face's brightness is missing where it is the bore
_FAINT = 0.15  # less of it is noise
_HALF = 0.5  # of the peg's colour: more is the peg
_AREA = (0.65, 1.5)  # of the bore's drawn area that is seen; less is hidden in part
_AWAY = 2.0  # of the root of that area: a dark spot so far from where the bore is believed is another one
_BARE = 2  # so near to the peg nothing is taken for the bore [px]
_ROUND_END = 0.25 * np.pi  # an end's half ellipse is as large as a rectangle of this share of its height
_SHARPER = 2.0  # an edge of the peg's share, about one half
_LOWER = 2.0  # of the peg's width above its end is compared
_ACROSS = 0.8  # of its width along the axis, from which the width as seen is taken
_WIDE = (0.7, 1.5)  # of the drawn width; else something else stands before or beside it
_NEAR = 2.5  # of the peg's width about where its end is believed, within which it is looked for
_COLOURED = 25.0  # more of the peg's colour is not noise, of 255


@dataclass(frozen=True)
class PegColours:
    """As drawn; a real cell's light changes how bright they are, and less what sets them apart."""

    peg: Rgb
    face: Rgb


@dataclass(frozen=True, eq=False)
class HoleSight:
    """Places in an image, (2,) [px]; NaN for what does not show."""

    camera: Camera
    hole: np.ndarray  # middle of the mouth
    end: np.ndarray  # middle of the peg's end

    def covariance(self, mouth_height: float, pixels: float, height: float) -> np.ndarray:
        """Of the mouth's middle from the peg's end, both `on_plane` (2, 2) [m2].

        Args:
            mouth_height: in world [m].
            pixels: standard deviation of hole and end in the image, along each axis [px].
            height: that of the end's height over the mouth [m].
        """
        spot = self.hole if np.isfinite(self.hole).all() else self.end
        middle = on_plane(self.camera, spot, mouth_height)
        across = np.stack(
            [on_plane(self.camera, spot + step, mouth_height) - middle for step in np.eye(2)], axis=1
        )
        higher = on_plane(self.camera, spot, mouth_height + 1e-3) - middle
        return 2.0 * pixels**2 * across @ across.T + np.outer(higher, higher) * (height / 1e-3) ** 2


def on_plane(camera: Camera, pixel: np.ndarray, height: float) -> np.ndarray:
    """Where the ray through a pixel (2,) meets a horizontal plane [m], (2,) in world."""
    k, pose = camera.intrinsics, camera.camera_in_world
    ray = pose.rotation @ np.array([(pixel[0] - k.cx) / k.fx, (pixel[1] - k.cy) / k.fy, 1.0])
    return (pose.position + ray * ((height - pose.position[2]) / ray[2]))[:2]


def sight_of(
    observation: Observation,
    labels: tuple[int, int],
    colours: PegColours,
    mouth: np.ndarray,
    end: np.ndarray,
    radii: tuple[float, float],
) -> HoleSight:
    """What an image shows of both.

    Args:
        observation: image, masks and camera.
        labels: of the tool and of the block.
        colours: of peg and face.
        mouth: (3,) where it is believed in world [m].
        end: (3,) of the peg, the same.
        radii: of peg and hole [m].
    """
    camera, frame = observation.camera, observation.frame
    color = frame.color.astype(np.float64)
    tool, block = (frame.mask == label for label in labels)
    shade = _peg_shade(color, tool, colours)
    strong = shade[shade > _COLOURED]
    peg = shade / float(np.quantile(strong, 0.7)) if len(strong) else shade
    pixel, depth = camera.project(mouth[None])[0], _depth(camera, mouth)
    steep = float(-camera.camera_in_world.rotation[2, 2])  # sine of the way down that it looks
    area = np.pi * (radii[1] * camera.intrinsics.fx / depth) ** 2 * max(steep, 0.1)
    hole = _bore(color, block, peg, pixel[:2], float(area))
    low, high = camera.project(np.array([end, end + [0.0, 0.0, 0.02]]))[:, :2]
    width = 2.0 * radii[0] * camera.intrinsics.fx / _depth(camera, end)
    rows, columns = np.indices(shade.shape) + 0.5
    near = np.hypot(columns - low[0], rows - low[1]) < _NEAR * width
    others = _others(color, frame.mask, labels, near)
    return HoleSight(camera, hole, _end(color, np.where(near, shade, 0.0), others, low - high, width, steep))


def _depth(camera: Camera, point: np.ndarray) -> float:
    return max(float(camera.camera_in_world.inverse().apply(point)[2]), 1e-3)


def _others(color: np.ndarray, mask: np.ndarray, labels: tuple[int, int], near: np.ndarray) -> np.ndarray:
    """Colours (B, 3) that may stand beside a peg's end: of the face, of the bore, of what is behind."""
    tool, block = (_grown(mask == label, 1) for label in labels)
    found = [np.zeros(3)]
    for part in (block & ~tool, near & ~tool & ~block):
        if int(part.sum()) >= _FEWEST:
            found += [np.quantile(color[part], q, axis=0) for q in (0.03, 0.3, 0.7)]
    return np.array(found)


def _peg_shade(color: np.ndarray, tool: np.ndarray, colours: PegColours) -> np.ndarray:
    """How much (H, W) of the colour that the peg has and the face has not, near the tool's mask, 0..255."""
    apart = np.array(colours.peg) - np.array(colours.face)
    shade = np.maximum(color @ (apart / np.linalg.norm(apart)), 0.0)
    return np.where(_grown(tool, _MASK_RIM), shade, 0.0)


def _bore(
    color: np.ndarray, block: np.ndarray, peg: np.ndarray, believed: np.ndarray, area: float
) -> np.ndarray:
    """Middle (2,) of the dark region in the face nearest to where it is believed [px], NaN if hidden."""
    missing = np.full(2, np.nan)
    inner = _shrunk(block, _MASK_RIM)
    if int(inner.sum()) < _FEWEST:
        return missing
    face = np.quantile(color[inner], 0.7, axis=0)
    outline = cv2.convexHull(np.argwhere(block)[:, ::-1].astype(np.int32))
    within = _shrunk(cv2.fillConvexPoly(np.zeros(block.shape, np.uint8), outline, 1) > 0, _MASK_RIM)
    dark = np.where(
        within & (peg < _FAINT), np.clip(1.0 - color @ face / max(float(face @ face), 1.0), 0.0, 1.0), 0.0
    )
    count, numbered, _, middles = cv2.connectedComponentsWithStats((dark > _DARK).astype(np.uint8))
    if count < 2:
        return missing
    away = np.linalg.norm(middles[1:] + 0.5 - believed, axis=1)
    if away.min() > _AWAY * np.sqrt(area):
        return missing
    region = _grown(numbered == 1 + int(np.argmin(away)), 2)
    share = np.where(region & (dark > _FAINT), dark, 0.0)
    hidden = bool((region & _grown(peg > _HALF, _BARE)).any())
    if hidden or not _AREA[0] * area < share.sum() < _AREA[1] * area:
        return missing
    return _middle(share)


def _end(
    color: np.ndarray, shade: np.ndarray, others: np.ndarray, down: np.ndarray, width: float, steep: float
) -> np.ndarray:
    """Middle (2,) of the end of a peg whose axis is seen along `down` (2,) [px]; NaN where it is unclear.

    Light changes along a peg, and a warm or cold lamp colours the grey hand: only the lower end is compared,
    with its own colour, and only as far up as the drawn `width` [px] times `_LOWER`. `others` (B, 3) are
    colours that may stand beside it.
    """
    nowhere = np.full(2, np.nan)
    along = down / max(float(np.linalg.norm(down)), 1e-9)
    beside = np.array([-along[1], along[0]])
    rows, columns = np.indices(shade.shape)
    places = np.stack([columns, rows], axis=-1) + 0.5
    way, off = places @ along, places @ beside
    strong = shade[shade > _COLOURED]
    if len(strong) < _FEWEST:
        return nowhere
    share = shade / float(np.quantile(strong, 0.7))
    for _ in range(3):  # the first colour is that of the whole tool
        count, numbered, stats, _ = cv2.connectedComponentsWithStats((share > _HALF).astype(np.uint8))
        if count < 2:
            return nowhere
        largest = numbered == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
        low = float(way[largest].max())
        part = largest & (way > low - width) & (way < low - 0.25 * width)
        if int(part.sum()) < _FEWEST // 3:
            return nowhere
        share = np.where(shade > 0.0, _mixed(color, np.median(color[part], axis=0), others), 0.0)
    share = np.where(_grown(largest, 1) & (way > low - _LOWER * width), share, 0.0)
    share = np.clip(0.5 + _SHARPER * (share - _HALF), 0.0, 1.0)  # a bore under it is a little of its colour
    line = low - width  # across the peg; above it lies what its width is taken from
    # A pixel counts by how much of it lies beyond a line.
    below, above = (np.clip(way - at + 0.5, 0.0, 1.0) for at in (line, line - _ACROSS * width))
    across = float((share * (above - below)).sum()) / (_ACROSS * width)
    if not _WIDE[0] * width < across < _WIDE[1] * width:
        return nowhere
    # The area below the line, as a rectangle of the peg's width, ends where a flat end would.
    middle = line + float((share * below).sum()) / across - _ROUND_END * 0.5 * across * steep
    near = (way <= line + 0.5 * width) & (way > line - _ACROSS * width) & (share > _FAINT)
    line_of = np.polyfit(way[near] - middle, off[near], 1, w=np.sqrt(share[near]))
    return along * middle + beside * float(line_of[1])


def _mixed(color: np.ndarray, peg: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Share (H, W) of the peg's colour (3,) in the mix with one of others (B, 3) that fits a pixel best."""
    best, share = np.full(color.shape[:2], np.inf), np.zeros(color.shape[:2])
    for other in others:
        apart = peg - other
        part = np.clip((color - other) @ apart / max(float(apart @ apart), 1.0), 0.0, 1.0)
        left = np.linalg.norm(color - other - part[..., None] * apart, axis=-1)
        share, best = np.where(left < best, part, share), np.minimum(left, best)
    return share


def _middle(share: np.ndarray) -> np.ndarray:
    rows, columns = np.indices(share.shape) + 0.5
    return np.array([(share * columns).sum(), (share * rows).sum()]) / share.sum()


def _grown(mask: np.ndarray, pixels: int) -> np.ndarray:
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * pixels + 1,) * 2, np.uint8)) > 0


def _shrunk(mask: np.ndarray, pixels: int) -> np.ndarray:
    return cv2.erode(mask.astype(np.uint8), np.ones((2 * pixels + 1,) * 2, np.uint8)) > 0
