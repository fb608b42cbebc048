"""Disk cache of arrays that take seconds to compute, under a hash of all their inputs."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.array_file import MAX_BYTES, unpacked, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole

Arrays = dict[str, np.ndarray]


def load_or_compute(
    kind: str, sources: tuple[str, ...], packages: tuple[str, ...], of: Any, work: Callable[[], Arrays]
) -> Arrays:
    """Result of `work`, read from the cache where it is there.

    Args:
        kind: folder below the cache's.
        sources: packages of samrl_core whose code decides the result.
        packages: distributions whose version decides it.
        of: everything else that decides it: numbers, texts, arrays, paths of files, tuples, dataclasses.
        work: is called where nothing is cached, or the cached file cannot be read.
    """
    digest = hashlib.sha256(f"{_code(sources)}{[_version(p) for p in packages]}".encode())
    _feed(digest, of)
    path = folder() / kind / f"{digest.hexdigest()[:32]}.npz"
    try:
        return unpacked(read_whole(path, MAX_BYTES), path)
    except InputError:  # none yet, or damaged: it only saves time
        made = work()
    write_arrays(path, made)
    return made


def folder() -> Path:
    """$XDG_CACHE_HOME/samrl/forge, by default ~/.cache/samrl/forge; may be deleted at any time."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "samrl" / "forge"


@cache
def _code(sources: tuple[str, ...]) -> str:
    core = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for name in sources:
        for path in sorted((core / name).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:  # installed under another name, by conda for one
        return "unknown"


def _feed(digest: Any, value: Any) -> None:
    digest.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Path):
        digest.update(value.read_bytes())
    elif isinstance(value, tuple):
        for each in value:
            _feed(digest, each)
    elif is_dataclass(value):
        for field in fields(value):
            digest.update(field.name.encode())
            _feed(digest, getattr(value, field.name))
    else:
        digest.update(repr(value).encode() + b"\0")
