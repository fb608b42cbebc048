"""The two chains of a bag's frames: the target in the camera that sees it, and the flange in its base.

A tree says what columns cannot: which frame is given in which, and where frames are connected also who
carries the camera and where it is stated to sit. What sees and what is seen is found by the names of frames.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder
from samrl_ros.log_import.draft.column_names import CAMERAS, SEEN
from samrl_ros.log_import.draft.tracks.found_track import LEAST
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack, files_of
from samrl_ros.log_import.draft.tracks.pose_runs import PoseRuns
from samrl_ros.log_import.draft.tracks.pose_tracks import find_positions, find_tracks
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics
from samrl_ros.log_import.formats.transform_tree import (
    BETWEEN,
    KINDS,
    Edge,
    TransformTree,
    read_transform_table,
    read_transform_tree,
    shorten,
)

TARGETS = SEEN - CAMERAS
# Words of frames that are a camera's: what it is, what it measures, and whose it is.
LENSES = CAMERAS | frozenset(
    "color colour depth infra ir rgbd stereo webcam realsense zed kinect oak astra femto basler".split()
)
# Frames that are called a flange, the likeliest first: REP 199's, then those of descriptions and grippers.
FLANGES = ("tool0", "flange", "ee_link", "ee", "eef", "tcp", "link8", "hand", "gripper", "tool", "link7")
BASES = ("base_link", "base", "link0")


@dataclass(frozen=True, eq=False)
class FoundChains:
    """What the frames of a bag say of a camera and an arm."""

    seen: LoggedTrack
    carried: LoggedTrack
    arm: str  # camera_arm or tool_arm, whichever moves; empty where no frames connect camera and arm
    stated: dict[str, dict[str, Any]]  # transforms of the mapping
    reasons: dict[str, str]  # keys of the mapping and why; of `stated` and of what nothing states
    question: str  # where several frames may be meant
    unused: tuple[str, ...]

    @property
    def alike(self) -> tuple[str, str, str]:
        """What bags of one chain share."""
        return self.seen.part, self.carried.part, self.arm


def find_bag_chains(
    paths: Sequence[Path], topics: Sequence[LoggedTrack]
) -> tuple[FoundChains, PoseRuns | None] | None:
    """Chains of a bag; with several bags alike, those of the first and which bags are runs of them.

    Args:
        paths: of logs, folders with bags among them.
        topics: poses that were found in them.

    Returns:
        None where no bag shows a target that a camera sees.

    Raises:
        InputError: a tree that is none, too few poses, or bags that differ.
    """
    bags = [path for given in paths for path in files_of(given) if _has_frames(path)]
    found = [find_chains(bag, topics) for bag in bags]
    chains = [each for each in found if each is not None]
    if not chains:
        return None
    if len(chains) == 1:
        return chains[0], None
    suffixes = {"" if is_folder(each.seen.path) else each.seen.path.suffix for each in chains}
    if len({each.alike for each in chains}) > 1 or len(suffixes | {e.seen.path.parent for e in chains}) > 2:
        names = "; ".join(f"{e.seen.path.name}: {e.seen.part}, {e.carried.part}" for e in chains)
        raise InputError(
            "bags of one chain lie in one folder, are of one kind and have the same frames; here are"
            f" {names}. Draft one of them, and name the others as recordings"
        )
    (suffix,) = suffixes
    names = tuple(each.seen.path.name.removesuffix(suffix) for each in chains)
    seen, carried = tuple(each.seen for each in chains), tuple(each.carried for each in chains)
    return chains[0], PoseRuns(names, seen, carried, (f"{{name}}{suffix}", f"{{name}}{suffix}"))


def _has_frames(path: Path) -> bool:
    return is_bag(path) and any(topic.type in KINDS for topic in list_topics(path, "the log"))


def find_chains(path: Path, topics: Sequence[LoggedTrack]) -> FoundChains | None:
    """Chains of one bag; None where nothing shows a target that a camera sees, and an arm.

    Args:
        path: of a bag with a tree of frames.
        topics: its poses.

    Raises:
        InputError: a tree that is none, or too few poses.
    """
    tree = read_transform_tree(path, "the log")
    own = [each for each in topics if each.path == path and each.track.whole]
    called = [edge for edge in tree.moving if _sees(edge)]
    named = [edge for edge in called if _words(_camera_and_target(edge)[0]) & LENSES]
    told = [each for each in own if each.frames and _is_seen_topic(each)]
    # A target that no camera's frame sees may be where an arm was sent.
    guessed = [] if named or told or _has_joints(path) else called or _of_own_stamps(tree)
    edges = sorted(named or guessed, key=lambda edge: len(edge.time), reverse=True)
    if not edges and not told:
        return None
    if edges:
        camera, target = _camera_and_target(edges[0])
        seen = _read_chain(path, target, camera, role=1)
    else:
        seen = replace(told[0], role=1)
        camera = seen.header[1].lstrip("/")
    hung = [] if camera not in {f for pair in tree.edges for f in pair} else tree.climb(camera)
    arms = [edge for edge in tree.moving if edge not in edges]
    flange, base, rivals = _find_arm(tree, hung, arms)
    if flange:
        carried, arm = _read_chain(path, flange, base, role=-1), _who_moves(tree, hung, arms, camera, base)
    else:
        rest = [each for each in own if each is not seen and each not in told]
        if not rest:
            return None
        carried, arm = replace(rest[0], role=-1), ""
    stated, reasons = _stated(tree, arm, camera, flange, base)
    asked = _asked(edges, bool(guessed), seen, carried, rivals)
    beside = [] if edges else [t for t in find_tracks(seen.table) if t.used != seen.track.used]
    if beside and not asked:
        asked = f"is it {seen.track.used[0]}, and not {shorten([t.used[0] for t in beside])}?"
    return FoundChains(
        seen, carried, arm, stated, reasons, asked,
        tuple(f"{path.name}: {edge.name}" for edge in edges[1:]),
    )  # fmt: skip


def _words(frame: str) -> set[str]:
    """Of a frame, without numbers: tag36h11:3 is a tag."""
    return set(re.findall(r"[a-z]+", frame.lower()))


def _sees(edge: Edge) -> bool:
    """Whether names say that one end is a target; it is given in a camera, or the camera in it."""
    child, parent = _words(edge.child), _words(edge.parent)
    if child & TARGETS:
        return not child & CAMERAS and not parent & TARGETS
    return bool(parent & TARGETS and child & CAMERAS)


def _camera_and_target(edge: Edge) -> tuple[str, str]:
    turned = _words(edge.parent) & TARGETS and not _words(edge.child) & TARGETS
    return (edge.child, edge.parent) if turned else (edge.parent, edge.child)


def _is_seen_topic(each: LoggedTrack) -> bool:
    _, parent = each.header
    return bool(_words(parent) & LENSES and not _words(parent) & TARGETS)


def _has_joints(path: Path) -> bool:
    return any(topic.type.endswith("JointState") for topic in list_topics(path, "the log"))


def _of_own_stamps(tree: TransformTree) -> list[Edge]:
    """Moving frames at the ends of the tree with stamps of their own: no arm's publisher gave them."""
    often = max(tree.moving, key=lambda edge: sum(_share(edge, other) for other in tree.moving), default=None)
    if often is None or not any(_share(often, other) for other in tree.moving if other is not often):
        return []
    return [edge for edge in tree.moving if not _share(edge, often) and not tree.children(edge.child)]


