"""What a real camera and a real segmenter get wrong, beyond the nominal sensor's noise."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.world.sensor_noise import RgbdNoise

_EDGE = 0.010  # difference of depth between neighbours from which on they are an edge [m]
_PATCH = (0.03, 0.08)  # radius of what is taken for an object, share of the image's width
_NEIGHBOURS = np.ones((3, 3), dtype=np.uint8)
_LEAST = 12  # a region of fewer pixels is not merged [px]


def noise_of(nominal: RgbdNoise, instance: CellInstance) -> RgbdNoise:
    """The nominal sensor with the instance's noise on top."""
    if instance.is_nominal:
        return nominal
    depth, mask = instance.depth, instance.segmentation
    return replace(
        nominal,
        subpixel=float(np.hypot(nominal.subpixel, depth.subpixel)),
        speckle=min(1.0, nominal.speckle + depth.speckle),
        mask_boundary=float(np.hypot(nominal.mask_boundary, mask.boundary)),
    )


class ImageErrors:
    """Errors of one camera, applied to what its lens lets through.

    Args:
        instance: whose depth, optics, look and segmentation count.
        intrinsics: for the image's size.
    """

    def __init__(self, instance: CellInstance, intrinsics: Intrinsics) -> None:
        self._depth, self._mask, self._optics = instance.depth, instance.segmentation, instance.optics
        self._shape = (intrinsics.height, intrinsics.width)
        self._shift = round(instance.depth.shift * intrinsics.width)
        look = instance.look
        light = (1.0 + look.light_strength) * (1.0 + instance.optics.exposure)
        warmth = np.array([1.0 + look.light_warmth, 1.0, 1.0 - look.light_warmth])
        self._gain = np.clip(light * warmth, 0.2, 3.0).astype(np.float32)

    def expose(self, color: np.ndarray) -> np.ndarray:
        """Colours (H, W, 3) uint8 in this light, exposure and focus, from float32 or uint8."""
        bright = color.astype(np.float32) * self._gain
        if self._optics.focus > 0.05:
            bright = cv2.GaussianBlur(bright, (0, 0), self._optics.focus)
        return np.clip(np.rint(bright), 0, 255).astype(np.uint8)

    def measure(self, rng: np.random.Generator, depth: np.ndarray) -> np.ndarray:
        """Depth (H, W) [m]: scaled, offset, shifted against the colours, mixed at edges."""
        d = self._depth
        out = depth * (1.0 + d.scale) + d.bias
        if self._shift:
            out = np.roll(out, self._shift, axis=1)
        filled = np.where(np.isfinite(out), out, 0.0).astype(np.float32)
        low, high = cv2.erode(filled, _NEIGHBOURS), cv2.dilate(filled, _NEIGHBOURS)
        row, column = np.nonzero((high - low > _EDGE) & (low > 0.0))
        chance, share = rng.random((2, len(row)))
        row, column, share = (one[chance < d.mixed_edges] for one in (row, column, share))
        out = out.copy()
        out[row, column] = low[row, column] + share * (high - low)[row, column]
        return out

    def segment(self, rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
        """Labels (H, W) uint8 with misses, merges, foreign objects and boundaries moved outwards."""
        s = self._mask
        out = self._grown(rng, mask)
        for label in np.flatnonzero(np.bincount(mask.ravel())[1:]) + 1:
            missed, merged, foreign = rng.random(3) < (s.miss, s.merge, s.foreign)
            middle, radius = rng.random(2) * self._shape, rng.uniform(*_PATCH) * self._shape[1]
            if foreign:
                out[(out == 0) & self._disc(middle, radius)] = label
            if merged:
                self._take_neighbour(out, int(label), 2.0 * radius)
            if missed:
                out[out == label] = 0
        return out

    def _grown(self, rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
        """Boundaries moved outwards by so many pixels, inwards if negative; a part of one by chance."""
        steps, chance = self._mask.growth, rng.random(self._shape)
        labelled = (mask > 0).astype(np.uint8)
        if steps < 0:
            inside = cv2.distanceTransform(labelled, cv2.DIST_L2, 3)
            return np.where(inside > chance - steps, mask, 0).astype(np.uint8)
        if not labelled.any():
            return mask.copy()
        outside = cv2.distanceTransform(1 - labelled, cv2.DIST_L2, 3)
        _, numbered = cv2.distanceTransformWithLabels(
            1 - labelled, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        index = np.asarray(numbered, dtype=np.intp)  # of the nearest pixel that has a label
        label_of = np.zeros(int(index.max()) + 1, np.uint8)
        label_of[index[mask > 0]] = mask[mask > 0]
        return np.where((mask == 0) & (outside <= chance + steps), label_of[index], mask).astype(np.uint8)

    def _disc(self, middle: np.ndarray, radius: float) -> np.ndarray:
        v, u = np.ogrid[: self._shape[0], : self._shape[1]]
        return (v - middle[0]) ** 2 + (u - middle[1]) ** 2 < radius**2

    def _take_neighbour(self, out: np.ndarray, label: int, reach: float) -> None:
        """A label gets what another has within `reach` [px] of their common border."""
        region = out == label
        if region.sum() < _LEAST:
            return
        border = cv2.dilate(region.astype(np.uint8), _NEIGHBOURS).astype(bool) & (out > 0) & (out != label)
        places = np.argwhere(border)
        if len(places):
            out[(out > 0) & self._disc(places[len(places) // 2], reach)] = label
