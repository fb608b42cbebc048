"""CDR bytes to objects with the message's fields as attributes, by the schema that the bag carries.

rosbags decodes; numbers in sequences and arrays become NumPy arrays. What is added is strictness: bytes that
end early, or more than a serialiser leaves over, mean that schema and message do not belong together.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from mcap.records import Schema

from samrl_core.common.errors import InputError
from samrl_ros.bags.type_hash import make_store, parse

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Decoder = Callable[[bytes], Any]

# Schemas may leave these out; every ROS 2 decoder knows them.
_BUILTIN = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec\n",
}


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
            self._made[key] = _message_decoder(topic, schema)
        return self._made[key]


def decode(decoder: Decoder, topic: str, log_time_ns: int, data: bytes) -> Any:
    """Decode one message. Raises `InputError` naming topic and stamp."""
    from rosbags.serde import SerdeError

    try:
        return decoder(data)
    except (SerdeError, struct.error, ValueError, IndexError) as error:
        raise InputError(
            f"topic {topic}, log time {log_time_ns} ns: {len(data)} bytes do not fit the schema: {error}"
        ) from error


def _message_decoder(topic: str, schema: Schema) -> Decoder:
    from rosbags.typesys import TypesysError

    where = f"topic {topic}: schema of {schema.name} is broken"
    try:
        described = parse(schema.name, schema.data.decode())
        for name, text in _BUILTIN.items():
            described = parse(name, text) | described
        store = make_store(described)
        definition = store.get_msgdef(schema.name)
    except KeyError as error:
        raise InputError(f"{where}: it does not define {error}") from error
    except RecursionError as error:
        raise InputError(f"{where}: a type contains itself") from error
    except (TypesysError, UnicodeDecodeError) as error:
        raise InputError(f"{where}: {' '.join(str(error).split())}") from error
    return partial(_decode, schema.name, definition, store)


def _decode(type_name: str, definition: Any, store: Typestore, data: bytes) -> Any:
    if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
        raise struct.error(f"the header {data[:4].hex()} is not plain CDR")
    read = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
    message, end = read(data[4:], 0, definition.cls, store)
    left = len(data) - 4 - end
    if left < 0:
        raise struct.error(f"{-left} bytes are missing")
    if left:
        from samrl_ros.bags.over_allocation import rightful_ends

        if len(data) - 4 not in rightful_ends(store, type_name, message, end):
            raise struct.error(f"{left} bytes are left over")
    return message
