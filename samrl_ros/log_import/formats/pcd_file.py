"""Clouds of points in files of the Point Cloud Library (PCD 0.7), as text or binary."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError

_HEAD = 1 << 13  # bytes within which `DATA` stands
_MOST_BYTES = 1 << 28  # of a file: 20 million points
_AT_SENSOR = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)  # position and quaternion (w first) of VIEWPOINT
_CODES = {"F": "f", "I": "i", "U": "u"}


def read_pcd(file: Path, where: str) -> np.ndarray:
    """Points (N, 3) as they stand in the file.

    Args:
        file: a PCD file; https://pointclouds.org/documentation/tutorials/pcd_file_format.html
        where: for messages.

    Raises:
        InputError: too large, compressed, cut short, without x, y and z, or not seen from its origin.
    """
    size = file.stat().st_size
    if size > _MOST_BYTES:
        raise InputError(f"{where}: {file.name} has {size >> 20} MB; at most {_MOST_BYTES >> 20} are read")
    content = file.read_bytes()
    start = content[:_HEAD].find(b"\nDATA ")
    if start < 0:
        raise InputError(f"{where}: {file.name} is no PCD file: no line DATA in its head")
    end = content.find(b"\n", start + 1)
    end = len(content) if end < 0 else end
    head = {
        words[0]: words[1:]
        for line in content[:end].decode("latin-1").splitlines()
        if (words := line.split()) and not words[0].startswith("#")
    }
    try:
        return _read_points(head, content[end + 1 :], file, where)
    except (KeyError, ValueError, IndexError, TypeError, ArithmeticError) as error:
        raise InputError(f"{where}: {file.name} cannot be read as a PCD file: {error}") from error


def _read_points(head: dict[str, list[str]], data: bytes, file: Path, where: str) -> np.ndarray:
    viewpoint = tuple(float(each) for each in head.get("VIEWPOINT", [])) or _AT_SENSOR
    if viewpoint != _AT_SENSOR:
        raise InputError(
            f"{where}: {file.name} was seen from VIEWPOINT {' '.join(head['VIEWPOINT'])}; give the points in"
            " the frame of their sensor, and VIEWPOINT 0 0 0 1 0 0 0"
        )
    fields = head["FIELDS"]
    counts = [int(each) for each in head.get("COUNT", ["1"] * len(fields))]
    if missing := [axis for axis in "xyz" if axis not in fields]:
        raise InputError(f"{where}: {file.name} has no {', '.join(missing)} among its fields {fields}")
    (kind,), (number,) = head["DATA"], head["POINTS"]
    place = [fields.index(axis) for axis in "xyz"]
    if kind == "ascii":
        before = np.concatenate([[0], np.cumsum(counts)])
        points = np.loadtxt(io.BytesIO(data), usecols=[int(before[k]) for k in place], ndmin=2)
    elif kind == "binary":
        sizes = [int(each) for each in head["SIZE"]]
        ends = np.cumsum(np.multiply(sizes, counts)).tolist()
        types = [np.dtype(f"<{_CODES[head['TYPE'][k]]}{sizes[k]}") for k in place]
        begins = [ends[k] - sizes[k] * counts[k] for k in place]
        rows = min(int(number), len(data) // ends[-1])
        axes = [np.ndarray(rows, t, data, k, (ends[-1],)) for t, k in zip(types, begins, strict=True)]
        points = np.column_stack(axes).astype(float)
    else:
        raise InputError(
            f"{where}: {file.name} holds DATA {kind}; ascii and binary are read:"
            f" pcl_convert_pcd_ascii_binary {file.name} plain.pcd 1"
        )
    if len(points) != int(number):
        raise InputError(
            f"{where}: {file.name} holds {len(points)} points, its head says {number}; is it whole?"
        )
    return points
