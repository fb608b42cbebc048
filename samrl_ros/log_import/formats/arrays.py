"""Files of arrays: .npz and .npy, and .mat of version 5."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from samrl_core.common.array_file import unpacked
from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats import mat_reader
from samrl_ros.log_import.formats.hdf5 import read_hdf5_table
from samrl_ros.log_import.table import Table, as_column

_LONGEST_MAT_S = 120.0  # [s] to read a file


def read_numpy_table(path: Path) -> Table:
    """Arrays by name, `data` in a .npy; fields of a structured one by theirs, `states.q` of one in a .npz.

    Raises what NumPy raises; nothing is unpickled.
    """
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        if loaded.dtype.names:
            return Table(path, _columns_of_fields("", loaded))
        return Table(path, {"data": as_column(loaded)})
    with loaded:
        found = {name: loaded[name] for name in loaded.files}
    columns: dict[str, np.ndarray | pd.Series] = {}
    for name, value in found.items():
        columns |= _columns_of_fields(name, value)
    return Table(path, columns)


def _columns_of_fields(name: str, value: np.ndarray) -> dict[str, np.ndarray | pd.Series]:
    """A column of numbers by its name; of a structured array one for each such field, `name.field`."""
    if value.dtype.names:
        columns: dict[str, np.ndarray | pd.Series] = {}
        for part in value.dtype.names:
            columns |= _columns_of_fields(f"{name}.{part}" if name else part, value[part])
        return columns
    if value.dtype.kind in "fiub":
        return {name: as_column(value)}
    return {}


def read_mat_table(path: Path, where: str) -> Table:
    """Arrays by name, fields of structs as `name.field`. Raises `InputError` where it cannot be read."""
    with path.open("rb") as stream:
        head = stream.read(128)
    if b"MATLAB 7.3" in head or head.startswith(b"\x89HDF"):
        return read_hdf5_table(path, "", where, matlab=True)
    # In a process of its own: SciPy's reader ends the whole process on some damaged files (1.18: SIGSEGV).
    command = [sys.executable, "-m", mat_reader.__name__, str(path)]
    try:
        run = subprocess.run(command, capture_output=True, timeout=_LONGEST_MAT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"{where}: {path} took more than {_LONGEST_MAT_S} s to read; save it anew, with -v7"
        ) from error
    if run.returncode:
        lines = run.stderr.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines and run.returncode > 0 else f"its reader died ({run.returncode})"
        raise InputError(f"{where}: {path} cannot be read as .mat: {reason}; save it anew, with -v7")
    return Table(path, {name: as_column(v) for name, v in unpacked(run.stdout, path).items()})
