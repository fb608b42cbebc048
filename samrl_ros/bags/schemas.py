"""Message definitions for bags: the text and type hash that rosbag2 itself would write.

Texts come, in this order, from the ament prefixes (`AMENT_PREFIX_PATH`, then this environment), from
samrl's own interface folders, and, where no ROS is installed, from the typestore of `rosbags`. The last
gives the same fields without the comments, so bags are then readable everywhere, but their schema texts
are not byte-identical to rosbag2's.
"""

from __future__ import annotations

import json
import os
import re
import sys
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.bags.type_hash import PRIMITIVES, rihs01

_TYPE_NAME = re.compile(r"^[A-Za-z]\w*/msg/[A-Za-z]\w*$")
# Field types as rosbag2's regular expression finds them; bounded strings do not match, as there.
_FIELD_TYPE = re.compile(r"(?:^|\n)\s*([a-zA-Z0-9_/]+)(?:\[[^\]]*\])?\s+")
_SEPARATOR = "\n" + "=" * 80 + "\nMSG: "


@dataclass(frozen=True)
class Definition:
    """What a bag stores about a type."""

    type: str  # pkg/msg/Name
    text: str  # with all nested types
    type_hash: str = ""  # RIHS01_..., empty if not known (bags from elsewhere)
    encoding: str = "ros2msg"


def _folders(package: str) -> list[Path]:
    prefixes = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    here = Path(__file__).resolve().parents[1]  # samrl_ros
    return [
        *(prefix / "share" / package for prefix in [*prefixes, Path(sys.prefix)]),
        here / "interfaces" / "definitions" / package,  # an installed samrl
        here.parent / "msgs_docs" / package,  # a checkout
    ]


@cache
def _installed_text(type_name: str) -> str | None:
    package, kind, name = type_name.split("/")
    for folder in _folders(package):
        file = folder / kind / f"{name}.msg"
        if file.is_file():
            return file.read_bytes().decode()  # not read_text: line ends stay as they are
    return None


@lru_cache(maxsize=1)
def _typestore_texts() -> dict[str, str]:
    """Definition of every type that rosbags knows."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    return {
        name: store.generate_msgdef(name, ros_version=2)[0] for name in store.fielddefs if "/msg/" in name
    }


def _check_name(type_name: str) -> None:
    if not _TYPE_NAME.match(type_name):
        raise InputError(f"message type {type_name!r} must read package/msg/Name")


def message_text(type_name: str) -> str:
    """The .msg text of one type, without its nested types. Raises `InputError` if it is not known."""
    _check_name(type_name)
    text = _installed_text(type_name)
    if text is None and type_name in _typestore_texts():
        text = _typestore_texts()[type_name].split("=" * 80 + "\n")[0]
    if text is None:
        package = type_name.split("/")[0]
        raise InputError(
            f"no definition of message type {type_name}: none in {', '.join(map(str, _folders(package)))};"
            f" install the ROS package {package}, or add its prefix to AMENT_PREFIX_PATH"
        )
    return text


def schema_text(type_name: str) -> str:
    """`ros2msg` text: the type itself, then every nested type once, depth first in sorted order.

    The order is that of rosbag2_cpp (local_message_definition_source.cpp), so that equal types give
    equal bytes whoever recorded them.
    """
    seen: set[str] = set()

    def append(short_name: str) -> str:
        package, name = short_name.split("/")[0], short_name.split("/")[-1]
        text = message_text(f"{package}/msg/{name}")
        bases = {base for base in _FIELD_TYPE.findall(text) if base not in PRIMITIVES}
        result = text
        for nested in sorted(base if "/" in base else f"{package}/{base}" for base in bases):
            if nested not in seen:
                seen.add(nested)
                result += _SEPARATOR + nested + "\n" + append(nested)
        return result

    return append(type_name)


def type_hash(type_name: str) -> str:
    """RIHS01 hash: from the generated .json where one is installed, else computed from the texts."""
    package, kind, name = type_name.split("/")
    for folder in _folders(package):
        file = folder / kind / f"{name}.json"
        if file.is_file():
            for entry in json.loads(file.read_text())["type_hashes"]:
                if entry["type_name"] == type_name:
                    return entry["hash_string"]
    return rihs01(type_name, message_text)


@cache
def definition(type_name: str) -> Definition:
    """Text and hash of a type. Raises `InputError` with a remedy if the type is not known."""
    _check_name(type_name)
    return Definition(type_name, schema_text(type_name), type_hash(type_name))
