"""CDR bytes to objects with the message's fields as attributes, by the schema that the bag carries.

Plain CDR (XCDR version 1, OMG DDS-XTypes 7.4.3), as ROS 2 writes it. Numbers in sequences and arrays become
`array.array`, uint8, byte and char ones `bytes`, strings `str`, everything else lists. Stricter than other
decoders: bytes that end early, or many left over, mean that schema and message do not belong together.
"""

from __future__ import annotations

import re
import struct
import sys
from array import array
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from mcap.records import Schema

from samrl_core.common.errors import InputError
from samrl_ros.bags.type_hash import BOUNDED_SEQUENCE, SEQUENCE, SequenceKind, fields, split_type_id

Decoder = Callable[[bytes], Any]
Read = Callable[["_Cursor"], Any]

_PART = re.compile(r"(?:^|\r?\n)={80}\r?\nMSG: ([^\r\n]+)\r?\n")
# Schemas may leave these out; every ROS 2 decoder knows them.
_BUILTIN = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec\n",
}
# struct and array codes by type_description_interfaces/msg/FieldType id
_CODE = {2: "b", 3: "B", 4: "h", 5: "H", 6: "i", 7: "I", 8: "q", 9: "Q", 10: "f", 11: "d", 15: "?", 16: "B"}
_BYTES = (3, 16)
_STRING, _BOUNDED_STRING, _NESTED = 17, 21, 1
_PADDING = 8  # [B] rclpy's serialize_message leaves up to that much behind a message
_SWAP = {"<": sys.byteorder == "big", ">": sys.byteorder == "little"}


