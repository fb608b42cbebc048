"""Times that a table holds in other ways than as one number: seconds and their rest, or frames counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.table import Table

_WHOLE = frozenset("s sec secs seconds".split())
_RESTS = {
    "nanoseconds": (1e-9, frozenset("ns nsec nsecs nanosec nanosecs nanoseconds".split())),
    "microseconds": (1e-6, frozenset("us usec usecs microsec microsecs microseconds".split())),
}
_FRAMES = frozenset("frame frames image img sample".split())


@dataclass(frozen=True, eq=False)
class SplitStamp:
    """A stamp of whole seconds in one column and the rest of the second in another."""

    entry: dict[str, str]  # of the mapping
    seconds: np.ndarray  # (N,) [s]
    proof: str
    rest: str  # column of the rest of the second
    unit: float  # of that column [s]


def split_stamp(table: Table, name: str) -> SplitStamp | None:
    """The stamp whose whole seconds a column holds, as ROS, C's timeval and ABB's EGM write it.

    The same time once in s and once in us is none: a rest stays below a second, and seconds are whole.

    Args:
        table: of the log.
        name: column whose name may say seconds.
    """
    words = _stamp_words(name)
    whole = numbers_of(table, name) if words and words[-1] in _WHOLE else None
    if whole is None or whole.ndim != 1 or (whole != np.round(whole)).any():
        return None
    for other in table.columns:
        more = _stamp_words(other)
        for key, (unit, names) in _RESTS.items():
            if not more or more[:-1] != words[:-1] or more[-1] not in names:
                continue
            rest = numbers_of(table, other)
            if rest is not None and rest.shape == whole.shape and ((rest >= 0) & (rest * unit < 1)).all():
                proof = f"{name!r} with {other!r}"
                return SplitStamp({"column": name, key: other}, whole + unit * rest, proof, other, unit)
    return None


def _stamp_words(name: str) -> list[str]:
    """Words of a name; KUKA's `ZeitInNanoSec` says its unit in two."""
    words = words_in(name)
    if len(words) > 1 and words[-2] in ("nano", "micro"):
        words = [*words[:-2], words[-2] + words[-1]]
    return words


def frame_counter(table: Table, used: Sequence[str] = ()) -> str:
    """A column that counts frames, of which some may be lost; empty where there is none."""
    for name in table.columns:
        if name in used or not set(words_in(name)) & _FRAMES:
            continue
        values = numbers_of(table, name)
        if values is not None and values.ndim == 1 and len(values) > 1:
            if (values == np.round(values)).all() and (np.diff(values) >= 1).all():
                return name
    return ""
