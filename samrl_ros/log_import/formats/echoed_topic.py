"""Text that `ros2 topic echo TOPIC > FILE` wrote, or `rostopic echo`: a topic's messages in YAML.

It is read as a bag of one topic without a name. What lies around the messages is no part of them: the notices
that messages were lost, a prompt above the first, and a last one that was cut when the command was stopped.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Any

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.common.text_files import MAX_TEXT_BYTES, parse_yaml, read_text
from samrl_ros.log_import.formats.control_msgs import RELEASES
from samrl_ros.log_import.formats.message_fields import split_time

SUFFIXES = (".txt", ".log", ".yaml", ".yml", ".csv", ".out", ".dat", ".echo", "")
_END = "---"  # line after each message
_HEAD = 1 << 14  # bytes in which the first message must end
_LOST = re.compile(r"A message was lost!!!\s*total count change:\s*(\d+)\s*total count:\s*\d+\s*?---\r?\n")
_STAMP = re.compile(
    r"^(?:header|transforms):[ \t]*\n(?:[ \-]{1,9}(?:header:|seq:.*)?[ \t]*\n){0,4}"
    r" +stamp:[ \t]*\n +secs?: *\d+[ \t]*\n +n(?:ano)?secs?: *\d+[ \t]*$",
    re.MULTILINE,
)
_FIRST = re.compile(r"^(?:header|transforms):", re.MULTILINE)
_CUT = "..."  # in place of what `ros2 topic echo` leaves out of a long array
# libyaml composes nested values by recursion in C, which a deep text overflows; Python's reader refuses it.
_LONGEST_LINE = 2000  # letters: blocks nest by their indentation, and a line cannot be deeper than it is long
_MOST_BRACKETS = 1000  # of a message
_DEEPEST = 40  # fields in each other; Python ends at a thousand


class EchoedMessage:
    """A message with its fields in order, as decoded ones of a bag have them."""

    def __init__(self, fields: dict[str, Any]) -> None:
        self.__dataclass_fields__ = tuple(map(str, fields))
        self.__dict__.update({str(name): _as_field(value) for name, value in fields.items()})


@dataclass(frozen=True, eq=False)
class Echo:
    """What a file holds."""

    kind: str  # package/msg/Name; empty where ROS has no message with these fields
    messages: tuple[tuple[int, EchoedMessage], ...]  # stamp [ns] and content
    notes: tuple[str, ...]  # what is left out


def is_echo(path: Path) -> bool:
    """Whether a text begins with a stamped message, or a list of stamped transforms, and `---` ends it."""
    if path.suffix.lower() not in SUFFIXES or not is_file(path):
        return False
    try:
        state = path.stat()
        return _is_echo(path, (state.st_mtime_ns, state.st_size))
    except OSError:
        return False


@lru_cache(maxsize=256)  # asked again at every step of a draft
def _is_echo(path: Path, state: tuple[int, int]) -> bool:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    text = head.decode("utf-8", "replace").replace("\r\n", "\n")
    begin = _STAMP.search(text)
    return begin is not None and f"\n{_END}\n" in f"{text[begin.start() :].rstrip()}\n"


def read_echo(path: Path, where: str) -> Echo:
    """Messages of a file, in order.

    Raises:
        InputError: a file that cannot be read, is too large or no YAML; messages of several kinds, or without
            stamps.
    """
    state = path.stat()
    return _read_echo(path, where, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=4)
def _read_echo(path: Path, where: str, state: tuple[int, int]) -> Echo:
    if state[1] > MAX_TEXT_BYTES:
        raise InputError(
            f"{where}: {path.name} has {state[1]} bytes, an echo at most {MAX_TEXT_BYTES}; record a bag"
            f" (`ros2 bag record TOPIC`), or cut the file at a line of {_END}"
        )
    text = read_text(path, where).replace("\r\n", "\n")
    lost = sum(map(int, _LOST.findall(text)))
    found = _FIRST.search(text := _LOST.sub("", text))
    *whole, last = re.split(rf"^{_END}[ \t]*\n?", text[found.start() if found else 0 :], flags=re.MULTILINE)
    fields = [
        _parse_message(each, f"{path}, message {number}")
        for number, each in enumerate(whole, 1)
        if each.strip()
    ]
    if not fields:
        raise InputError(f"{where}: {path.name} holds no whole message, which ends with a line of {_END}")
    _check_alike(fields, path)
    stamps = [_stamp_ns(each) for each in fields]
    if len(fields) > 1 and not any(stamps):
        raise InputError(
            f"{where}: {path.name}: no message is stamped, and an echo has no other clock; record a bag"
            " instead (`ros2 bag record TOPIC`), which keeps the time of arrival"
        )
    notes = []
    if lost:
        notes.append(f"{path.name}: `ros2 topic echo` lost {lost} messages, as it says")
    if last.strip():
        notes.append(f"{path.name}: the last message is not whole (no {_END} after it) and is left out")
    if cut := sorted({name for each in fields[:1] for name in _cut_arrays(each)}):
        notes.append(
            f"{path.name}: {', '.join(cut)} left out: `ros2 topic echo` shortened it; --full-length keeps it"
        )
    messages = tuple((stamp, EchoedMessage(each)) for stamp, each in zip(stamps, fields, strict=True))
    return Echo(_kind_of(fields[0]), messages, tuple(notes))


def _number_loader(base: Any) -> Any:
    """Loader of numbers and truth values alone: ROS 1 writes 1e-05 and nan, and a frame may be called on."""
    loader = type("_NumberLoader", (base,), {"yaml_implicit_resolvers": {}})
    for tag, pattern, first in (
        ("bool", r"true|false|True|False", "tfTF"),
        ("int", r"[-+]?(?:0|[1-9]\d{0,18})", "-+0123456789"),
        ("float", r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?\.?(?:nan|inf)", "-+0123456789.ni"),
    ):
        loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(rf"(?:{pattern})\Z"), list(first))
    return loader


_SAFE_LOADER = _number_loader(yaml.SafeLoader)
_FAST_LOADER = _number_loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def _parse_message(text: str, where: str) -> dict[str, Any]:
    loader = _FAST_LOADER
    brackets = [1 if each in "[{" else -1 for each in re.findall(r"[\[\]{}]", text)]
    if len(brackets) > _MOST_BRACKETS or max(map(len, text.split("\n"))) > _LONGEST_LINE:
        if max(accumulate(brackets), default=0) > _MOST_BRACKETS:  # Python's reader takes a second to say so
            raise InputError(
                f"{where} is nested too deeply; at most {_MOST_BRACKETS} brackets are open at once"
            )
        loader = _SAFE_LOADER
    fields = parse_yaml(text, where, loader)
    if not isinstance(fields, dict):
        raise InputError(f"{where} is no message: {text.strip()[:60]!r}; take out what was not echoed")
    return fields


def _check_alike(messages: Sequence[dict[str, Any]], path: Path) -> None:
    """A topic's messages have one kind: each field is a number, a text, a list or a message, always."""
    known: dict[str, str] = {}
    for number, each in enumerate(messages, 1):
        if set(each) != set(messages[0]):
            raise InputError(
                f"{path}, message {number} has fields {list(each)[:9]}, the first has"
                f" {list(messages[0])[:9]}: an echo holds one topic; write each to a file of its own"
            )
        for name, kind in _kinds_of(each, f"{path}, message {number}"):
            if known.setdefault(name, kind) != kind:
                raise InputError(
                    f"{path}, message {number}: {name} is {kind}, and {known[name]} before: an echo holds one"
                    " topic, each message whole; take out what was not echoed"
                )


