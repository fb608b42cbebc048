"""Renders of fused and updated meshes beside the photo that they should equal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.model.fusion.masked_view import MaskedView

_MARGIN = 6  # about the body [px]
_TITLES = {
    "fused": "fused",
    "fused_updated": "fused, then eq. 7",
    "rough": "swollen by 3 mm",
    "rough_updated": "swollen, then eq. 7",
}


@dataclass(frozen=True, eq=False)
class PictureRow:
    """One body from one held-out pose."""

    name: str
    photo: MaskedView  # without noise
    rendered: dict[str, np.ndarray]  # per stage (H, W, 3)


def save_picture(rows: list[PictureRow], path: Path) -> None:
    """A row per body: photo, then each stage with its mean absolute difference below it; a PNG file."""
    columns = 1 + len(_TITLES)
    figure = Figure(figsize=(2.3 * columns, 4.9 * len(rows)), layout="constrained")
    axes = figure.subplots(2 * len(rows), columns, squeeze=False)
    for number, row in enumerate(rows):
        window = _window(row.photo.mask)
        cut = np.where(row.photo.mask[..., None], row.photo.color, 0.0)
        upper, lower = axes[2 * number], axes[2 * number + 1]
        upper[0].imshow(cut[window], interpolation="nearest")
        upper[0].set_title(f"{row.name}: photo", fontsize=9)
        for k, (stage, title) in enumerate(_TITLES.items(), start=1):
            image = np.clip(row.rendered[stage], 0.0, 1.0)
            apart = np.abs(image - cut).mean(axis=-1)
            upper[k].imshow(image[window], interpolation="nearest")
            upper[k].set_title(title, fontsize=9)
            lower[k].imshow(apart[window], vmin=0.0, vmax=0.3, cmap="magma", interpolation="nearest")
            error = apart.sum() / row.photo.mask.sum()
            lower[k].set_title(f"difference {error:.4f}", fontsize=9)
    for axis in axes.ravel():
        axis.set_axis_off()
    FigureCanvasAgg(figure).print_png(str(path))


def _window(mask: np.ndarray) -> tuple[slice, slice]:
    found = []
    for axis, size in ((1, mask.shape[0]), (0, mask.shape[1])):
        inside = np.flatnonzero(mask.any(axis=axis))
        found.append(slice(max(0, inside[0] - _MARGIN), min(size, inside[-1] + _MARGIN + 1)))
    return found[0], found[1]
