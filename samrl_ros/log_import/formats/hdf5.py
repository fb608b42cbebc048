"""HDF5: files of MATLAB 7.3, robomimic, ALOHA and others; a group of one is a part."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.table import WIDEST, Table, as_column

SUFFIXES = (".h5", ".hdf5")


def read_hdf5_table(path: Path, group: str, where: str, matlab: bool = False) -> Table:
    """Datasets below a group, slashes as dots.

    Args:
        path: of the file.
        group: such as `data/demo_0`; empty for all of the file.
        where: key path, for messages.
        matlab: written by MATLAB, which stores arrays in reversed order.

    Raises:
        InputError: h5py is not installed, or there is no such group.
        OSError: no HDF5 file.
    """
    try:
        import h5py  # optional
    except ImportError as error:
        raise InputError(
            f"{where}: {path} is an HDF5 file; `pip install h5py` (extra `logs`)"
            + (", or save it with -v7" if matlab else "")
        ) from error
    table = Table(path)

    def visit(name: str, item: Any) -> None:
        numeric = isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and not name.startswith("#")
        if numeric and (matlab or int(np.prod(item.shape[1:])) <= WIDEST):
            value = np.asarray(item)
            table.columns[name.replace("/", ".")] = as_column(value.T if matlab else value)

    with h5py.File(path, "r") as file:
        start = file.get(group, None) if group else file
        if not isinstance(start, h5py.Group):
            raise InputError(f"{where}: {path.name} has no group {group!r}; it has {', '.join(groups(file))}")
        start.visititems(visit)
    return table


def demonstrations(path: Path) -> list[str]:
    """Groups of robomimic's and Isaac Lab's demonstrations, `data/demo_0` on, by number; else none.

    Raises:
        InputError: h5py is not installed, or the file cannot be read.
    """
    try:
        import h5py  # optional
    except ImportError as error:
        raise InputError(f"{path} is an HDF5 file; `pip install h5py` (extra `logs`)") from error
    try:
        with h5py.File(path, "r") as file:
            data = file.get("data")
            names = list(data) if isinstance(data, h5py.Group) else []
    except OSError as error:
        raise InputError(f"{path} cannot be read as HDF5: {error}") from error
    numbers = sorted(int(m[1]) for name in names if (m := re.fullmatch(r"demo_(\d+)", name)))
    return [f"data/demo_{number}" for number in numbers]


def groups(file: Any) -> list[str]:
    """Groups of an open file that hold datasets, by name."""
    import h5py

    found: dict[str, None] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found.setdefault(name.rpartition("/")[0] or "/", None)

    file.visititems(visit)
    return sorted(found)
