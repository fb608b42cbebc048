"""Message types from their .msg texts by rosbags, and their RIHS01 hashes (REP-2011).

Computing the hash lets interfaces without generated .json files (own ones, tf2_msgs) carry one.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # rosbags itself is imported where it is used: a tenth of a second
    from rosbags.typesys.store import Typestore

PRIMITIVES = frozenset(
    ("bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32")
    + ("int64", "uint64", "string", "wstring")
)

_CHAR = re.compile(r"^\s*char\b", re.MULTILINE)


def fields(type_name: str, text: str) -> list[tuple[str, Any]]:
    """Names and rosbags' descriptions of the fields of one .msg text; constants left out."""
    return parse(type_name, text)[type_name][1]


def parse(type_name: str, text: str) -> dict[str, Any]:
    """rosbags' description of a `ros2msg` text: the type and what is defined behind it."""
    from rosbags.typesys import get_types_from_msg

    # `char` is uint8 in .msg files since ROS 2; rosbags' hash counts it as a type of its own.
    return get_types_from_msg(_CHAR.sub("uint8", text.replace("\r\n", "\n")), type_name)


def starts_with(type_name: str, text: str, nested: str) -> bool:
    """Whether the first field of a type is of the type `nested`."""
    described = fields(type_name, text)
    return bool(described) and described[0][1][0].name == "NAME" and described[0][1][1] == nested


def rihs01(type_name: str, text_of: Callable[[str], str]) -> str:
    """`RIHS01_...` of a type. `text_of` gives the .msg text of a full type name."""
    described: dict[str, Any] = {}
    todo = [type_name]
    while todo:
        name = todo.pop()
        if name not in described:
            described |= parse(name, text_of(name))
            todo += [nested for _, kind in described[name][1] if (nested := _nested(kind))]
    return make_store(described).hash_rihs01(type_name)


def make_store(described: dict[str, Any]) -> Typestore:
    """A store of these types alone."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(described)
    return store


def _nested(kind: Any) -> str:
    """The message type that a field holds, alone or in a sequence; empty for numbers and strings."""
    node, detail = kind
    if node.name in ("ARRAY", "SEQUENCE"):
        return _nested(detail[0])
    return detail if node.name == "NAME" else ""
