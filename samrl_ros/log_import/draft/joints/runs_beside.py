"""Recordings beside each other in one file: `u_train`, `y_train`, `u_test`, `y_test`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from samrl_ros.log_import.table import Table

# As in sets of nonlinearbenchmark.org: a word behind an underscore, or a capital letter (uEst, yVal).
_SHARES = "train(?:ing)?|test(?:ing)?|val(?:id(?:ation)?)?|est(?:imation)?|ident(?:ification)?"
_SHARE = re.compile(
    rf"(?P<what>.+?)(?:_(?P<low>(?i:{_SHARES})_?\d*)|(?P<camel>(?:Train|Test|Val|Est)[a-z]*_?\d*))"
)
_KEPT_APART = re.compile(r"test|val", re.IGNORECASE)
_LEAST = 2  # quantities of each recording


def recordings_beside(table: Table) -> dict[str, dict[str, str]]:
    """Columns by quantity of each recording that one table holds beside others; empty where it holds one.

    Each recording has the same quantities, as `time`, `u` and `y`, and one length.
    """
    found: dict[str, dict[str, str]] = {}
    for name in table.columns:
        if told := _SHARE.fullmatch(name):
            found.setdefault(told["low"] or told["camel"], {})[told["what"]] = name
    named = [set(columns) for columns in found.values()]
    if len(found) < 2 or any(each != named[0] for each in named) or len(named[0]) < _LEAST:
        return {}
    return found if all(_same_length(table, columns) for columns in found.values()) else {}


def first_of(table: Table, beside: Mapping[str, Mapping[str, str]]) -> Table:
    """The table without the columns of all recordings but the first."""
    others = {name for columns in list(beside.values())[1:] for name in columns.values()}
    return replace(table, columns={name: each for name, each in table.columns.items() if name not in others})


def recordings_of(
    beside: Mapping[str, Mapping[str, str]], sources: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Entries of a mapping's recordings; those called test or validation are held out, else the last.

    Args:
        beside: columns by quantity of each recording.
        sources: of the first one.
    """
    apart = [name for name in beside if _KEPT_APART.search(name)] or list(beside)[-1:]
    apart = apart if len(apart) < len(beside) else apart[-1:]
    first = next(iter(beside.values()))
    made = []
    for name, columns in beside.items():
        names = {first[what]: column for what, column in columns.items()}
        entry: dict[str, Any] = {"name": name, "role": "held_out" if name in apart else "fit"}
        if names != {column: column for column in names}:
            entry["sources"] = {key: _renamed(dict(source), names) for key, source in sources.items()}
        made.append(entry)
    return made


def _renamed(entry: Any, names: Mapping[str, str]) -> Any:
    """A source with columns of other names; formulas' own names stay."""
    if isinstance(entry, dict):
        return {key: each if key == "file" else _renamed(each, names) for key, each in entry.items()}
    return names.get(entry, entry) if isinstance(entry, str) else entry


def _same_length(table: Table, columns: Mapping[str, str]) -> bool:
    """Whether all columns of a recording have as many samples, along their longer side."""
    sizes = set()
    for name in columns.values():
        cells = table.columns[name]
        sizes.add(len(cells) if isinstance(cells, pd.Series) else max(np.shape(cells), default=0))
    return len(sizes) == 1
