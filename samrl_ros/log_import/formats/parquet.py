"""Parquet and Feather files, and LeRobot datasets (v2.0, v2.1, v3.0): a folder, an episode is a part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.common.text_files import parse_json, read_text
from samrl_ros.log_import.table import WIDEST, Table, rows_as_column

_INFO = Path("meta/info.json")
_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # of a date, in a second
MOST_EPISODES = 2_000_000  # of a dataset; the largest public ones have about one


def is_lerobot(path: Path) -> bool:
    """Whether a folder is a LeRobot dataset."""
    return is_file(path / _INFO)


def read_parquet_table(path: Path, where: str) -> Table:
    """A Parquet file. Raises `InputError` where pyarrow is missing or cannot read it."""
    return _table(path, _arrow(path, where).read_table(path), {})


def read_feather_table(path: Path, where: str) -> Table:
    """A Feather (Arrow IPC) file. Raises `InputError` where pyarrow is missing or cannot read it."""
    _arrow(path, where)
    from pyarrow import feather

    return _table(path, feather.read_table(path), {})


def read_lerobot_table(path: Path, part: str, where: str) -> Table:
    """One episode of a dataset; `observation.state.NAME` beside `observation.state` where names are given.

    Args:
        path: folder of the dataset.
        part: number of the episode.
        where: key path, for messages.

    Raises:
        InputError: no number, no such episode, or files that cannot be read.
    """
    if not part.isdecimal():
        raise InputError(f"{where}: part {part!r} of {path.name} must be an episode's number, such as 0")
    parquet = _arrow(path, where)
    names = _names(path)
    files = sorted((path / "data").rglob("*.parquet"))
    own = [file for file in files if file.stem == f"episode_{int(part):06d}"]  # v2; v3 has several in a file
    for file in own or files:
        table = parquet.read_table(file, filters=[("episode_index", "=", int(part))])
        if table.num_rows:
            made = _table(path, table, names)
            time = made.columns.get("timestamp")
            made.time = time if isinstance(time, np.ndarray) else None
            return made
    known = episodes(path)
    has = f"{known[0]} to {known[-1]}" if known else "none"
    raise InputError(f"{where}: {path.name} has no episode {part}; it has {has}")


def episodes(path: Path) -> list[str]:
    """Numbers of a dataset's episodes, as `meta/info.json` counts them."""
    total = _info(path).get("total_episodes", 0)
    if not isinstance(total, int) or total < 0 or total > MOST_EPISODES:
        raise InputError(
            f"{path / _INFO}: total_episodes is {total!r:.50}, must be a whole number up to {MOST_EPISODES}"
        )
    return [str(k) for k in range(total)]


def _info(path: Path) -> dict[str, Any]:
    info = parse_json(read_text(path / _INFO, "the dataset's info"), str(path / _INFO))
    if not isinstance(info, dict):
        raise InputError(f"{path / _INFO} must be an object")
    return info


def _names(path: Path) -> dict[str, list[str]]:
    """Names of the numbers of each feature; given as a list, or as a list by kind (`{"motors": [...]}`)."""
    features = _info(path).get("features")
    found = {}
    for key, about in (features if isinstance(features, dict) else {}).items():
        names = about.get("names") if isinstance(about, dict) else None
        if isinstance(names, dict) and len(names) == 1:
            names = next(iter(names.values()))
        if isinstance(names, list) and all(isinstance(name, str) for name in names):
            found[key] = names
    return found


def _arrow(path: Path, where: str) -> Any:
    try:
        import pyarrow.parquet as parquet  # optional
    except ImportError as error:
        raise InputError(f"{where}: {path} is Parquet; `pip install pyarrow` (extra `logs`)") from error
    return parquet


def _table(path: Path, arrow: Any, names: dict[str, list[str]]) -> Table:
    import pyarrow as pa

    table = Table(path)
    for name, column in zip(arrow.column_names, arrow.columns, strict=True):
        kind = column.type
        if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
            values = rows_as_column(column.to_pylist())
            if values is None or values.ndim != 2 or values.shape[1] > WIDEST:
                table.notes.append(f"{name} holds lists of different length; left out")
                continue
        elif pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            values = _seconds(column)
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            values = np.asarray(column.to_numpy(), dtype=float)
        else:
            continue  # text, images
        table.columns[name] = values
        labels = names.get(name, [])
        if values.ndim == 2 and values.shape[1] == len(labels) == len(set(labels)):
            table.columns |= {f"{name}.{label}": values[:, k] for k, label in enumerate(labels)}
    return table


def _seconds(column: Any) -> np.ndarray:
    """Dates [s since 1970] or durations [s] of pandas (N,); missing ones are NaN."""
    moments = np.asarray(column.to_numpy())
    unit = np.datetime_data(moments.dtype)[0]
    ticks = moments.astype("int64").astype(float)
    return np.where(np.isnat(moments), np.nan, ticks / _TICKS[unit])
