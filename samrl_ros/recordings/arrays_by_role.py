"""Recordings of poses, readings and bodies by role: read, with tolerances of the user's own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_yaml, read_text

R = TypeVar("R", bound=Any)  # a dataclass with `tolerances`


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
    groups = [[read(p) for p in paths] for paths in (fit, held_out)]
    kind, path = tolerances
    if path is not None:
        stated = read_stated(kind, path)
        groups = [[replace(r, tolerances=stated) for r in group] for group in groups]
    return groups[0], groups[1]


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
