"""`metadata.yaml` of rosbag2, version 9 (Jazzy)."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there
from samrl_core.common.text_files import parse_yaml, read_text
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.schemas import Definition

VERSION = 9
FILE_NAME = "metadata.yaml"
_ROOT = "rosbag2_bagfile_information"
_KINDS = {  # of entries that are read
    "storage_identifier": str,
    "compression_mode": str,
    "compression_format": str,
    "relative_file_paths": list,
    "topics_with_message_count": list,
    "custom_data": dict,
}


@dataclass
class Span:
    """Count and first and last log time [ns] of some messages."""

    count: int = 0
    start_ns: int = 0
    end_ns: int = 0

    def add(self, log_time_ns: int) -> None:
        """Count one message."""
        self.start_ns = log_time_ns if self.count == 0 else min(self.start_ns, log_time_ns)
        self.end_ns = max(self.end_ns, log_time_ns)
        self.count += 1

    def to_metadata(self) -> dict[str, Any]:
        """The three entries that rosbag2 stores per bag and per file."""
        return {
            "duration": {"nanoseconds": self.end_ns - self.start_ns},
            "starting_time": {"nanoseconds_since_epoch": self.start_ns},
            "message_count": self.count,
        }


@dataclass
class WrittenTopic:
    """A topic of a bag being written."""

    name: str
    qos: tuple[QoS, ...]
    definition: Definition
    serialization: str = "cdr"
    copied: bool = False  # from another bag, whose oddities are kept
    count: int = 0


@dataclass
class WrittenFile:
    """A file of a bag being written."""

    name: str
    span: Span = field(default_factory=Span)


def information(
    topics: list[WrittenTopic], files: list[WrittenFile], custom_data: dict[str, str], ros_distro: str
) -> dict[str, Any]:
    """The content of `rosbag2_bagfile_information`."""
    whole = Span()
    for file in files:
        if file.span.count:
            start = file.span.start_ns if whole.count == 0 else min(whole.start_ns, file.span.start_ns)
            whole = Span(whole.count + file.span.count, start, max(whole.end_ns, file.span.end_ns))
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **whole.to_metadata(),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.definition.type,
                    "serialization_format": topic.serialization,
                    "offered_qos_profiles": [qos.to_profile() for qos in topic.qos],
                    "type_description_hash": topic.definition.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        # Empty: MCAP compresses its own chunks, rosbag2's compression layer is not in use.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [{"path": file.name, **file.span.to_metadata()} for file in files],
        "custom_data": custom_data or None,
        "ros_distro": ros_distro,
    }


def save(folder: Path, content: dict[str, Any]) -> None:
    """Write metadata.yaml so that it is there whole or not at all. Raises `OSError`."""
    temporary = folder / f".{FILE_NAME}.tmp"
    try:
        with temporary.open("w") as stream:
            yaml.safe_dump({_ROOT: content}, stream, sort_keys=False, allow_unicode=True)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(folder / FILE_NAME)
    finally:
        temporary.unlink(missing_ok=True)


def load(folder: Path) -> dict[str, Any] | None:
    """The content of metadata.yaml, or None where there is none. Raises `InputError` if it is broken."""
    file = folder / FILE_NAME
    if not is_there(file):
        return None
    remedy = f"`samrl bag repair {folder}` makes a new bag from the recorded files alone"
    try:
        content = parse_yaml(read_text(file, "the bag's metadata"), str(file))
    except InputError as error:
        raise InputError(f"cannot read {file}: {error}; {remedy}") from error
    if not isinstance(content, dict) or not isinstance(content.get(_ROOT), dict):
        raise InputError(f"{file} has no {_ROOT}; {remedy}")
    about = content[_ROOT]
    for key, kinds in _KINDS.items():
        if about.get(key) is not None and not isinstance(about[key], kinds):
            shown = repr(about[key])[:80]
            raise InputError(f"{file}: {key} is {shown}, must be a {kinds.__name__}; {remedy}")
    if about.get("relative_file_paths") is not None:
        _check_names(about["relative_file_paths"], file, remedy)
    return about


def _check_names(names: list[Any], file: Path, remedy: str) -> None:
    """A bag is its folder: files elsewhere are somebody else's."""
    for name in names:
        if not isinstance(name, str) or not name or "\0" in name:
            raise InputError(f"{file} names the file {str(name)[:80]!r}, must be a file name; {remedy}")
        path = Path(name)
        if path.is_absolute() or ".." in path.parts:
            raise InputError(
                f"{file} names {name[:200]!r}, which lies outside of {file.parent}; a bag's files lie in its"
                f" folder: {remedy}"
            )
