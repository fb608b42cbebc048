"""Poses and positions in the columns of a table: numbers that go by one name."""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from dataclasses import replace

import numpy as np

from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import FRAME_LETTERS, is_time
from samrl_ros.log_import.draft.tracks.angle_names import LETTERS, OPENCV, add_makers_angles, part_opencv
from samrl_ros.log_import.draft.tracks.found_track import LEAST, Component, FoundTrack, matrix_parts
from samrl_ros.log_import.draft.tracks.matrix_columns import WIDTHS, are_rotations
from samrl_ros.log_import.draft.tracks.unnamed_tracks import are_mostly_quaternions, find_unnamed
from samrl_ros.log_import.pose_specs import LENGTHS
from samrl_ros.log_import.table import Table

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_UNITS = {"m": "m", "cm": "cm", "mm": "mm", "rad": "rad", "deg": "deg", "in": "in", "px": "px"}
_POSITION = {"p", "pos", "position", "t", "trans", "translation", "tvec", "loc", "location", "xyz"}
_ALONE = {"position", "pos", "posicion", "posicao", "posizione"}  # of what moves along one axis, with a unit
_PLACES = _ALONE | {"coordinate", "coord", "location", "loc"}  # behind a letter: x position (m)
HEIGHTS = {"height", "altitude", "altura", "hoehe", "hohe", "hauteur", "altezza", "h"}
_IN_PLANE = {"xy", "xz", "yz"}  # of arrays with two numbers
_QUATERNION = {"q", "quat", "quaternion", "orientation", "rotation", "rot", "ori"}
_VECTOR = {"rvec", "rotvec", "rodrigues", "aa", "axisangle"}
_EULER = {"rpy", "euler"}
_MATRIX = {"r", "rot", "rotation", "rmat", "t", "tf", "transform", "pose", "matrix", "h"}
RATES = frozenset(
    "v vel velocity velocities speed linear angular twist acc accel a acceleration gyro omega force forces"
    " torque torques wrench tau mag field b bias std cov covariance err error euler size scale".split()
)
_PLURALS = {"rvecs": "rvec", "tvecs": "tvec", "rmats": "rmat"}  # OpenCV's calibrateCamera gives lists of them
_SPELT = re.compile(r"(?<![a-z])(rot(?:ation)?|trans(?:lation)?)[_ .-]*vec(?:tor)?s?(?![a-z])", re.IGNORECASE)
_LETTERS = ("x", "y", "z", "w")
_FULL = {"position": 3, "quaternion": 4, "rotation_vector": 3, "rpy": 3}
_NINE = 9  # numbers of a rotation
JUMP = 5.0  # typical steps to the origin, from which on a zero is no place


def find_tracks(table: Table) -> list[FoundTrack]:
    """Every pose of a table, in the order of its columns."""
    return [track for track in find_positions(table) if track.whole]


