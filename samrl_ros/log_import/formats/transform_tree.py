"""Trees of frames in ROS bags: /tf and /tf_static, and the pose of one frame in another along them.

A part of a bag that reads `tool0 in base_link` is such a pose. Between stamps a transform is interpolated;
where one was not heard of for long, the pose is left out. As in tf2 a child has one parent.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_ros.log_import.formats.rosbag import list_topics, read_messages
from samrl_ros.log_import.resampling import are_between
from samrl_ros.log_import.table import Table

KINDS = frozenset({"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"})
BETWEEN = " in "  # of child and parent in the name of a part
MOST_BACK_S = 1.0  # by which stamps of one transform may come late; more is a second run, or another clock
STILL = 1e-9  # [m], and of a quaternion: a transform that changes by less was only repeated
_UNIT_LENGTH = 0.01  # by which a quaternion's length may differ from 1
_NAMED = 12  # frames that a message lists


@dataclass(frozen=True, eq=False)
class Edge:
    """A child frame in its parent."""

    child: str
    parent: str
    time: np.ndarray  # (N,) [s], increasing; of a still one a single 0
    poses: np.ndarray  # (N, 7): position [m] and quaternion xyzw
    moves: bool

    @property
    def name(self) -> str:
        """As a part of a bag is called; see `frames_of`."""
        return f"{self.child}{BETWEEN}{self.parent}"

    def at(self, time: np.ndarray) -> np.ndarray:
        """(M, 4, 4) at times (M,) [s]; of a still one always the same. Raises `InputError` if far off."""
        position, turns = self.poses[:, :3], self.poses[:, 3:]
        if np.array_equal(self.time, time):
            return rigid.transforms(position, turns)
        return rigid.Interpolated(PoseTrack(self.time, position, turns), self.moves).at(time)


@dataclass(frozen=True, eq=False)
class TransformTree:
    """Every transform that a bag holds."""

    name: str  # of the bag, for messages
    edges: dict[tuple[str, str], Edge]  # by child and parent
    unstamped: int  # moving transforms without a stamp, at the recorder's time
    broken: int  # transforms that are left out: not finite, or no rotation

    @property
    def moving(self) -> list[Edge]:
        """Transforms that change."""
        return [edge for edge in self.edges.values() if edge.moves]

    def parents(self, frame: str) -> list[str]:
        """Frames in which a frame is given; one, in a tree."""
        return [parent for child, parent in self.edges if child == frame]

    def children(self, frame: str) -> list[str]:
        """Frames that are given in a frame."""
        return [child for child, parent in self.edges if parent == frame]

    def climb(self, frame: str, wanted: str = "") -> list[str]:
        """The frame, its parent, and so on up to the root, or to the one that is wanted.

        Raises:
            InputError: a frame with two parents of which none is wanted, or frames that go round.
        """
        way = [frame]
        while way[-1] != wanted and (parents := self.parents(way[-1])):
            if len(parents) > 1 and wanted not in parents:
                raise InputError(
                    f"{self.name}: frame {way[-1]!r} has {len(parents)} parents, {' and '.join(parents)}, so"
                    " its place depends on which was heard last; record it with one publisher of it, or"
                    " take the other out of the bag"
                )
            up = wanted if wanted in parents else parents[0]
            if up in way:
                ring = " in ".join([*way[way.index(up) :], up])
                raise InputError(
                    f"{self.name}: frames go round: {ring}; a tree has one root: take one of these transforms"
                    " out of the bag"
                )
            way.append(up)
        return way

    def way(self, child: str, parent: str) -> tuple[list[str], list[str]]:
        """Frames up from the child, and up from the parent, to the one that both hang on.

        Raises:
            InputError: a frame that is not there, no connection, or as `climb`.
        """
        there = {frame for edge in self.edges for frame in edge}
        for frame in (child, parent):
            if frame not in there:
                raise InputError(f"{self.name} has no frame {frame!r}; frames are {shorten(sorted(there))}")
        if parent in (up := self.climb(child, parent)):
            return up, [parent]
        if child in (down := self.climb(parent, child)):
            return [child], down
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            raise InputError(
                f"{self.name}: nothing connects {child!r} (under {up[-1]!r}) and {parent!r} (under"
                f" {down[-1]!r}); was /tf_static recorded? It is sent once: begin recording before its"
                " publishers, or with `ros2 bag record`, which asks for it"
            )
        return up[: up.index(shared) + 1], down[: down.index(shared) + 1]

    def between(self, child: str, parent: str) -> list[tuple[Edge, bool]]:
        """Transforms from the parent to the child, each with whether it leads down the tree."""
        up, down = self.way(child, parent)
        out = [(self.edges[pair], False) for pair in zip(down[:-1], down[1:], strict=True)]
        back = [(self.edges[pair], True) for pair in zip(up[:-1], up[1:], strict=True)]
        return [*out, *reversed(back)]

    def still_pose(self, child: str, parent: str) -> np.ndarray | None:
        """(4, 4) of a child that never moves in the parent; None where it does, or nothing connects them."""
        try:
            steps = self.between(child, parent)
        except InputError:
            return None
        return None if any(edge.moves for edge, _ in steps) else _composed(steps, np.zeros(1))[0]


def describe_tree(path: Path) -> str:
    """What a bag's frames lack to be poses of a target and a flange, as the end of a sentence."""
    tree = read_transform_tree(path, "the log")
    if not tree.edges:
        return ". Its trees of frames are empty"
    if not tree.moving:
        return (
            f". Of its {len(tree.edges)} frames none moves: record /tf beside /tf_static (`ros2 bag record"
            " /tf /tf_static`)"
        )
    moving = shorten([edge.name for edge in tree.moving])
    return (
        f". Of its frames move {moving}: none is named as a target that a camera sees (tag, marker, board,"
        f" target) beside an arm; name them in a mapping, with `part: CHILD{BETWEEN}PARENT` of a source"
    )


