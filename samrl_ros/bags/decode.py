"""CDR bytes to objects with the message's fields as attributes, from the schema that the bag carries."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from samrl_core.errors import InputError

Decoder = Callable[[bytes], Any]

# What the decoder raises on a schema or on bytes that do not fit it.
_DECODE_ERRORS = (McapError, struct.error, ValueError, IndexError, KeyError, TypeError, NotImplementedError)


class Decoders:
    """Makes and keeps one decoder per schema text."""

    def __init__(self) -> None:
        self._made: dict[tuple[str, bytes], Decoder] = {}

    def get(self, topic: str, encoding: str, schema: Schema | None) -> Decoder:
        """Decoder of a channel. Raises `InputError` naming the channel if its schema is not usable."""
        if schema is None:
            raise InputError(f"topic {topic} has no schema; it can be copied but not decoded")
        if encoding != "cdr" or schema.encoding != "ros2msg":
            raise InputError(
                f"topic {topic} ({schema.name}) has encoding {encoding!r} with schema {schema.encoding!r};"
                " only cdr with ros2msg can be decoded"
            )
        key = (schema.name, schema.data)
        if key not in self._made:
            self._made[key] = _make(topic, schema)
        return self._made[key]


def _make(topic: str, schema: Schema) -> Decoder:
    try:
        # A factory keeps decoders by schema id, which differ between files: one factory per schema.
        decoder = DecoderFactory().decoder_for("cdr", schema)
    except _DECODE_ERRORS as error:
        raise InputError(f"topic {topic}: schema of {schema.name} is broken: {error}") from error
    if decoder is None:
        raise InputError(f"topic {topic}: schema of {schema.name} is not understood")
    return decoder


def decode(decoder: Decoder, topic: str, log_time_ns: int, data: bytes) -> Any:
    """Decode one message. Raises `InputError` naming topic and stamp."""
    try:
        return decoder(data)
    except _DECODE_ERRORS as error:
        raise InputError(
            f"topic {topic}, log time {log_time_ns} ns: cannot decode {len(data)} bytes: {error}"
        ) from error
