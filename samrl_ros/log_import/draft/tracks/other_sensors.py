"""Tables of sensors that tell where nothing is: what an IMU feels, and corners that a camera saw."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path

from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import is_time, meaning, words_in
from samrl_ros.log_import.table import Table

# In names of columns and of files. `acc` of a file may be anything.
_INERTIAL = frozenset(
    "accelerometer accel acceleration accelerations gyroscope gyro gyr magnetometer mag magnetic imu".split()
)
_BESIDE = frozenset("temperature temp accuracy absolute norm magnitude covariance orientation seq".split())
_AXES = frozenset("xyz")
_TRIADS = {letter: {f"{letter}{axis}" for axis in "xyz"} for letter in "agwm"}  # ax, ay, az; gx, gy, gz
_ACCELERATION = re.compile(r"m ?/? ?s ?(?:\^|\*\*)?-?[2\N{SUPERSCRIPT TWO}](?!\d)")  # m/s^2, m s^-2
_TURN_RATE = re.compile(r"(?:rad|deg|\N{DEGREE SIGN}) ?/? ?s(?:\^-1)?(?![a-z^])", re.IGNORECASE)
_LETTERED = re.compile(r"_[xyz](?:\W|$)| [xyz] ", re.IGNORECASE)  # w_RS_S_x [rad s^-1], Gyroscope x (rad/s)
_CORNERS = frozenset(("corner", "corners"))
_MACHINES = frozenset(("effort", "current", "voltage", "position", "velocity"))


class OtherSensor(StrEnum):
    """What a table is of, if it tells no motion."""

    NONE = "none"
    INERTIAL = "inertial"
    CORNERS = "corners"


def find_sensor(path: Path, table: Table) -> OtherSensor:
    """What a table is of by its names: all of its numbers are an IMU's, or some are corners in an image.

    Args:
        path: of the file, whose name says what bare `x`, `y`, `z` are.
        table: of the log.
    """
    names = [name for name in table.columns if not is_time(name) and numbers_of(table, name) is not None]
    stem = words_in(path.stem)
    if names and _all_inertial(names, set(stem)):
        return OtherSensor.INERTIAL
    others = [name for name in names if not _CORNERS & set(words_in(name))]
    said = len(others) < len(names) or "corners" in stem
    machine = any(meaning(name).quantity in _MACHINES for name in others)
    return OtherSensor.CORNERS if said and not machine else OtherSensor.NONE


def _all_inertial(names: list[str], stem: set[str]) -> bool:
    """Whether columns are accelerations, or three turning rates or more, and what an IMU has beside them."""
    last = {words_in(name)[-1] for name in names if words_in(name)}
    lettered = set().union(*(triad for triad in _TRIADS.values() if triad <= last))
    lettered = lettered if _TRIADS["a"] <= lettered else set()
    felt, accelerations = 0, False
    for name in names:
        words = set(words_in(name))
        named = bool(words & _INERTIAL) or {"angular", "velocity"} <= words
        bare = words <= _AXES and bool(words) and bool(stem & _INERTIAL)
        rate = bool(_TURN_RATE.search(name)) and bool(_LETTERED.search(name))
        push = bool(_ACCELERATION.search(name)) or "acceleration" in words
        if push or named or bare or rate or words & lettered:
            felt += 1
            accelerations |= push or bool(words & _TRIADS["a"])
        elif not words & _BESIDE:
            return False
    return accelerations or felt >= len(_AXES)
