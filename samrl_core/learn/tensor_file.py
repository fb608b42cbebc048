"""Tensors and a description in one file: safetensors, so that reading runs no code from it.

The file states a SHA-256 over both. Without it a damaged weight would be as good as any other number.
"""

from __future__ import annotations

import hashlib
import json
import stat
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from safetensors import SafetensorError

from samrl_core.errors import InputError
from samrl_core.whole_file import write_whole

MAX_BYTES = 256 * 2**20  # far above any network here with its optimiser: a larger file is something else
_DIGEST = "sha256"  # of the file's metadata, beside the description
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
    text = json.dumps(about, sort_keys=True)
    ready = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    metadata = {entry: text, _DIGEST: _digest(text, ready)}
    write_whole(path, safetensors.torch.save(ready, metadata))


def read_tensors(path: Path, entry: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Tensors on the CPU, and what the file says about them.

    Raises:
        InputError: no such file, too large, cut short, damaged, not written by `write_tensors`, or of another
            entry.
    """
    content = _content(path)
    try:
        tensors = safetensors.torch.load(content)
        length = int.from_bytes(content[:_LENGTH], "little")
        metadata = json.loads(content[_LENGTH : _LENGTH + length]).get("__metadata__", {})
        text, digest = metadata.get(entry), metadata.get(_DIGEST)
    except _UNREADABLE as error:
        raise InputError(
            f"{path} is no whole safetensors file ({error}); fetch it or make it again"
        ) from error
    if text is None:
        raise InputError(f"{path} is a safetensors file, but not one of samrl's ({entry}); name another one")
    if digest is not None and digest != _digest(text, tensors):  # older files have none
        raise InputError(f"{path} is damaged: its content is not what was written; fetch it or make it again")
    try:
        about = dict(json.loads(text))
    except _UNREADABLE as error:
        raise InputError(f"{path} has a damaged description ({error}); fetch it or make it again") from error
    return tensors, about


def _content(path: Path) -> bytes:
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise InputError(f"cannot read {path}: it is no file; check the path")
        if found.st_size > MAX_BYTES:
            raise InputError(
                f"{path} has {found.st_size} bytes, a file of tensors at most {MAX_BYTES}; check the path"
            )
        return path.read_bytes()
    except (OSError, ValueError) as error:  # a path with a null byte is a ValueError
        raise InputError(f"cannot read {path}: {error}; check the path") from error


def _digest(text: str, tensors: dict[str, torch.Tensor]) -> str:
    digest = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        value = tensors[name]
        digest.update(f"\n{name} {value.dtype} {tuple(value.shape)}\n".encode())
        digest.update(value.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
