"""Poses in the columns of a table: a position and a rotation, or one matrix, that go by one name."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.table import Table

LEAST = 6  # rows, below which no pair of poses says anything
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_UNITS = {"m": "m", "cm": "cm", "mm": "mm", "rad": "rad", "deg": "deg"}
_POSITION = {"p", "pos", "position", "t", "trans", "translation", "tvec", "loc", "location", "xyz"}
_QUATERNION = {"q", "quat", "quaternion", "orientation", "rotation", "rot", "ori"}
_VECTOR = {"rvec", "rotvec", "rodrigues", "aa", "axisangle"}
_EULER = {"rpy", "euler"}
_MATRIX = {"r", "rot", "rotation", "rmat", "t", "tf", "transform", "pose", "matrix", "h"}
_LETTERS = ("x", "y", "z", "w")
_FULL = {"position": 3, "quaternion": 4, "rotation_vector": 3, "rpy": 3}


@dataclass
class FoundTrack:
    """Where the numbers of one pose stand in a table."""

    stem: tuple[str, ...]  # words that its names share
    columns: dict[str, list[str]] = field(default_factory=dict)  # position, quaternion, ... -> columns
    order: str = ""  # of a quaternion: xyzw by names, wxyz, or empty where nothing says it
    unit: str = ""  # of the position, where the names say it
    angle_unit: str = ""

    @property
    def rotation(self) -> str:
        """What gives the rotation, a key of the mapping; empty if nothing does."""
        kinds = ("matrix", "quaternion", "rotation_matrix", "rotation_vector", "rpy")
        return next((k for k in kinds if k in self.columns), "")

    @property
    def whole(self) -> bool:
        """Whether it is a pose."""
        return self.rotation == "matrix" or bool(self.rotation and "position" in self.columns)

    @property
    def names(self) -> str:
        """Its columns, as a reader finds them."""
        return ", ".join(name for names in self.columns.values() for name in names)


def find_tracks(table: Table) -> list[FoundTrack]:
    """Every pose of a table, in the order of its columns."""
    found: dict[tuple[str, ...], FoundTrack] = {}
    single: dict[tuple[tuple[str, ...], str], dict[str, str]] = defaultdict(dict)
    units: dict[tuple[tuple[str, ...], str], str] = {}
    for name in table.columns:
        values = numbers_of(table, name)
        if values is None or len(values) < LEAST:
            continue
        words = [w.lower() for w in _WORD.findall(name)]
        unit = _UNITS.get(words[-1], "") if len(words) > 1 else ""
        words = words[:-1] if unit else words
        if values.ndim == 2:
            _add_array(found, name, words, values.shape[1], unit)
        elif (one := _component(words)) is not None:
            stem, kind, letter = one
            single[stem, kind][letter] = name
            units[stem, kind] = unit
    for (stem, kind), columns in single.items():
        letters = _LETTERS[: _FULL[kind]]
        if set(columns) != set(letters):
            continue
        track = found.setdefault(stem, FoundTrack(stem))
        track.columns[kind] = [columns[letter] for letter in letters]
        if kind == "quaternion":
            track.order = "xyzw"  # by their letters
        elif kind == "position":
            track.unit = units[stem, kind]
        else:
            track.angle_unit = units[stem, kind]
    return [track for track in found.values() if track.whole]


def _component(words: list[str]) -> tuple[tuple[str, ...], str, str] | None:
    """Words of the whole, what it is, and the letter of one number of it; None if it is none."""
    if not words:
        return None
    *rest, last = words
    if last in ("roll", "pitch", "yaw"):
        return tuple(rest), "rpy", _LETTERS[("roll", "pitch", "yaw").index(last)]
    for prefixes, kind in ((("q",), "quaternion"), (("t", "p"), "position"), (("r",), "rotation_vector")):
        if len(last) == 2 and last[0] in prefixes and last[1] in _LETTERS[: _FULL[kind]]:
            return tuple(rest), kind, last[1]
    if last not in _LETTERS:
        return None
    before = rest[-1] if rest else ""
    for names, kind in (
        (_QUATERNION, "quaternion"), (_VECTOR, "rotation_vector"), (_EULER, "rpy"), (_POSITION, "position"),
    ):  # fmt: skip
        if before in names and last in _LETTERS[: _FULL[kind]]:
            return tuple(rest[:-1]), kind, last
    return (tuple(rest), "position", last) if last != "w" else None


def _add_array(
    found: dict[tuple[str, ...], FoundTrack], name: str, words: list[str], width: int, unit: str
) -> None:
    """An array (N, width) that is a part of a pose by its name and width."""
    first = words[0] if words else ""
    kind, known = {
        3: (
            "rotation_vector" if set(words) & _VECTOR or first == "rvec" else "position",
            _VECTOR | _POSITION,
        ),
        4: ("quaternion", _QUATERNION),
        9: ("rotation_matrix", _MATRIX),
        12: ("matrix", _MATRIX),
        16: ("matrix", _MATRIX),
    }.get(width, ("", set()))
    if not kind:
        return
    stem = tuple(words[1:] if first in known else words[:-1] if words and words[-1] in known else words)
    track = found.setdefault(stem, FoundTrack(stem))
    track.columns[kind] = [name]
    if kind == "position":
        track.unit = unit
    elif kind == "quaternion":
        track.order = next((o for o in ("wxyz", "xyzw") if o in words), "")


def position_of(table: Table, track: FoundTrack) -> np.ndarray:
    """Positions (N, 3) as they stand in the log."""
    if track.rotation == "matrix":
        (name,) = track.columns["matrix"]
        return np.asarray(table.numbers(name, "the log"))[:, [3, 7, 11]]
    parts = [np.asarray(table.numbers(name, "the log")) for name in track.columns["position"]]
    return parts[0] if len(parts) == 1 else np.stack(parts, axis=1)


def named_frames(words: tuple[str, ...]) -> tuple[str, str] | None:
    """(child, parent) of a name that says both, as tag2cam, tag_in_camera, cam_T_tag; None of another."""
    for between, flipped in (("2", False), ("to", False), ("in", False), ("t", True), ("tf", True)):
        if between in words[1:-1]:
            k = words.index(between, 1)
            child, parent = " ".join(words[:k]), " ".join(words[k + 1 :])
            return (parent, child) if flipped else (child, parent)
    return None
