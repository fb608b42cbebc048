"""Files of arrays: .npz and .npy, and .mat of version 5."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from samrl_core.common.array_file import unpacked
from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats import mat_reader
from samrl_ros.log_import.formats.hdf5 import read_hdf5_table
from samrl_ros.log_import.table import Table, as_column

_LONGEST_MAT_S = 120.0  # [s] to read a file


def read_numpy_table(path: Path) -> Table:
    """Arrays by name, `data` in a .npy. Raises what NumPy raises; nothing is unpickled."""
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Table(path, {"data": as_column(loaded)})
    with loaded:
        found = {name: loaded[name] for name in loaded.files}
    return Table(path, {name: as_column(v) for name, v in found.items() if v.dtype.kind in "fiub"})


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
