"""RIHS01 type hashes (REP-2011, rosidl_generator_type_description) computed from .msg texts.

The hash is the SHA-256 of a JSON text that lists the fields of a type and of all types it refers to.
Computing it here lets interfaces without generated .json files (own ones, tf2_msgs) carry a hash.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from typing import Any

# type_description_interfaces/msg/FieldType. `char` is uint8 in .msg files since ROS 2.
_TYPE_ID = {
    "int8": 2, "uint8": 3, "char": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8,
    "uint64": 9, "float32": 10, "float64": 11, "bool": 15, "byte": 16, "string": 17, "wstring": 18,
}  # fmt: skip
_NESTED, _BOUNDED_STRING = 1, 4  # the second is added to a string's id
SequenceKind = int
ARRAY, BOUNDED_SEQUENCE, SEQUENCE = 48, 96, 144  # added to the element's id; 0 for a single value

PRIMITIVES = frozenset(_TYPE_ID)

_FIELD = re.compile(
    r"^\s*(?P<base>[A-Za-z0-9_/]+)(?:<=(?P<chars>\d+))?(?P<array>\[(?P<upper><=)?(?P<count>\d*)\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<constant>=)?"
)


def full_name(base: str, package: str) -> str:
    """`pkg/msg/Name` of a field's type as written in a file of `package`."""
    parts = base.split("/")
    if len(parts) == 1:
        return f"{package}/msg/{base}"
    return f"{parts[0]}/msg/{parts[-1]}"


def fields(type_name: str, text: str) -> list[dict[str, Any]]:
    """Fields of one .msg text, described as type_description_interfaces does; constants left out."""
    package = type_name.split("/")[0]
    described = []
    for line in text.splitlines():
        match = _FIELD.match(line)
        if match is None or match["constant"]:
            continue
        base = match["base"]
        nested = "" if base in PRIMITIVES else full_name(base, package)
        type_id = _NESTED if nested else _TYPE_ID[base]
        if match["chars"]:
            type_id += _BOUNDED_STRING
        if match["array"]:
            type_id += BOUNDED_SEQUENCE if match["upper"] else ARRAY if match["count"] else SEQUENCE
        described.append(
            {
                "name": match["name"],
                "type": {
                    "type_id": type_id,
                    "capacity": int(match["count"] or 0),
                    "string_capacity": int(match["chars"] or 0),
                    "nested_type_name": nested,
                },
            }
        )
    if not described:  # rosidl gives an empty structure one member
        member = {"type_id": 3, "capacity": 0, "string_capacity": 0, "nested_type_name": ""}
        described.append({"name": "structure_needs_at_least_one_member", "type": member})
    return described


def split_type_id(type_id: int) -> tuple[int, SequenceKind]:
    """A field's type id as its element's id and the kind of sequence, 0 for a single value."""
    kind = (type_id // ARRAY) * ARRAY
    return type_id - kind, kind


def rihs01(type_name: str, text_of: Callable[[str], str]) -> str:
    """`RIHS01_...` of a type. `text_of` gives the .msg text of a full type name."""
    described: dict[str, list[dict[str, Any]]] = {}
    todo = [type_name]
    while todo:
        name = todo.pop()
        if name not in described:
            described[name] = fields(name, text_of(name))
            nested = (field["type"]["nested_type_name"] for field in described[name])
            todo.extend(other for other in nested if other)
    root = {"type_name": type_name, "fields": described.pop(type_name)}
    referred = [{"type_name": name, "fields": described[name]} for name in sorted(described)]
    document = {"type_description": root, "referenced_type_descriptions": referred}
    return "RIHS01_" + hashlib.sha256(json.dumps(document).encode()).hexdigest()
