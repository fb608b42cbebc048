"""Drafts a mapping of whatever a log holds: poses, a body's track, readings, or joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from samrl_ros.log_import.draft.bag_set import bags_of, spread
from samrl_ros.log_import.draft.blocks import ROS_TYPES, numbers_of
from samrl_ros.log_import.draft.bodies.body_draft import draft_bodies
from samrl_ros.log_import.draft.bodies.seen_tracks import (
    are_at_once,
    is_named_body,
    is_of_a_machine,
    stands_still,
)
from samrl_ros.log_import.draft.bodies.unclear_height import refuse_unclear_height
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.poses.joint_chain import draft_joint_chain
from samrl_ros.log_import.draft.poses.joint_table import draft_joint_table, draft_with_description_beside
from samrl_ros.log_import.draft.poses.lone_arm import refuse_lone_arm
from samrl_ros.log_import.draft.poses.lone_sensor import refuse_lone_sensor
from samrl_ros.log_import.draft.poses.point_pairs import refuse_point_pairs
from samrl_ros.log_import.draft.poses.pose_draft import are_roles_sure, draft_pairs, draft_poses
from samrl_ros.log_import.draft.readings.clock_draft import LEAST, draft_stamped_topic
from samrl_ros.log_import.draft.readings.depth_draft import draft_depth_images
from samrl_ros.log_import.draft.readings.reading_draft import draft_readings
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTable, LoggedTrack, read_logged_tables
from samrl_ros.log_import.draft.tracks.transform_chains import find_bag_chains
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics


def draft_any(
    paths: Sequence[Path], urdf: str | None, urdf_file: str | None, effort: Effort = Effort.ask
) -> Draft:
    """Draft a mapping; with a robot's description the log is one of its joints, or of a camera beside them.

    Args:
        paths: as `draft_mapping`, or files of poses, bodies or readings; several bags of one folder, or that
            folder, are recordings of one machine, and the first by name is drafted for all.
        urdf: text of the robot's description, if there is one.
        urdf_file: where it lies.
        effort: what measured efforts are.

    Raises:
        InputError: a log that cannot be read, or in which nothing was found.
    """
    bags = bags_of(paths)
    one = bags[:1] or paths
    if urdf is None:
        drafted = draft_free_devices(paths)  # of several bags with poses or bodies, too
    elif urdf_file is None:
        drafted = None
    elif all(map(is_bag, one)):
        drafted = draft_joint_chain(one, urdf, urdf_file)
    else:
        drafted = draft_joint_table(read_logged_tables(paths), urdf, urdf_file)
    if drafted is None:
        drafted = draft_mapping(one, urdf, urdf_file, effort)
        return spread(drafted, bags) if len(bags) > 1 else drafted
    return drafted


def draft_free_devices(paths: Sequence[Path]) -> Draft | None:
    """A draft of readings, poses or a body; None where the log holds none of them, or joints beside them.

    Raises:
        InputError: a log that cannot be read.
    """
    if (images := draft_depth_images(paths)) is not None:
        return images
    tables = read_logged_tables(paths)
    if (joints := draft_with_description_beside(paths, tables)) is not None:
        return joints
    refuse_lone_sensor(tables)
    return draft_readings(tables) or _draft_tracks(paths, tables) or draft_stamped_topic(paths)


def _draft_tracks(paths: Sequence[Path], tables: Sequence[LoggedTable]) -> Draft | None:
    tracks = [track for table in tables for track in table.tracks()]
    if (frames := find_bag_chains(paths, tracks)) is not None:
        return draft_poses(tracks, frames)
    if not tracks:
        return None
    if are_roles_sure(tracks):
        return draft_poses(tracks)
    refuse_lone_arm(tracks)
    refuse_point_pairs(tracks)
    if any(is_of_a_machine(each, tracks) for each in tracks):
        return None
    if (pairs := draft_pairs(tracks)) is not None:
        return pairs
    bodies = draft_bodies(tracks)
    if bodies is not None and _joints_beside(paths) and (bodies.questions or not bodies.falls):
        return None  # what a camera sees while joints move; a body that falls beside them is sure
    if bodies is not None and (beside := _tables_beside(tables)):
        bodies.note(
            "bodies.track", f"{', '.join(beside)} {'lies' if len(beside) == 1 else 'lie'} beside it, without"
            " a pose that was found", "does it move freely, and is it not on what those tell of (an arm)?",
        )  # fmt: skip
    at_once = are_at_once(tracks)
    alone = not at_once and bodies is not None and (_few_poses(tracks) or bodies.falls)
    if bodies is not None and (alone or any(map(is_named_body, tracks))):
        return bodies  # what an arm carries does not fall
    drafted = draft_poses(tracks) or bodies
    if drafted is None:
        refuse_unclear_height(tracks)
    return drafted


def _joints_beside(paths: Sequence[Path]) -> bool:
    """Whether a bag tells of joints, too."""
    topics = [topic for path in paths if is_bag(path) for topic in list_topics(path, "the log")]
    return any(topic.type in ROS_TYPES and topic.count >= LEAST for topic in topics)


def _tables_beside(tables: Sequence[LoggedTable]) -> list[str]:
    """Files with many rows of numbers and no track, beside files with tracks."""
    found = []
    for each in tables:
        if each.part or each.tracks():
            continue
        columns = [numbers_of(each.table, name) for name in each.table.columns]
        if any(values is not None and len(values) >= LEAST for values in columns):
            found.append(each.path.name)
    return list(dict.fromkeys(found))


def _few_poses(tracks: Sequence[LoggedTrack]) -> bool:
    """Whether no file, and no bag, holds two poses, so that there is no chain."""
    paths = [each.motion for each in tracks if each.track.whole and not stands_still(each, tracks)]
    return len(paths) == len(set(paths)) and (len(paths) < 2 or len({t.track.stem for t in tracks}) == 1)
