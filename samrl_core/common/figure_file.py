"""Pictures of figures, written whole or not at all."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from samrl_core.common.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: Path, **options: Any) -> None:
    """Write a figure; the path's suffix says in which format.

    Args:
        figure: of matplotlib.
        path: of the picture; its folder is made if it is missing.
        options: of `Figure.savefig`.

    Raises:
        InputError: there is no room for it.
    """
    write_whole(path, picture_bytes(figure, path.suffix.removeprefix("."), **options))


def picture_bytes(figure: Figure, kind: str = "png", **options: Any) -> bytes:
    """A figure as the bytes of a file of that kind; options of `Figure.savefig`."""
    picture = io.BytesIO()
    figure.savefig(picture, format=kind, **options)
    return picture.getvalue()
