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
    scopes store their signals so), cells `name{2}`.
    """
    from scipy.io import loadmat

    found: dict[str, np.ndarray] = {}
    for name, value in loadmat(path, squeeze_me=False, struct_as_record=True).items():
        if not name.startswith("__"):
            _add(found, name, value)
    return found


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