def frames_of(part: str) -> tuple[str, str] | None:
    """(child, parent) of a part such as `tool0 in base_link`; None of a topic's name."""
    child, between, parent = part.partition(BETWEEN)
    return (child.strip(), parent.strip()) if between else None


def read_transform_table(path: Path, child: str, parent: str, where: str) -> Table:
    """The pose of a frame in another over time: `position.x`, ..., `orientation.w`.

    Rows have the stamps of the transform on the way that was heard most often; others are interpolated.

    Raises:
        InputError: as `TransformTree.way`, nothing on the way moves, or stamps that go back.
    """
    tree = read_transform_tree(path, where)
    steps = tree.between(child, parent)
    stamps = [edge.time for edge, _ in steps if edge.moves]
    if not stamps:
        raise InputError(f"{where}: {child!r} does not move in {parent!r}: {path.name} gives one pose of it")
    often = max(stamps, key=len)
    known = np.ones(len(often), dtype=bool)
    for others in stamps:
        known &= are_between(often, others)
    if not known.any():
        raise InputError(
            f"{where}: the transforms between {parent!r} and {child!r} were never recorded at one time"
        )
    time = often[known]
    poses = _composed(steps, time)
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    columns: dict[str, Any] = {f"position.{letter}": poses[:, k, 3] for k, letter in enumerate("xyz")}
    columns |= {f"orientation.{letter}": turns[:, k] for k, letter in enumerate("xyzw")}
    table = Table(path, columns, time=time)
    if not known.all():
        table.notes.append(
            f"{child} in {parent}: {np.count_nonzero(~known)} of {len(known)} poses are left out, where"
            " another transform on the way was not heard of"
        )
    if tree.unstamped:
        table.notes.append(f"{tree.unstamped} transforms have no stamp; the recorder's log times are used")
    if tree.broken:
        table.notes.append(f"{tree.broken} transforms that are no rotations, or not finite, are left out")
    return table


