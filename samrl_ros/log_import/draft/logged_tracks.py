"""Poses of a log with what names them: columns, files, topics, and the frames of headers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.draft.pose_tracks import LEAST, FoundTrack, find_tracks, named_frames
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics, read_frames
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import SUFFIXES, read_table

POSES = frozenset(
    f"geometry_msgs/msg/{name}" for name in ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped")
)


@dataclass(frozen=True, eq=False)
class LoggedPose:
    """A pose over time in its file."""

    path: Path
    table: Table
    track: FoundTrack
    part: str = ""  # of a bag: the topic
    header: tuple[str, str] = ("", "")  # child and parent frame, of a bag

    @property
    def frames(self) -> tuple[frozenset[str], frozenset[str]] | None:
        """Words of the child's and of the parent's name, where the log names them."""
        named = named_frames(self.track.stem)
        if named is None and self.header[1]:
            named = (self.header[0] or self.part, self.header[1])
        return None if named is None else (_words(named[0]), _words(named[1]))

    @property
    def words(self) -> set[str]:
        """Of its name; of the file where the columns say nothing."""
        if self.part:
            return set(_words(self.part))
        return set(self.track.stem) or set(self.path.stem.lower().replace("-", "_").split("_"))

    @property
    def name(self) -> str:
        """For sentences."""
        return f"{self.path.name}: {self.part or self.track.names}"


def read_logged_poses(paths: Sequence[Path]) -> list[LoggedPose] | None:
    """Every pose of files, bags, or what lies in a folder; None where something is no log of numbers.

    Raises:
        InputError: a file that cannot be read.
    """
    found: list[LoggedPose] = []
    for path in (file for given in paths for file in _files(given)):
        if is_bag(path):
            found += _topics(path)
            continue
        if not is_file(path) or path.suffix.lower() not in SUFFIXES:
            return None
        table = read_table(path, CsvOptions(), "the log", "")
        found += [LoggedPose(path, table, track) for track in find_tracks(table)]
    return found


def _files(path: Path) -> list[Path]:
    return sorted(path.iterdir()) if is_folder(path) and not is_bag(path) else [path]


def _topics(path: Path) -> list[LoggedPose]:
    """Topics of a bag that are poses of one thing."""
    out = []
    for topic in list_topics(path, "the log"):
        if topic.type in POSES and topic.count >= LEAST:
            table = read_table(path, CsvOptions(), "the log", topic.name)
            header = read_frames(path, topic.name, "the log")
            out += [LoggedPose(path, table, track, topic.name, header) for track in find_tracks(table)[:1]]
    return out


def _words(name: str) -> frozenset[str]:
    return frozenset(re.findall(r"[a-z]+\d*", name.lower()))
