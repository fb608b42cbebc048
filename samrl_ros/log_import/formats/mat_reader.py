"""Numbers of a MAT file of version 5, as npz on standard output; run as a program, see `tables`."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np


def numbers(path: Path) -> dict[str, np.ndarray]:
    """Arrays of numbers by name; fields of a struct as `name.field`. Raises what SciPy raises."""
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
            if array.size == 1:
                _add(found, f"{name}.{part}", array.ravel()[0][part])
    elif array.dtype.kind in "fiub":
        found[name] = array


if __name__ == "__main__":
    content = io.BytesIO()
    np.savez(content, **numbers(Path(sys.argv[1])))  # ty: ignore[invalid-argument-type]
    sys.stdout.buffer.write(content.getvalue())
