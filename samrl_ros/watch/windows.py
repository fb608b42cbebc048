"""Cuts a stream of messages into bags of equal length that can each be diagnosed alone.

Descriptions are latched: they arrive once, and each bag begins with them.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.recorder import Recorder, header_stamp_ns
from samrl_ros.bags.writer import BagWriter

SHORTEST_S, LONGEST_S = 5.0, 3600.0  # of a window
BACK_NS = 500_000_000  # by which a clock that was set anew goes back at least
# What a diagnosis reads of a graph: joints and what drives them, by type; texts by name.
TYPES = frozenset(
    {
        "sensor_msgs/msg/JointState",
        "trajectory_msgs/msg/JointTrajectory",
        "control_msgs/msg/JointTrajectoryControllerState",
    }
)
TEXT = "std_msgs/msg/String"
_TEXTS = re.compile(r"(^|/)(robot_description|controller|tool)$")
_NS = 1_000_000_000


def is_diagnosed(topic: str, type_name: str) -> bool:
    """Whether a diagnosis can use a topic."""
    return type_name in TYPES or (type_name == TEXT and _TEXTS.search(topic) is not None)


@dataclass(frozen=True)
class LoggedWindow:
    """A finished bag."""

    number: int  # from 1
    folder: Path
    begin_ns: int  # clock of the graph
    messages: int
    lost: int  # messages that the middleware dropped on the way here


class Windows:
    """The window that is being written, and those before it."""

    def __init__(self, folder: Path, length_s: float) -> None:
        """Windows go to `folder`/0001, 0002, ...

        Raises:
            InputError: a length that is too short or long, or a folder with windows of an earlier watch.
        """
        if not SHORTEST_S <= length_s <= LONGEST_S:
            raise InputError(f"--window {length_s:g} s must be within {SHORTEST_S:g} and {LONGEST_S:g} s")
        if folder.exists() and any(folder.iterdir()):
            raise InputError(f"{folder} holds windows of an earlier watch; give another --out")
        self._folder, self._length_ns = folder, int(length_s * _NS)
        self._latched: dict[str, tuple[str, QoS, bytes]] = {}
        self._recorder: Recorder | None = None
        self._number = self._begin_ns = self._newest_ns = self._motions = self._lost = 0

    @property
    def elapsed_s(self) -> float:
        """Of the window that is being written."""
        return 0.0 if self._recorder is None else (self._newest_ns - self._begin_ns) / _NS

    @property
    def number(self) -> int:
        """Of the window that is being written, from 1; 0 before the first."""
        return self._number

    def describe(self, topic: str, type_name: str, qos: QoS, data: bytes) -> None:
        """Keep a latched message for the head of windows to come."""
        self._latched[topic] = (type_name, qos, data)

    def take(self, topic: str, type_name: str, qos: QoS, data: bytes, now_ns: int) -> LoggedWindow | None:
        """Take a message; the window that it ends, if it is the first one past its length.

        A clock that went back ends the window, too: stamps of one bag increase.
        """
        if qos.latched:
            self.describe(topic, type_name, qos, data)
        ended = None
        if self._recorder is not None and (
            now_ns - self._begin_ns >= self._length_ns or now_ns < self._newest_ns - BACK_NS
        ):
            ended = self.end()
        if qos.latched and self._recorder is None:
            return ended  # it stands at the head of the next window
        if self._recorder is None:
            self._open(now_ns)
        assert self._recorder is not None
        self._newest_ns = max(self._newest_ns, now_ns)
        self._motions += not qos.latched
        self._record(topic, type_name, qos, data, now_ns)
        return ended

    def lose(self, messages: int) -> None:
        """Count messages that never arrived against the window that is being written."""
        self._lost += messages

    def end(self) -> LoggedWindow | None:
        """Close the window that is being written; None if there is none."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return None
        recorder.close()
        return LoggedWindow(self._number, self._path(self._number), self._begin_ns, self._motions, self._lost)

    def drop(self, number: int) -> None:
        """Remove a window's bag."""
        shutil.rmtree(self._path(number), ignore_errors=True)

    def _open(self, now_ns: int) -> None:
        self._number += 1
        self._begin_ns = self._newest_ns = now_ns
        self._motions = self._lost = 0
        self._recorder = Recorder(BagWriter(self._path(self._number)))
        for topic, (type_name, qos, data) in self._latched.items():
            self._record(topic, type_name, qos, data, now_ns)

    def _record(self, topic: str, type_name: str, qos: QoS, data: bytes, now_ns: int) -> None:
        assert self._recorder is not None
        self._recorder.on_raw(topic, type_name, qos, data, now_ns, header_stamp_ns(type_name, data))

    def _path(self, number: int) -> Path:
        return self._folder / f"{number:04d}"
