"""State of a training on disk: tensors and a description, whole or not at all, never pickled."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from safetensors import SafetensorError

from samrl_core.errors import InputError
from samrl_core.whole_file import write_whole

_ENTRY = "samrl_checkpoint"  # of the file's metadata


def save_checkpoint(path: Path, kind: str, tensors: dict[str, torch.Tensor], about: dict[str, Any]) -> None:
    """Write tensors as they are, with what JSON can say about them."""
    text = json.dumps({"kind": kind, **about}, sort_keys=True)
    ready = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    write_whole(path, safetensors.torch.save(ready, {_ENTRY: text}))


def load_checkpoint(path: Path, kind: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Tensors and what was said about them.

    Raises:
        InputError: it cannot be read, is cut short, or is no checkpoint of this kind.
    """
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            text = (file.metadata() or {}).get(_ENTRY)
            tensors = {name: file.get_tensor(name) for name in file.keys()}
        about = json.loads(text) if text is not None else {}
    except (OSError, SafetensorError, ValueError) as error:
        raise InputError(f"cannot read the checkpoint {path} ({error}); remove it to begin anew") from error
    if about.pop("kind", None) != kind:
        raise InputError(f"{path} is no checkpoint of a {kind}; give another folder")
    return tensors, about