class _Cursor:
    """A place in the body of a message; alignment counts from the body's start."""

    __slots__ = ("body", "order", "position")

    def __init__(self, body: memoryview, order: str) -> None:
        self.body, self.order, self.position = body, order, 0

    def number(self, code: str, size: int) -> Any:
        start = -(-self.position // size) * size
        self.position = start + size
        return struct.unpack_from(self.order + code, self.body, start)[0]

    def take(self, count: int, size: int) -> memoryview:
        start = -(-self.position // size) * size if count else self.position
        end = start + count * size
        if end > len(self.body):
            raise struct.error(f"{end - len(self.body)} bytes are missing")
        self.position = end
        return self.body[start:end]


class Decoders:
    """Makes and keeps one decoder per schema text."""

    def __init__(self) -> None:
        self._made: dict[tuple[str, bytes], Decoder] = {}

    def get(self, topic: str, encoding: str, schema: Schema | None) -> Decoder:
        """Decoder of a channel. Raises `InputError` naming the topic if its schema is not usable."""
        if schema is None:
            raise InputError(f"topic {topic} has no schema; it can be copied but not decoded")
        if encoding != "cdr" or schema.encoding != "ros2msg":
            raise InputError(
                f"topic {topic} ({schema.name}) has encoding {encoding!r} with schema {schema.encoding!r};"
                " only cdr with ros2msg can be decoded"
            )
        key = (schema.name, schema.data)
        if key not in self._made:
            try:
                self._made[key] = _message_decoder(schema.name, schema.data.decode())
            except (_SchemaError, UnicodeDecodeError) as error:
                raise InputError(f"topic {topic}: schema of {schema.name} is broken: {error}") from error
        return self._made[key]


def decode(decoder: Decoder, topic: str, log_time_ns: int, data: bytes) -> Any:
    """Decode one message. Raises `InputError` naming topic and stamp."""
    try:
        return decoder(data)
    except (struct.error, UnicodeDecodeError) as error:
        raise InputError(
            f"topic {topic}, log time {log_time_ns} ns: {len(data)} bytes do not fit the schema: {error}"
        ) from error


class _SchemaError(Exception):
    """Why a schema cannot be used."""


def _message_decoder(type_name: str, text: str) -> Decoder:
    parts = _PART.split(text)
    texts = dict(_BUILTIN)
    for name, part in zip(parts[1::2], parts[2::2], strict=True):
        package, *_, short = name.strip().split("/")
        texts[f"{package}/msg/{short}"] = part
    texts[type_name] = parts[0]
    read = _structure(type_name, texts, {}, ())
    return partial(_decode, read)


def _decode(read: Read, data: bytes) -> Any:
    if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
        raise struct.error(f"the header {data[:4].hex()} is not plain CDR")
    cursor = _Cursor(memoryview(data)[4:], "<" if data[1] else ">")
    message = read(cursor)
    left = len(cursor.body) - cursor.position
    if left > _PADDING:
        raise struct.error(f"{left} bytes are left over")
    return message


def _structure(type_name: str, texts: dict[str, str], made: dict[str, Read], within: tuple[str, ...]) -> Read:
    if type_name in made:
        return made[type_name]
    if type_name not in texts:
        raise _SchemaError(f"it does not define {type_name}")
    if type_name in within:
        raise _SchemaError(f"{type_name} contains itself")
    text = texts[type_name]
    described = fields(type_name, text)
    members = []
    for field in described:
        type_id, kind = split_type_id(field["type"]["type_id"])
        element = _element(type_id, field["type"]["nested_type_name"], texts, made, (*within, type_name))
        members.append((field["name"], _member(type_id, kind, field["type"]["capacity"], element)))
    read = partial(_read_structure, tuple(members))
    made[type_name] = read
    return read


def _element(
    type_id: int, nested: str, texts: dict[str, str], made: dict[str, Read], within: tuple[str, ...]
) -> Read:
    if type_id == _NESTED:
        return _structure(nested, texts, made, within)
    if type_id in (_STRING, _BOUNDED_STRING):
        return _read_string
    if type_id not in _CODE:
        raise _SchemaError("wide strings are not supported")
    code = _CODE[type_id]
    return partial(_read_number, code, struct.calcsize("=" + code))


def _member(type_id: int, kind: SequenceKind, capacity: int, element: Read) -> Read:
    if kind == 0:
        return element
    length = None if kind in (SEQUENCE, BOUNDED_SEQUENCE) else capacity
    if type_id in _BYTES:
        return partial(_read_bytes, length)
    if type_id in _CODE and _CODE[type_id] != "?":
        code = _CODE[type_id]
        return partial(_read_numbers, length, code, struct.calcsize("=" + code))
    return partial(_read_list, length, element)


def _read_structure(members: tuple[tuple[str, Read], ...], cursor: _Cursor) -> SimpleNamespace:
    message = SimpleNamespace()
    values = message.__dict__
    for name, read in members:
        values[name] = read(cursor)
    return message


def _read_number(code: str, size: int, cursor: _Cursor) -> Any:
    return cursor.number(code, size)


def _read_string(cursor: _Cursor) -> str:
    length = cursor.number("I", 4)
    text = bytes(cursor.take(length, 1))
    return text[:-1].decode() if text.endswith(b"\0") else text.decode()


def _length(length: int | None, cursor: _Cursor) -> int:
    return cursor.number("I", 4) if length is None else length


def _read_bytes(length: int | None, cursor: _Cursor) -> bytes:
    return bytes(cursor.take(_length(length, cursor), 1))


def _read_numbers(length: int | None, code: str, size: int, cursor: _Cursor) -> array:
    numbers = array(code)
    numbers.frombytes(cursor.take(_length(length, cursor), size))
    if _SWAP[cursor.order]:
        numbers.byteswap()
    return numbers


def _read_list(length: int | None, element: Read, cursor: _Cursor) -> list[Any]:
    count = _length(length, cursor)
    if count > len(cursor.body):  # every element takes a byte at least
        raise struct.error(f"a list of {count} elements cannot lie in {len(cursor.body)} bytes")
    return [element(cursor) for _ in range(count)]