def find_positions(table: Table, plural: bool = False) -> list[FoundTrack]:
    """Every pose, and every position of one to three axes, in the order of the columns.

    Args:
        table: of the log.
        plural: whether an array called `positions` is a body's; of a whole log they are as often joints'.
    """
    found: dict[tuple[str, ...], FoundTrack] = {}
    single: dict[tuple[tuple[str, ...], str], dict[str, str]] = defaultdict(dict)
    units: dict[tuple[tuple[str, ...], str], str] = {}
    numbered: dict[tuple[str, ...], dict[int, str]] = defaultdict(dict)
    counted: dict[tuple[str, ...], dict[int, str]] = defaultdict(dict)
    letters: dict[tuple[str, ...], dict[str, tuple[str, str]]] = defaultdict(dict)
    arrays: dict[str, np.ndarray] = {}
    for name in table.columns:
        values = numbers_of(table, name)
        if values is None or len(values) < LEAST:
            continue
        arrays[name] = values
        words = _words_of(name)
        if plural:
            words = ["position" if word == "positions" else word for word in words]
        unit = table.units.get(name, "")
        if len(words) > 1 and words[-1] in _UNITS:
            unit, words = unit or _UNITS[words[-1]], words[:-1]
        if unit and len(words) > 1 and words[-1] in _PLACES and words[-2] in _LETTERS[:3]:
            # Without a unit, x_pos is a gantry's joint as often.
            words = [*words[:-2], words[-1], words[-2]]
        if values.ndim == 2:
            _add_array(found, name, words, values, unit)
        elif (one := _component(words)) is not None:
            stem, kind, letter = one
            single[stem, kind][letter] = name
            units[stem, kind] = unit
        elif _is_pose_number(words):
            numbered[tuple(w for w in words[:-1] if w != "pose")][int(words[-1])] = name
        elif words and words[-1] in LETTERS:
            letters[tuple(words[:-1])][words[-1]] = (name, unit)
        elif len(words) > 1 and words[-1].isdecimal():
            counted[tuple(words[:-1])][int(words[-1])] = name
    _add_helical_quaternions(single)
    part_opencv(single, units)
    add_makers_angles(single, units, letters)
    for (stem, kind), columns in single.items():
        axes = [letter for letter in _LETTERS[: _FULL[kind]] if letter in columns]
        if kind != "position" and len(axes) < _FULL[kind]:
            continue
        track = found.setdefault(stem, FoundTrack(stem))
        track.columns[kind] = [Component(columns[letter]) for letter in axes]
        if kind == "quaternion":
            track.order = "xyzw"  # by their letters
        elif kind == "position":
            track.unit, track.axes = units[stem, kind], "".join(axes)
        else:
            track.angle_unit = units[stem, kind]
            track.vague = kind == "rotation_vector" and not set(_words_of(columns["x"])) & _VECTOR
    for stem, named in numbered.items():
        _add_parts(found, stem, [Component(named[k]) for k in sorted(named)])
    for stem, named in counted.items():
        parts = [Component(named[k]) for k in sorted(named)]
        numbers = np.column_stack([arrays[part.column] for part in parts])
        if len(named) == _NINE and stem[-1] in _MATRIX and are_rotations(_drop_zeros(numbers)):
            found.setdefault(stem, FoundTrack(stem)).columns["rotation_matrix"] = parts
        if len(named) in WIDTHS:
            if listed := matrix_parts(parts, numbers):
                found.setdefault(stem, FoundTrack(stem)).columns["matrix"] = listed
    tracks = _paired(list(found.values()))
    return tracks or find_unnamed(table, arrays) or _find_height(arrays, table.units)


def _find_height(arrays: dict[str, np.ndarray], units: dict[str, str]) -> list[FoundTrack]:
    """The only column that is called a height, or a position in a unit of length, as of what is dropped.

    A joint that slides is called so, too: who reads it must find that it falls.
    """
    named = {name: _words_of(name) for name, values in arrays.items() if values.ndim == 1}
    found = []
    for name, words in named.items():
        unit = units.get(name, "") or (words[-1] if len(words) > 1 else "")
        unit = unit if _UNITS.get(unit) in LENGTHS else ""
        if not set(words) & RATES and (set(words) & HEIGHTS or (unit and set(words) & _ALONE)):
            found.append(FoundTrack((), {"position": [Component(name)]}, axes="z", unit=unit))
    return found if len(found) == 1 else []


def _drop_zeros(numbers: np.ndarray) -> np.ndarray:
    """Rows (N, K) but those that are all zero, as loggers fill what was not seen."""
    return numbers[(numbers != 0.0).any(axis=1)]


def _paired(tracks: list[FoundTrack]) -> list[FoundTrack]:
    """A position and a rotation under names of their own are one pose where there is one of each."""
    positions = [t for t in tracks if not t.rotation]
    rotations = [t for t in tracks if t.rotation and not t.positioned]
    placed = [t for t in tracks if t.positioned]
    for one in positions:  # c0_tx, c0_ty, c0_tz beside c0_r00, ..., c0_r22, and c1_tx, ...
        own = [t for t in rotations if t.stem[:-1] == one.stem and t.stem[-1] in _MATRIX]
        if one.stem and one.axes == "xyz" and len(own) == 1 and len(positions) > 1:
            whole = replace(one, columns=one.columns | own[0].columns)
            placed = [whole if t is one else t for t in placed]
    if len(positions) == 1 and len(rotations) == 1 and positions[0].axes == "xyz":
        one, other = positions[0], rotations[0]
        pose = replace(
            one, columns=one.columns | other.columns, order=other.order, angle_unit=other.angle_unit
        )
        return [pose if t is one else t for t in placed]
    return placed


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
    if last == "rw":  # beside rx, ry, rz: a quaternion, as Vicon Tracker names it
        return tuple(rest), "quaternion", "w"
    if last not in _LETTERS:
        return None
    before = rest[-1] if rest else ""
    for names, kind in (
        (_QUATERNION, "quaternion"), (_VECTOR, "rotation_vector"), (_EULER, "rpy"), (_POSITION, "position"),
    ):  # fmt: skip
        if before in names and last in _LETTERS[: _FULL[kind]]:
            return tuple(rest[:-1]) or (OPENCV if before in ("rvec", "tvec") else ()), kind, last
    if rest and rest[0] == "q":  # q_RS_w, of EuRoC's data sets
        return tuple(rest[1:]), "quaternion", last
    if rest and rest[0] == "p" and last != "w":
        return tuple(rest[1:]), "position", last
    if len(rest) == 3 and rest[1] in ("p", "q") and (rest[1] == "q" or last != "w"):
        parent, kind, child = rest  # C_p_O_x, C_q_O_w: the object in the camera's frame
        frames = FRAME_LETTERS.get(child, child), "in", FRAME_LETTERS.get(parent, parent)
        return frames, "position" if kind == "p" else "quaternion", last
    if _is_rate(rest):
        return None
    return (tuple(rest), "position", last) if last != "w" else None