def _composed(steps: list[tuple[Edge, bool]], time: np.ndarray) -> np.ndarray:
    """Poses (N, 4, 4) of the last child in the first parent."""
    pose = np.tile(np.eye(4), (len(time), 1, 1))
    for edge, down in steps:
        one = edge.at(time)
        pose = pose @ (one if down else rigid.inverse(one))
    return pose


def read_transform_tree(path: Path, where: str) -> TransformTree:
    """Every transform of a bag. Raises `InputError` where the bag cannot be read or stamps go back."""
    state = path.stat()
    return _read_tree(path, where, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=4)  # a draft asks for several frames of one bag
def _read_tree(path: Path, where: str, state: tuple[int, int]) -> TransformTree:
    heard: dict[tuple[str, str], list[tuple[float, float, tuple[float, ...]]]] = defaultdict(list)
    fixed: set[tuple[str, str]] = set()
    broken = 0
    for topic in list_topics(path, where):
        if topic.type not in KINDS:
            continue
        for log_time_ns, message in read_messages(path, topic.name, where):
            for child, parent, stamp, numbers in _transforms(message):
                if not _is_pose(numbers):
                    broken += 1
                    continue
                heard[child, parent].append((stamp, 1e-9 * log_time_ns, numbers))
                if topic.name.endswith("tf_static"):
                    fixed.add((child, parent))
    edges, unstamped = {}, 0
    for pair, rows in heard.items():
        rows = rows[-1:] if pair in fixed else rows  # tf2 keeps the last of a still one
        numbers = np.array([each for _, _, each in rows])
        numbers[:, 3:] /= np.linalg.norm(numbers[:, 3:], axis=1)[:, None]
        moves = bool(np.abs(numbers - numbers[0]).max() > STILL)
        time = np.array([stamp for stamp, _, _ in rows])
        if moves and not time.any():
            time, unstamped = np.array([logged for _, logged, _ in rows]), unstamped + len(rows)
        time, numbers = _in_order(time, numbers, pair, path) if moves else (np.zeros(1), numbers[:1])
        edges[pair] = Edge(*pair, time, numbers, moves and len(time) > 1)
    return TransformTree(path.name, edges, unstamped, broken)


def _in_order(
    time: np.ndarray, numbers: np.ndarray, pair: tuple[str, str], path: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (N,) and poses (N, 7) by their stamps, of equal ones the first, as tf2 keeps it."""
    back = np.maximum.accumulate(time) - time
    if back.max() > MOST_BACK_S:
        k = int(np.argmax(back > MOST_BACK_S))
        raise InputError(
            f"{path.name}: stamps of {pair[0]!r} in {pair[1]!r} go back by {back[k]:.3g} s after"
            f" {time[k - 1] - time[0]:.3f} s: two runs, or two publishers with different clocks; cut the bag,"
            " or record one of them"
        )
    time, first = np.unique(time, return_index=True)
    return time, numbers[first]


def _transforms(message: Any) -> Iterator[tuple[str, str, float, tuple[float, ...]]]:
    """Child, parent, stamp [s], and position and quaternion of each transform of a message."""
    for each in message.transforms:
        stamp = each.header.stamp
        seconds = getattr(stamp, "sec", getattr(stamp, "secs", 0))
        rest = getattr(stamp, "nanosec", getattr(stamp, "nsecs", getattr(stamp, "nsec", 0)))
        p, q = each.transform.translation, each.transform.rotation
        child, parent = (str(name).lstrip("/") for name in (each.child_frame_id, each.header.frame_id))
        numbers = tuple(float(v) for v in (p.x, p.y, p.z, q.x, q.y, q.z, q.w))
        yield child, parent, float(seconds) + 1e-9 * float(rest), numbers


def _is_pose(numbers: tuple[float, ...]) -> bool:
    """Whether tf2 would take it."""
    return all(map(math.isfinite, numbers)) and abs(math.hypot(*numbers[3:]) - 1.0) < _UNIT_LENGTH


def shorten(names: list[str], most: int = _NAMED) -> str:
    """The first ones of a long list."""
    more = f", and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more
