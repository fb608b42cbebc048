"""State of a training on disk: tensors and a description, whole or not at all, never pickled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from samrl_core.common.errors import InputError
from samrl_core.common.tensor_file import read_tensors, write_tensors

_ENTRY = "samrl_checkpoint"  # of the file's metadata


def save_checkpoint(path: Path, kind: str, tensors: dict[str, torch.Tensor], about: dict[str, Any]) -> None:
    """Write tensors as they are, with a description as JSON."""
    write_tensors(path, _ENTRY, {"kind": kind, **about}, tensors)


def load_checkpoint(path: Path, kind: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Tensors and their description.

    Raises:
        InputError: it cannot be read, is cut short or damaged, or is no checkpoint of this kind.
    """
    try:
        tensors, about = read_tensors(path, _ENTRY)
    except InputError as error:
        raise InputError(f"cannot read the checkpoint: {error}; remove it to begin anew") from error
    if about.pop("kind", None) != kind:
        raise InputError(f"{path} is no checkpoint of a {kind}; give another folder")
    return tensors, about


def adam_tensors(adam: torch.optim.Adam, prefix: str) -> dict[str, torch.Tensor]:
    """An optimiser's state by name, for a checkpoint."""
    found: dict[str, torch.Tensor] = {}
    for index, entry in adam.state_dict()["state"].items():
        found |= {f"{prefix}{index}.{name}": value for name, value in entry.items()}
    return found


def load_adam(adam: torch.optim.Adam, tensors: dict[str, torch.Tensor], prefix: str) -> None:
    """Put back what `adam_tensors` gave.

    Raises:
        InputError: it is of other parameters; torch itself would only fail at the next step.
    """
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in with_prefix(tensors, prefix).items():
        index, _, entry = name.partition(".")
        if not index.isdecimal():
            raise InputError(f"{prefix}{name} is no state of an optimiser; begin anew in another folder")
        state.setdefault(int(index), {})[entry] = value
    shapes = [tuple(p.shape) for group in adam.param_groups for p in group["params"]]
    for index, entries in state.items():
        found = {name: tuple(value.shape) for name, value in entries.items()}
        shape = shapes[index] if index < len(shapes) else None
        if found != {"step": (), "exp_avg": shape, "exp_avg_sq": shape}:
            raise InputError(
                f"the optimiser's state {prefix}{index} is {found}, its parameter {shape}; begin anew in "
                f"another folder"
            )
    adam.load_state_dict({**adam.state_dict(), "state": state})


def with_prefix(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    """Tensors whose names begin so, by their names without the prefix."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
