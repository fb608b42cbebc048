"""Homogeneous matrices in columns of numbers: whether they are some, and whether by rows or by columns."""

from __future__ import annotations

import numpy as np

ROWS, COLUMNS = "rows", "columns"
_TURNED = 1e-3  # by which a rotation of a log may be no rotation
_ROUNDED = 0.02  # likewise of nine numbers called a rotation, which may have two decimals
WIDTHS = (12, 16)


def matrix_order(numbers: np.ndarray) -> str:
    """`rows`, or `columns` as libfranka's `O_T_EE`; empty where the numbers are no transforms.

    The last row (0, 0, 0, 1) tells the two apart; of twelve numbers it is left out, and in one order alone
    they hold rotations.

    Args:
        numbers: (N, 12) or (N, 16), NaN where nothing was seen.
    """
    seen = numbers[np.isfinite(numbers).all(axis=1)]
    if not len(seen):
        return ""
    if numbers.shape[1] == WIDTHS[0]:
        by_rows, by_columns = seen.reshape(-1, 3, 4), np.swapaxes(seen.reshape(-1, 4, 3), 1, 2)
    else:
        by_rows = seen.reshape(-1, 4, 4)
        by_columns = np.swapaxes(by_rows, 1, 2)
    return next((o for o, m in ((ROWS, by_rows), (COLUMNS, by_columns)) if _are_transforms(m)), "")


def row_by_row(width: int, order: str) -> list[int]:
    """Places (width,) at which the numbers of the matrix stand, row by row."""
    places = np.arange(width)
    return [int(k) for k in (places.reshape(4, -1).T.ravel() if order == COLUMNS else places)]


def are_rotations(numbers: np.ndarray) -> bool:
    """Whether rows (N, 9) are rotations: nine numbers are a camera's intrinsics or a covariance as well."""
    seen = numbers[np.isfinite(numbers).all(axis=1)]
    return bool(len(seen)) and _are_transforms(seen.reshape(-1, 3, 3), _ROUNDED)


def _are_transforms(matrices: np.ndarray, within: float = _TURNED) -> bool:
    turns = matrices[:, :3, :3]
    off = float(np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max())
    if matrices.shape[1] == 4:
        off = max(off, float(np.abs(matrices[:, 3] - [0.0, 0.0, 0.0, 1.0]).max()))
    return off < within and bool((np.linalg.det(turns) > 0).all())
