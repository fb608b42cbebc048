"""Tensors and a description in one file: safetensors, so that reading runs no code from it.

The file states a SHA-256 over both. Without it a damaged weight would be as good as any other number.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from safetensors import SafetensorError

from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole, write_whole

MAX_BYTES = 256 * 2**20  # far above any network here with its optimiser: a larger file is something else
_DIGEST = "sha256"  # in the description; metadata of more than one entry come in a random order
_LENGTH = 8  # bytes at the beginning that tell the header's length
# What reading foreign bytes comes to besides the library's own error; RuntimeError: nested too deeply.
_UNREADABLE = (
    SafetensorError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    RuntimeError,
    OverflowError,
    MemoryError,
)


def write_tensors(path: Path, entry: str, about: dict[str, Any], tensors: dict[str, torch.Tensor]) -> None:
    """Write them as they are; `path` holds the old file or the whole new one at any instant.

    Args:
        path: of the file.
        entry: name of the description in the file's metadata: what kind of file it is.
        about: what JSON can hold.
        tensors: by name, on any device.
    """
    ready = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    plain = json.loads(json.dumps(about))  # as it will be read
    text = json.dumps({**plain, _DIGEST: _digest(plain, ready)}, sort_keys=True)
    write_whole(path, safetensors.torch.save(ready, {entry: text}))


def read_tensors(path: Path, entry: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Tensors on the CPU by name, in the order of their names, and what the file says about them.

    Raises:
        InputError: no such file, too large, cut short, damaged, not written by `write_tensors`, or of another
            entry.
    """
    content = read_whole(path, MAX_BYTES)
    try:
        found = safetensors.torch.load(content)  # in another order at every call
        tensors = {name: found[name] for name in sorted(found)}
        length = int.from_bytes(content[:_LENGTH], "little")
        text = json.loads(content[_LENGTH : _LENGTH + length]).get("__metadata__", {}).get(entry)
    except _UNREADABLE as error:
        raise InputError(
            f"{path} is no whole safetensors file ({error}); fetch it or make it again"
        ) from error
    if text is None:
        raise InputError(f"{path} is a safetensors file, but not one of samrl's ({entry}); name another one")
    try:
        about = dict(json.loads(text))
        digest = about.pop(_DIGEST, None)
        same = digest in (None, _digest(about, tensors))  # older files have none
    except _UNREADABLE as error:
        raise InputError(f"{path} has a damaged description ({error}); fetch it or make it again") from error
    if not same:
        raise InputError(f"{path} is damaged: its content is not what was written; fetch it or make it again")
    return tensors, about


def _digest(about: dict[str, Any], tensors: dict[str, torch.Tensor]) -> str:
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name in sorted(tensors):
        value = tensors[name]
        digest.update(f"\n{name} {value.dtype} {tuple(value.shape)}\n".encode())
        digest.update(value.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