def _is_rate(rest: list[str]) -> bool:
    """Whether words before a letter name no place: a speed, or EuRoC's b_w_RS_S_x, where B_tcp_x is one."""
    return bool(set(rest) & (RATES - {"b"})) or rest[:2] == ["b", "w"] or rest[-1:] == ["b"]


def _add_helical_quaternions(single: dict[tuple[tuple[str, ...], str], dict[str, str]]) -> None:
    """RX, RY, RZ with RW beside them are a quaternion and no rotation vector."""
    for stem, kind in list(single):
        vector = single.get((stem, "rotation_vector"), {})
        if kind == "quaternion" and set(single[stem, kind]) == {"w"} and len(vector) == 3:
            single[stem, kind] = {**vector, "w": single[stem, kind]["w"]}
            del single[stem, "rotation_vector"]


def _add_array(
    found: dict[tuple[str, ...], FoundTrack], name: str, words: list[str], values: np.ndarray, unit: str
) -> None:
    """An array (N, width) that is a part of a pose by its name and width."""
    first, width = words[0] if words else "", values.shape[1]
    kind, known = {
        2: ("position", _POSITION | _IN_PLANE),
        3: (
            "rotation_vector" if set(words) & _VECTOR or first == "rvec" else "position",
            _VECTOR | _POSITION,
        ),
        # Four numbers that are called a pose: time, x, y and an angle, as in MIT's pushing data.
        4: ("planar" if _is_planar(words) else "quaternion", _QUATERNION),
        6: ("pose", _MATRIX if "pose" in words else set()),
        7: ("pose", _MATRIX),
        9: ("rotation_matrix", _MATRIX),
        12: ("matrix", _MATRIX),
        16: ("matrix", _MATRIX),
    }.get(width, ("", set()))
    if not kind or not known or (kind in ("position", "pose") and set(words) & RATES):
        return
    if width < 4 and not set(words) & (known | _VECTOR):  # two or three numbers are joints as well
        return
    if width == 9 and not are_rotations(values):
        return
    if width == 7 and not are_mostly_quaternions(values[:, 3:]):  # the joints of an arm are as many
        return
    if kind == "planar":
        if (np.diff(values[np.isfinite(values[:, 0]), 0]) > 0).all():
            parts = [Component(name, k) for k in range(4)]
            found[tuple(words)] = FoundTrack(
                tuple(words), {"position": parts[1:3]}, "xy", unit=unit, time=parts[0], angle=parts[3]
            )
        return
    stem = tuple(words[1:] if first in known else words[:-1] if words and words[-1] in known else words)
    if kind == "matrix":
        if listed := matrix_parts([Component(name, k) for k in range(width)], values):
            found.setdefault(stem, FoundTrack(stem)).columns["matrix"] = listed
        return
    track = found.setdefault(stem, FoundTrack(stem))
    order = next((o for o in ("wxyz", "xyzw") if o in words), "")
    if kind == "pose":
        _add_parts(found, stem, [Component(name, k) for k in range(width)])
        track.unit, track.order = unit, order
        return
    track.columns[kind] = [Component(name)]
    if kind == "position":
        track.unit, track.axes = unit, next((w for w in words if w in _IN_PLANE), "xyz"[:width])
    elif kind == "quaternion":
        track.order = order


def _is_planar(words: list[str]) -> bool:
    """Whether four numbers are called a pose, and no rotation of one."""
    return bool(set(words) & {"pose", "poses"}) and not set(words) & _QUATERNION


def _is_pose_number(words: list[str]) -> bool:
    """Whether a name counts the numbers of a pose, as actual_TCP_pose_0 of Universal Robots' recorder."""
    return len(words) > 1 and words[-1].isdecimal() and "pose" in words and not set(words) & RATES


