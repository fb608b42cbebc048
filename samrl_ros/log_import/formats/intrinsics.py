"""Intrinsics of a camera as tools write them beside its images, and how many raw numbers make a metre."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.common.text_files import read_text
from samrl_ros.log_import.formats.yaml_log import read_yaml_content

SUFFIXES = (".json", ".yaml", ".yml", ".txt", ".xml", ".ini", ".conf")
MATRICES = frozenset(
    "k camera_matrix intrinsic_matrix cameramatrix intrinsics intrinsic mtx camera_k".split()
)
SCALES = frozenset("depth_scale depth_units depth_unit png_depth_scale depth_factor".split())
_NUMBERS = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_MOST_BYTES = 1 << 16


@dataclass(frozen=True)
class Intrinsics:
    """Of one camera [pixels]."""

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True)
class StatedCamera:
    """What a file says of a camera."""

    path: Path
    intrinsics: Intrinsics | None
    per_metre: float | None  # raw numbers of one metre


def read_cameras(folders: list[Path]) -> list[StatedCamera]:
    """What files beside images say, those of a depth camera first; files that say nothing are passed over."""
    files = [
        f
        for folder in folders
        for f in sorted(folder.iterdir())
        if f.suffix.lower() in SUFFIXES and is_file(f)
    ]
    found = [camera for file in files if (camera := _read(file)) is not None]
    return sorted(found, key=lambda each: "depth" not in each.path.name.lower())


def _read(path: Path) -> StatedCamera | None:
    if path.stat().st_size > _MOST_BYTES:
        return None
    try:
        text = read_text(path, "intrinsics")
        content = (
            None if path.suffix.lower() == ".txt" and ":" not in text else read_yaml_content(text, str(path))
        )
    except InputError:
        return None
    if isinstance(content, dict | list):
        pairs = list(_pairs(content))
        intrinsics, scale = (
            _named(dict(reversed(pairs))),
            [v for k, v in pairs if k in SCALES and _is_number(v)],
        )
        per_metre = None if not scale or scale[0] <= 0 else scale[0] if scale[0] > 1 else 1.0 / scale[0]
        return StatedCamera(path, intrinsics, per_metre) if intrinsics or per_metre else None
    numbers = (
        [float(n) for n in _NUMBERS.findall(text)] if re.fullmatch(r"[\s\d.eE+\-,;#\[\]]*", text) else []
    )
    intrinsics = Intrinsics(*numbers) if len(numbers) == 4 and min(numbers) > 1 else _of_matrix(numbers)
    return StatedCamera(path, intrinsics, None) if intrinsics else None


def _pairs(content: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield str(key).lower(), value
            yield from _pairs(value)
    elif isinstance(content, list):
        for value in content:
            yield from _pairs(value)


def _named(pairs: dict[str, Any]) -> Intrinsics | None:
    alone = [
        pairs.get(a, pairs.get(b)) for a, b in (("fx", "f_x"), ("fy", "f_y"), ("cx", "ppx"), ("cy", "ppy"))
    ]
    if all(map(_is_number, alone)):
        return Intrinsics(*map(float, alone))
    for key, value in pairs.items():
        if key in MATRICES:
            numbers = value.get("data") if isinstance(value, dict) else value
            found = of_matrix(numbers)
            if found is not None:
                return found
    return None


def of_matrix(value: Any) -> Intrinsics | None:
    """Of a matrix (3, 3) or (4, 4), by rows or, as Open3D writes it, by columns; None of anything else."""
    try:
        return _of_matrix(np.asarray(value, dtype=float).ravel().tolist())
    except (TypeError, ValueError):
        return None


def _of_matrix(numbers: list[float]) -> Intrinsics | None:
    if len(numbers) not in (9, 16) or not np.isfinite(numbers).all():
        return None
    width = 3 if len(numbers) == 9 else 4
    k = np.array(numbers).reshape(width, width)[:3, :3]
    if k[0, 2] == 0 and k[2, 0] > 1:
        k = k.T
    fits = min(k[0, 0], k[1, 1], k[0, 2], k[1, 2]) > 1 and k[2, 2] == 1 and not k[2, :2].any()
    return Intrinsics(*(float(v) for v in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))) if fits else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