def _share(one: Edge, other: Edge) -> bool:
    """Whether two transforms come with the same stamps."""
    return bool(np.isin(one.time, other.time).mean() > 0.5)


def _find_arm(tree: TransformTree, hung: list[str], arms: Sequence[Edge]) -> tuple[str, str, list[str]]:
    """Flange and base of the arm that carries the camera, else of one whose flange has a name; and rivals.

    Empty where nothing moves but the target.
    """
    if carried := _moving_pairs(hung, arms):
        return _best(tree, carried[0][0], FLANGES), _best(tree, carried[-1][1], BASES), []
    ends: dict[str, list[tuple[str, str]]] = {}
    for frame in sorted({child for child, _ in tree.edges}):
        try:
            ends[frame] = _moving_pairs(tree.climb(frame), arms)
        except InputError:  # a frame that no chain needs may have two parents
            continue
    ends = {frame: joints for frame, joints in ends.items() if joints}
    if not ends:
        return "", "", []

    def rank(frame: str) -> tuple[int, int, int]:
        return _rank(frame, FLANGES), -len(ends[frame]), len(frame)

    flange = min(ends, key=rank)
    rivals = [f for f in ends if rank(f)[:2] == rank(flange)[:2] and ends[f] != ends[flange]]
    return flange, _best(tree, ends[flange][-1][1], BASES), rivals