def _add_parts(
    found: dict[tuple[str, ...], FoundTrack], stem: tuple[str, ...], parts: list[Component]
) -> None:
    """A position and then three or four numbers of a rotation."""
    if len(parts) not in (6, 7):
        return
    track = found.setdefault(stem, FoundTrack(stem))
    kind = "quaternion" if len(parts) == 7 else "rotation_vector"
    track.columns |= {"position": parts[:3], kind: parts[3:]}
    if kind == "rotation_vector" and {"tcp", "actual"} <= set(stem):  # RTDE guide: x, y, z, rx, ry, rz
        track.unit, track.angle_unit = "m", "rad"
    else:
        track.vague = kind == "rotation_vector"


def _words_of(name: str) -> list[str]:
    short = _SPELT.sub(lambda spelt: f" {spelt[1][0].lower()}vec ", name)  # rotation_vector, Translation_Vec
    plain = "".join(c for c in unicodedata.normalize("NFKD", short) if not unicodedata.combining(c))
    words = [w.lower() for w in _WORD.findall(plain)]
    return [_PLURALS.get(w, w) for w in words]


def numbers_of_parts(table: Table, parts: list[Component]) -> np.ndarray:
    """Numbers (N, K) of components, as they stand in the log."""
    blocks = []
    for part in parts:
        values = np.asarray(table.numbers(part.column, "the log"))
        values = values if values.ndim == 2 else values[:, None]
        blocks.append(values if part.index is None else values[:, part.index : part.index + 1])
    return np.concatenate(blocks, axis=1)


def position_of(table: Table, track: FoundTrack) -> np.ndarray:
    """Positions (N, K) of its axes as they stand in the log."""
    if track.rotation == "matrix":
        return numbers_of_parts(table, track.columns["matrix"])[:, [3, 7, 11]]
    return numbers_of_parts(table, track.columns["position"])


def empty_zeros(table: Table, track: FoundTrack) -> None:
    """Make lost frames that a tracker wrote as zeros empty in the table, and count them in the track.

    What comes from somewhere, is exactly at the origin for some frames, and then goes on, was not seen; nor
    was what has a rotation of zeros, which is none.
    """
    parts = track.columns.get("position", [])
    if not parts or track.rotation == "matrix":
        return
    position = numbers_of_parts(table, parts)
    zero = (position == 0.0).all(axis=1)
    turned = (
        track.columns.get(track.rotation, []) if track.rotation in ("quaternion", "rotation_matrix") else []
    )
    unturned = (numbers_of_parts(table, turned) == 0.0).all(axis=1) if turned else np.zeros(len(zero), bool)
    steps = np.linalg.norm(np.diff(position[~zero], axis=0), axis=1)
    if not 0 < zero.sum() < 0.5 * len(zero) or not len(steps):
        return
    away = float(np.nanmin(np.linalg.norm(position[~zero], axis=1)))
    if not (away > JUMP * float(np.nanmedian(steps)) or (unturned == zero).all()):
        return
    track.zeros = int(zero.sum())
    for name in {part.column for part in parts}:
        values = np.array(table.numbers(name, "the log"))
        values[zero] = np.nan
        table.columns[name] = values


def time_columns(table: Table, used: list[str]) -> list[str]:
    """Columns that are named as time and are no part of a pose."""
    return [name for name in table.columns if is_time(name) and name not in used]


def lettered_frames(words: tuple[str, ...]) -> tuple[str, str] | None:
    """(child, parent) of a name that says both by letters, as BOP's cam_R_m2c, cam_t_w2c; else None."""
    k = words.index("2", 1) if "2" in words[1:-1] else 0
    child, parent = (FRAME_LETTERS.get(word, "") for word in (words[k - 1], words[k + 1])) if k else ("", "")
    return (child, parent) if child and parent else None


def named_frames(words: tuple[str, ...]) -> tuple[str, str] | None:
    """(child, parent) of a name that says both, as tag2cam, tag_in_cam, tag_wrt_cam, cam_T_tag; else None."""
    if (lettered := lettered_frames(words)) is not None:
        return lettered
    for between, flipped in (
        ("2", False),
        ("to", False),
        ("in", False),
        ("wrt", False),
        ("t", True),
        ("tf", True),
    ):
        if between in words[1:-1]:
            k = words.index(between, 1)
            child, parent = " ".join(words[:k]), " ".join(words[k + 1 :])
            return (parent, child) if flipped else (child, parent)
    return None
