"""Names of columns in which one letter is a word: `hip_p`, `knee_v_des`, `hip_t`."""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np

from samrl_ros.log_import.draft.column_names import SLOT
from samrl_ros.log_import.draft.evidence import runs_on

LETTERS = {"p": "position", "v": "velocity", "t": "torque"}
_BETWEEN = re.compile(r"([_./ ])")


def torques_by_letter(names: Collection[str], columns: dict[str, np.ndarray]) -> list[str]:
    """Names such as `hip_t` that are no times: p and v stand beside them, and their numbers do not run on.

    Args:
        names: of columns that are called as times are.
        columns: (N,) by name, all of the table.
    """
    return [
        name
        for name in names
        if letter_of(name, slot=False) == "t" and not runs_on(columns[name])
        and any({with_letter(part, "p"), with_letter(part, "v")} <= set(columns)
                for part in (name, _up_to_letter(name)))
    ]  # fmt: skip


def letter_of(name: str, alone: bool = False, slot: bool = True) -> str:
    """The letter that is a word of a name of several; empty where none is, or where more is said of it."""
    words = _BETWEEN.split(name)[::2]
    found = [word for word in words if word in LETTERS]
    others = len(words) == 2 if alone else len(words) > 1
    return found[0] if len(found) == 1 and others and (SLOT in words or not slot) else ""


def with_letter(name: str, other: str) -> str:
    """The name with another word in place of its letter."""
    return "".join(other if part in LETTERS else part for part in _BETWEEN.split(name))


def _up_to_letter(name: str) -> str:
    parts = _BETWEEN.split(name)
    return "".join(parts[: next(k for k, part in enumerate(parts) if part in LETTERS) + 1])
