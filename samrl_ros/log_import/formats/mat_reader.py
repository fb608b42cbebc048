"""Numbers of a MAT file of version 5, as npz on standard output; run as a program, see `tables`."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np


def numbers(path: Path) -> dict[str, np.ndarray]:
    """Arrays of numbers by name, as MATLAB writes their paths. Raises what SciPy raises.

    Fields of a struct are `name.field`, those of an array of structs `name(2).field` (Simulink's
    scopes store their signals so), cells `name{2}`. Signals of dSPACE ControlDesk, of one raster, are called
    as the file names them, `theta [rad]`: its struct is called as the file is, so another in each recording.
    """
    from scipy.io import loadmat

    found: dict[str, np.ndarray] = {}
    for name, value in loadmat(path, squeeze_me=False, struct_as_record=True).items():
        if not name.startswith("__"):
            signals = _control_desk(value)
            found.update(signals)
            if not signals:
                _add(found, name, value)
    return found


def _control_desk(value: Any) -> dict[str, np.ndarray]:
    """Signals of dSPACE ControlDesk by name: X is the time, Y(k) has Name, Unit and Data; empty of others."""
    array = np.asarray(value)
    if array.size != 1 or not {"X", "Y"} <= set(array.dtype.names or ()):
        return {}
    clock, signals = (np.asarray(array.ravel()[0][part]) for part in ("X", "Y"))
    if clock.size != 1 or any(not {"Name", "Data"} <= set(a.dtype.names or ()) for a in (clock, signals)):
        return {}
    told: dict[str, np.ndarray] = {}
    for each in [*clock.ravel(), *signals.ravel()]:
        name, data = _text(each["Name"]), np.asarray(each["Data"])
        unit = _text(each["Unit"]) if "Unit" in (each.dtype.names or ()) else ""
        column = f"{name} [{unit}]" if any(letter.isalpha() for letter in unit) else name
        if not name or column in told or data.dtype.kind not in "fiub":
            return {}  # names alone do not tell them apart
        told[column] = data.ravel()
    return told


def _text(value: Any) -> str:
    array = np.asarray(value)
    return str(array.ravel()[0]).strip() if array.dtype.kind == "U" and array.size == 1 else ""


def _add(found: dict[str, np.ndarray], name: str, value: Any) -> None:
    array = np.asarray(value)
    if array.dtype.names:
        for part in array.dtype.names:
            for k, each in enumerate(array.ravel(order="F")):
                _add(found, f"{name}.{part}" if array.size == 1 else f"{name}({k + 1}).{part}", each[part])
    elif array.dtype.kind == "O":
        for k, each in enumerate(array.ravel(order="F")):
            _add(found, f"{name}{{{k + 1}}}", each)
    elif array.dtype.kind in "fiub":
        found[name] = array


if __name__ == "__main__":
    content = io.BytesIO()
    np.savez(content, **numbers(Path(sys.argv[1])))  # ty: ignore[invalid-argument-type]
    sys.stdout.buffer.write(content.getvalue())
