"""What files of poses, readings and bodies share: arrays beside one JSON text, and how a role's are read."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.array_file import MAX_BYTES, unpacked, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole
from samrl_core.common.text_files import parse_json, parse_yaml, read_text

R = TypeVar("R", bound=Any)  # a dataclass with `tolerances`
ABOUT = "about"  # name of the JSON text among the arrays


def write_described(path: Path, about: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays and a JSON text about them; an existing file is replaced."""
    text = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    write_arrays(path, {**arrays, ABOUT: text})


def read_described(path: Path, version: int) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and the text about them.

    Raises:
        InputError: the file is damaged, or of another version.
        KeyError, TypeError, ValueError: it has no such text, or one of something else.
    """
    arrays = unpacked(read_whole(path, MAX_BYTES), path)
    about = parse_json(bytes(arrays[ABOUT]).decode(), str(path))
    if about["version"] != version:
        raise InputError(f"{path} has version {about['version']}, this samrl reads {version}; import again")
    return arrays, about


def read_by_role(
    fit: Sequence[Path],
    held_out: Sequence[Path],
    suffix: str,
    read: Callable[[Path], R],
    tolerances: tuple[type[StatedTolerances], Path | None],
) -> tuple[list[R], list[R]]:
    """Fitted and held-out recordings; tolerances of a YAML file replace their own.

    Args:
        fit: files to fit.
        held_out: files never fitted.
        suffix: of this kind of recording.
        read: reads one.
        tolerances: their class, and a file.

    Raises:
        InputError: files of another kind among them, or as `read` and `read_stated`.
    """
    if others := [p.name for p in (*fit, *held_out) if not p.name.endswith(suffix)]:
        raise InputError(f"{', '.join(others)}: recordings of another kind; diagnose each kind for itself")
    return restated([read(p) for p in fit], [read(p) for p in held_out], tolerances)


def restated(
    fit: Sequence[R], held_out: Sequence[R], tolerances: tuple[type[StatedTolerances], Path | None]
) -> tuple[list[R], list[R]]:
    """Recordings whose tolerances are those of a YAML file (their class, and the file; None keeps them).

    Raises:
        InputError: as `read_stated`.
    """
    kind, path = tolerances
    if path is None:
        return list(fit), list(held_out)
    stated = read_stated(kind, path)
    return [replace(r, tolerances=stated) for r in fit], [replace(r, tolerances=stated) for r in held_out]


def read_stated(kind: type[StatedTolerances], path: Path) -> StatedTolerances:
    """Tolerances from a YAML file.

    Raises:
        InputError: no mapping, an unknown name, or a value that is no number.
    """
    values = parse_yaml(read_text(path, "the tolerances"), str(path))
    if not isinstance(values, dict):
        raise InputError(f"{path} holds {type(values).__name__}, must be a mapping of names to numbers")
    try:
        return kind.from_mapping(values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def check_unseen(share: float, limit: float, unseen: str, known: str, what: str) -> None:
    """Refuse held-out data that were fitted too. Raises `InputError`."""
    if share > limit:
        raise InputError(
            f"{100 * share:.0f} % of the held-out {what} of {unseen} are also in {known}, limit"
            f" {100 * limit:.0f} %; hold out what was not fitted"
        )