def _moving_pairs(way: Sequence[str], arms: Sequence[Edge]) -> list[tuple[str, str]]:
    """Child and parent of the transforms up a way that are an arm's."""
    pairs = {(edge.child, edge.parent) for edge in arms}
    return [pair for pair in zip(way[:-1], way[1:], strict=True) if pair in pairs]


def _rank(frame: str, names: Sequence[str]) -> int:
    """The place of the first name that a frame has; behind all where it has none."""
    plain = f"_{frame.lower().replace('/', '_')}_"
    return next((k for k, name in enumerate(names) if f"_{name}_" in plain), len(names))


def _best(tree: TransformTree, frame: str, names: Sequence[str]) -> str:
    """The frame, or what is fixed to it and has one of the names."""
    fixed, left = {frame}, [frame]
    while left:
        one = left.pop()
        for other in (*tree.children(one), *tree.parents(one)):
            pair = (other, one) if (other, one) in tree.edges else (one, other)
            if other not in fixed and not tree.edges[pair].moves:
                fixed.add(other)
                left.append(other)
    ranked = sorted(fixed, key=lambda f: (_rank(f, names), f != frame, len(f), f))
    return ranked[0] if _rank(ranked[0], names) < len(names) else frame


def _who_moves(tree: TransformTree, hung: list[str], arms: Sequence[Edge], camera: str, base: str) -> str:
    if _moving_pairs(hung, arms):
        return "camera_arm"
    return "tool_arm" if hung and tree.still_pose(camera, base) is not None else ""


def _stated(
    tree: TransformTree, arm: str, camera: str, flange: str, base: str
) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """The camera's transform as the tree gives it, or why it does not."""
    if not arm:
        why = "no frames connect the camera and the arm (no /tf_static?), so nothing states where it is"
        return {}, {"poses": why}
    key, frame = ("camera_in_flange", flange) if arm == "camera_arm" else ("camera_in_base", base)
    pose = tree.still_pose(camera, frame)
    if pose is None:
        return {}, {}
    position = [round(float(v), 9) for v in pose[:3, 3]]
    turn = [round(float(v), 12) for v in Rotation.from_matrix(pose[:3, :3]).as_quat()]
    why = f"{camera}{BETWEEN}{frame}, as the bag's frames state it: this is what is judged"
    return {key: {"position": position, "quaternion": turn}}, {key: why}


def _asked(
    edges: Sequence[Edge], guessed: bool, seen: LoggedTrack, carried: LoggedTrack, rivals: Sequence[str]
) -> str:
    cameras = {_camera_and_target(edge)[0] for edge in edges}
    if guessed:
        return f"is {seen.part} the target as the camera sees it, and {carried.part} the flange's pose?"
    if len(cameras) > 1:
        others = ", ".join(edge.name for edge in edges[1:])
        return f"is it {seen.part}, and not {others}?"
    if rivals:
        return f"is it the arm of {carried.part}, and not that of {shorten(sorted(rivals))}?"
    return ""


def _read_chain(path: Path, child: str, parent: str, role: int) -> LoggedTrack:
    """A pose of the tree as a track. Raises `InputError` where it was hardly recorded."""
    table = read_transform_table(path, child, parent, "the log")
    tracks = find_positions(table)
    if not tracks:
        raise InputError(
            f"{path.name}: {child!r} in {parent!r} was recorded {len(table.columns['position.x'])} times,"
            f" {LEAST} are the least: did the detector run, and was /tf recorded all the time?"
        )
    track = replace(tracks[0], unit="m")  # REP 103
    return LoggedTrack(path, table, track, f"{child}{BETWEEN}{parent}", (child, parent), role=role)
