"""A driver's colour, depth and lens, and a segmenter's labels, as one image of the cell's camera."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.observation import Frame
from samrl_core.common.errors import InputError
from samrl_ros.conversions import from_message
from samrl_ros.hardware import adapter
from samrl_ros.hardware.preflight import MAX_PAIR_S, corners_seen

_PENDING = 30  # colour images whose labels may be on their way: a second at 30 Hz


@dataclass(frozen=True, eq=False)
class _Map:
    """Pixels of a source image for each pixel of the cell's, `n` by `n` for colour."""

    rows: np.ndarray  # (H, n)
    columns: np.ndarray  # (W, n)
    middle_rows: np.ndarray  # (H,)
    middle_columns: np.ndarray  # (W,)


class CameraAdapter:
    """Pairs images by their stamps, cuts and scales them to the cell's lens, and stamps all as the colour.

    Colour is averaged over a pixel's area; depth and labels are those in its middle, for a mean of two depths
    or labels is neither.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        self._intrinsics = intrinsics
        self._lens: Intrinsics | None = None
        self._map: _Map | None = None
        self._pending: OrderedDict[int, dict[str, Any]] = OrderedDict()  # by stamp of the colour image
        self._early: OrderedDict[tuple[str, int], Any] = OrderedDict()  # that came before their colour image

    def take(self, stream: str, message: Any) -> Frame | None:
        """Hand in a message of `color`, `depth`, `info` or `mask`; returns the image that it completes.

        Raises:
            InputError: an encoding, size or lens that does not fit; nothing is kept of it.
        """
        stamp = from_message.stamp_ns(message)
        if stream == "info":
            self._look_through(message)
            return None
        if stream == "color":
            self._pending[stamp] = {"color": message}
            while len(self._pending) > _PENDING:
                self._pending.popitem(last=False)
            for name in ("depth", "mask"):
                early = self._nearest([s for n, s in self._early if n == name], stamp)
                if early is not None:
                    self._pending[stamp][name] = self._early.pop((name, early))
            return self._completed(stamp)
        colour = self._nearest([s for s, parts in self._pending.items() if stream not in parts], stamp)
        if colour is None:
            self._early[stream, stamp] = message
            while len(self._early) > _PENDING:
                self._early.popitem(last=False)
            return None
        self._pending[colour][stream] = message
        return self._completed(colour)

    @staticmethod
    def _nearest(stamps: list[int], stamp: int) -> int | None:
        best = min(stamps, key=lambda s: abs(s - stamp), default=None)
        return best if best is not None and abs(best - stamp) <= 1e9 * MAX_PAIR_S else None

    def _look_through(self, info: Any) -> None:
        lens = from_message.intrinsics(info)
        if lens == self._lens:
            return
        self._lens, self._map = lens, _mapped(lens, self._intrinsics)

    def _completed(self, stamp: int) -> Frame | None:
        parts = self._pending[stamp]
        if len(parts) < 3 or self._map is None:
            return None
        del self._pending[stamp]
        color = from_message.image(adapter.color_image(parts["color"], ""))
        depth = from_message.image(adapter.depth_image(parts["depth"], ""))
        mask = from_message.image(adapter.mask_image(parts["mask"]))
        assert self._lens is not None
        size = (self._lens.height, self._lens.width)
        for name, pixels in (("color", color), ("depth", depth), ("mask", mask)):
            if pixels.shape[:2] != size:
                raise InputError(
                    f"{name} image is {pixels.shape[1]}x{pixels.shape[0]}, camera info says "
                    f"{size[1]}x{size[0]}; align the images"
                )
        m = self._map
        blocks = color[m.rows[:, None, :, None], m.columns[None, :, None, :]]
        mean = np.round(blocks.mean(axis=(2, 3))).astype(np.uint8)
        middle = np.ix_(m.middle_rows, m.middle_columns)
        return Frame(stamp, mean, np.ascontiguousarray(depth[middle]), np.ascontiguousarray(mask[middle]))


def _mapped(lens: Intrinsics, target: Intrinsics) -> _Map:
    """Which pixels of a lens's image are which of the target's; both look along the same axis."""
    u, v = corners_seen(lens, target)

    def places(count: int, per_pixel: int, edges: np.ndarray, size: int) -> np.ndarray:
        share = (np.arange(count * per_pixel) + 0.5) / (count * per_pixel)
        place = np.floor(edges[0] + share * (edges[1] - edges[0])).astype(np.int64)
        return np.clip(place, 0, size - 1).reshape(count, per_pixel)

    n = max(1, math.ceil(lens.fx / target.fx - 1e-6))
    return _Map(
        places(target.height, n, v, lens.height),
        places(target.width, n, u, lens.width),
        places(target.height, 1, v, lens.height)[:, 0],
        places(target.width, 1, u, lens.width)[:, 0],
    )