def _kinds_of(value: Any, where: str, path: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    """Of all that a message holds: its path, and what it is."""
    if depth > _DEEPEST:
        raise InputError(f"{where} is nested too deeply; no message of ROS holds {_DEEPEST} in each other")
    if isinstance(value, dict):
        yield path, f"a message with {sorted(map(str, value))}"
        is_time = split_time(value) is not None
        for name, each in value.items():
            inner = f"{path}.{name}".lstrip(".")
            if is_time and not isinstance(each, int):
                raise InputError(f"{where}: {inner} is {each!r}, which is no whole number of a time")
            yield from _kinds_of(each, where, inner, depth + 1)
    elif isinstance(value, list):
        yield path, "a list"
        for each in value[:-1] if _CUT in value[-1:] else value:
            yield from _kinds_of(each, where, f"{path}[]", depth + 1)
    else:
        yield path, "a text" if isinstance(value, str) else "a number"


def _stamp_ns(message: dict[str, Any]) -> int:
    """Of its header, or of its first transform's; 0 of a message without one."""
    transforms = message.get("transforms")
    first = transforms[0] if isinstance(transforms, list) and transforms else message
    header = first.get("header") if isinstance(first, dict) else None
    stamp = header.get("stamp") if isinstance(header, dict) else None
    time = split_time(stamp) if isinstance(stamp, dict) else None
    return 0 if time is None else 1_000_000_000 * time[0] + time[1]


def _as_field(value: Any) -> Any:
    if isinstance(value, dict):
        return EchoedMessage(value)
    if isinstance(value, list):
        return [] if _CUT in value[-1:] else [_as_field(each) for each in value]
    return value


def _cut_arrays(value: Any, path: str = "") -> list[str]:
    if isinstance(value, dict):
        return [
            name for key, each in value.items() for name in _cut_arrays(each, f"{path}.{key}".lstrip("."))
        ]
    return [path] if isinstance(value, list) and _CUT in value[-1:] else []


@cache
def _known_messages() -> tuple[tuple[str, dict[str, str]], ...]:
    """Messages of ROS 2 and ros2_control: their fields, with the type of those that are messages."""
    from rosbags.interfaces import Nodetype
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    definitions = list(get_typestore(Stores.ROS2_JAZZY).fielddefs.items())
    for release in RELEASES:
        definitions += [
            each for name, text in release.items() for each in get_types_from_msg(text, name).items()
        ]
    return tuple(
        (name, {field: str(about[1]) if about[0] is Nodetype.NAME else "" for field, about in fields})
        for name, (_, fields) in definitions
    )


def _kind_of(message: dict[str, Any]) -> str:
    """The message of ROS that has these fields, down to the last; empty where there is none, or several."""
    known = dict(_known_messages())
    fit = {name for name, fields in _known_messages() if _fits(message, fields, known)}
    return fit.pop() if len(fit) == 1 else ""


def _fits(message: dict[str, Any], fields: dict[str, str], known: dict[str, dict[str, str]]) -> bool:
    if split_time(message) is not None:
        return split_time(fields) is not None
    if set(message) - {"seq"} != set(fields) - {"seq"}:
        return False
    return all(
        not kind or (isinstance(value := message[name], dict) and _fits(value, known.get(kind, {}), known))
        for name, kind in fields.items()
    )
