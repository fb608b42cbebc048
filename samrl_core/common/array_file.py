"""Arrays by name in one file each, written whole; a file that is damaged or of something else is refused."""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole, write_whole

ANEW = "remove it to make it anew"  # of a file that samrl made
MAX_BYTES = 2**32  # of a file of arrays
_MEMBER = ".npy"  # NumPy's npz is a zip of these
# What zipfile, zlib and NumPy raise on bytes that are none of theirs.
UNREADABLE = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    TypeError,
    IndexError,
    RuntimeError,
    MemoryError,
    OverflowError,
    struct.error,
    zlib.error,
    zipfile.BadZipFile,
    tokenize.TokenError,  # of a header that NumPy parses as Python
)


def packed(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Content of a file of arrays (npz)."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # ty: ignore[invalid-argument-type]
    return buffer.getvalue()


def unpacked(content: bytes, path: Path, remedy: str = ANEW) -> dict[str, np.ndarray]:
    """The arrays of a file's content; objects are not unpickled.

    Args:
        content: of the file.
        path: of the file, for the error.
        remedy: what to do about a bad one; nobody is told to remove a file that samrl did not make.

    Raises:
        InputError: it is cut short, damaged, or no file of arrays.
    """
    found = {}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            for name in file.namelist():
                if not name.endswith(_MEMBER):
                    raise ValueError(f"{name} in it is no array")
                # Read to its end first: only then is the checksum compared, before a shape is believed.
                member = io.BytesIO(file.read(name))
                found[name.removesuffix(_MEMBER)] = np.lib.format.read_array(member, allow_pickle=False)
    except UNREADABLE as error:
        raise InputError(f"{path} cannot be read as arrays ({error}); {remedy}") from error
    return found


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write a file of arrays; `path` holds the old file or the whole new one at any instant."""
    write_whole(path, packed(arrays))


def read_arrays(path: Path, names: Collection[str], remedy: str = ANEW) -> dict[str, np.ndarray]:
    """Arrays of a file that `write_arrays` wrote.

    Args:
        path: of the file.
        names: of the arrays that it must have, and no others.
        remedy: as of `unpacked`.

    Raises:
        InputError: it cannot be read, holds other arrays, or a number that is not finite.
    """
    found = unpacked(read_whole(path, MAX_BYTES), path, remedy)
    if set(found) != set(names):
        raise InputError(
            f"{path} holds the arrays {', '.join(sorted(found)) or 'none'}, must hold "
            f"{', '.join(sorted(names))}; {remedy}"
        )
    for name, array in found.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise InputError(f"{path}: {name} is not finite; {remedy}")
    return found
