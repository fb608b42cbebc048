"""Damaged inputs as a hypothesis strategy: shrinks to the least damage that still breaks a reader."""

from __future__ import annotations

import re
from collections.abc import Sequence

from hypothesis import strategies as st

_TOKEN = re.compile(rb"[A-Za-z_][A-Za-z_0-9]*|-?\d+(?:\.\d+)?")
ODD: tuple[bytes, ...] = (
    b"nan",
    b".nan",
    b"NaN",
    b"inf",
    b"-1",
    b"0",
    b"1e300",
    b"1" * 5000,
    b"-0.0",
    b"null",
    b"~",
    b"true",
    b"[]",
    b"{}",
    b"[[1], 2]",
    b"''",
    b"\0",
    b"\xff\xfe",
    b"\xe9",
    b"../../x",
    b"/dev/zero",
    b"x" * 5000,
    b"&a [*a]",
    b"!!bool x",
    b"!!timestamp x",
    b"!!int ''",
    b"!!binary x",
    b"2026-99-99",
    b"? [a]",
    b"<<: 1",
    b"<a>" * 300,
    b"[" * 3000,
    b'{"a":' * 1000,
    b"(" * 200,
    b"-" * 500,
    b"<!DOCTYPE a [<!ENTITY b 'c'>]>",
    b"&b;",
    b"10**9",
    b"\xff" * 8,
    b"\0" * 8,
    b"\xff\xff\xff\x7f",
    b"\x80\x00\x00\x00",
)

_KINDS = ("flip", "token", "insert", "cut", "double", "end", "swap")


def damaged(sound: Sequence[bytes]) -> st.SearchStrategy[bytes]:
    """One of some sound inputs after one to five damages."""
    place = st.floats(0, 1, exclude_max=True)
    one = st.tuples(st.sampled_from(_KINDS), place, place, st.sampled_from(ODD), st.integers(0, 255))
    return st.builds(_apply, st.sampled_from(list(sound)), st.lists(one, min_size=1, max_size=5))


def _apply(content: bytes, damages: list[tuple[str, float, float, bytes, int]]) -> bytes:
    for kind, first, second, odd, byte in damages:
        size = len(content)
        begin = int(first * size)
        end = min(size, begin + 1 + int(second * min(size, 64)))
        if kind == "flip":
            content = content[:begin] + bytes([byte]) + content[begin + 1 :]
        elif kind == "token":
            tokens = list(_TOKEN.finditer(content[:20_000]))
            if tokens:
                token = tokens[int(first * len(tokens))]
                content = content[: token.start()] + odd + content[token.end() :]
        elif kind == "insert":
            content = content[:begin] + odd + content[begin:]
        elif kind == "cut":
            content = content[:begin] + content[end:]
        elif kind == "double":
            content = content[:end] + content[begin:]
        elif kind == "end":
            content = content[:begin]
        else:
            other = int(second * size)
            content = content[:begin] + content[other : other + 8] + content[begin + 8 :]
    return content
