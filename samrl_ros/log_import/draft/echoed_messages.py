"""Names of the columns that `ros2 topic echo --csv` writes: a message's fields in a row, and no header.

Messages are told by their width and by what their first cells and their quaternion are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FRAME, CHILD = "header.frame_id", "child_frame_id"
_HEADER = ("header.stamp.sec", "header.stamp.nanosec", FRAME)
_NANOSECONDS = 1_000_000_000
_TURNED = 0.01  # by which a quaternion may be off one


def _fields(name: str, letters: str) -> tuple[str, ...]:
    return tuple(f"{name}.{letter}" for letter in letters)


def _numbered(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{k}" for k in range(36))


_POSE = (*_fields("position", "xyz"), *_fields("orientation", "xyzw"))
_TRANSFORM = (*_fields("translation", "xyz"), *_fields("rotation", "xyzw"))
_TWIST = (*_fields("twist.linear", "xyz"), *_fields("twist.angular", "xyz"))
_MESSAGES = (
    (*_HEADER, *_fields("point", "xyz")),
    (*_HEADER, *_POSE),
    (*_HEADER, CHILD, *_TRANSFORM),
    (*_HEADER, *_POSE, *_numbered("covariance")),
    (*_HEADER, CHILD, *_POSE, *_numbered("covariance"), *_TWIST, *_numbered("twist_covariance")),
)


def echoed_names(rows: Sequence[Sequence[str]]) -> list[str]:
    """Fields of a stamped point, pose, transform or odometry, if rows (of cells) are such; else empty.

    Args:
        rows: of the file, from its first line on.
    """
    names = next((list(each) for each in _MESSAGES if rows and all(len(r) == len(each) for r in rows)), [])
    if not names:
        return []
    texts = [k for k, name in enumerate(names) if name in (FRAME, CHILD)]
    turns = [k for k, name in enumerate(names) if name.startswith(("orientation.", "rotation."))]
    if any(_is_number(row[k]) for row in rows for k in texts):
        return []
    try:
        numbers = np.array([[float(c) for k, c in enumerate(row) if k not in texts] for row in rows])
    except ValueError:
        return []
    stamps = numbers[:, :2]
    whole = (stamps == np.round(stamps)).all() and (stamps >= 0).all() and (stamps[:, 1] < _NANOSECONDS).all()
    turned = [[float(row[k]) for k in turns] for row in rows]
    unit = not turns or bool((np.abs(np.linalg.norm(turned, axis=1) - 1.0) < _TURNED).all())
    return names if whole and unit else []


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
