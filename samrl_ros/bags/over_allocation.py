"""How many bytes a serialiser may rightly leave behind a CDR message.

ROS 2's serialisers for Fast DDS allocate before they write and state the allocated size: the function that
`rosidl_typesupport_fastrtps_c` (`msg__type_support_c.cpp.em`, `get_serialized_size`) generates aligns for the
items of a sequence also when it has none, and counts a wide string's end. A trajectory with three empty lists
of numbers so ends with 12 bytes that mean nothing. Middleware further fills up to a multiple of four.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rosbags.typesys.store import Typestore

_LENGTH = 4  # [B] of the count in front of a string or a sequence; what a payload is filled up to
_SIZES = {"bool": 1, "byte": 1, "octet": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2}
_SIZES |= {"int32": 4, "uint32": 4, "float32": 4, "int64": 8, "uint64": 8, "float64": 8}


def rightful_ends(store: Typestore, type_name: str, message: Any, end: int) -> set[int]:
    """Sizes [B] that the bytes of a message may have, behind the encapsulation's header.

    Args:
        store: knows the type.
        type_name: of the message.
        message: as decoded.
        end: where its last field ended [B].
    """
    allocated = _after(store, type_name, message, 0)
    return {end, _filled(end), allocated, _filled(allocated)}


def _filled(size: int) -> int:
    return size + -size % _LENGTH


def _after(store: Typestore, type_name: str, message: Any, at: int) -> int:
    """Where the allocation for a message ends that begins `at`."""
    for name, (node, detail) in store.fielddefs[type_name][1]:
        value = getattr(message, name)
        if node.name in ("ARRAY", "SEQUENCE"):
            at = _after_items(store, detail[0], value, at if node.name == "ARRAY" else _counted(at))
        else:
            at = _after_one(store, (node, detail), value, at)
    return at


def _after_items(store: Typestore, kind: Any, values: Iterable[Any], at: int) -> int:
    node, detail = kind
    if node.name == "BASE" and detail[0] in _SIZES:
        size = _SIZES[detail[0]]
        return at + -at % size + size * len(values)  # ty: ignore[invalid-argument-type]
    for value in values:
        at = _after_one(store, kind, value, at)
    return at


def _after_one(store: Typestore, kind: Any, value: Any, at: int) -> int:
    node, detail = kind
    if node.name == "NAME":
        return _after(store, detail, value, at)
    if detail[0] == "string":
        return _counted(at) + len(value.encode()) + 1
    if detail[0] == "wstring":
        return _counted(at) + 4 * (len(value) + 1)
    size = _SIZES[detail[0]]
    return at + -at % size + size


def _counted(at: int) -> int:
    return _filled(at) + _LENGTH
