"""Poses of an arm beside which no target's stand: half of a chain, and no free body."""

from __future__ import annotations

from collections.abc import Sequence

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.blocks import LEAST_ROWS
from samrl_ros.log_import.draft.bodies.seen_tracks import is_named_body, is_of_a_machine
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.track_entries import find_time

# Of what an arm carries, names that nothing else has: a body may be a tool, and a hand may throw it.
ARMS = frozenset("robot flange ee eef tcp gripper endeffector effector rtde ur5 ur10 kuka franka".split())


def refuse_lone_arm(tracks: Sequence[LoggedTrack]) -> None:
    """Say what half of a chain lacks.

    Raises:
        InputError: every pose is an arm's by its name or by joints beside it, and none has a time, so that
            they are views that a camera took, whose target is not in the log.
    """
    whole = [each for each in tracks if each.track.whole]
    if not whole or len(whole) != len(tracks) or not all(_is_an_arms(each, tracks) for each in whole):
        return
    raise InputError(
        f"{', '.join(each.name for each in whole)}: poses of an arm, and none of a target that a camera saw"
        " beside them; a chain needs both. Write the target's pose in the camera into the same rows, as"
        " rvec_x, rvec_y, rvec_z, tvec_x, tvec_y, tvec_z (cv2.solvePnP gives them from a board's corners), or"
        " into a file of its own with as many rows, such as target.csv. Of a body that moves freely, call the"
        " file by it, such as cube.csv"
    )


def _is_an_arms(each: LoggedTrack, tracks: Sequence[LoggedTrack]) -> bool:
    if find_time(each, each.track.used) is not None or is_named_body(each):
        return False
    few = len(each.position) < LEAST_ROWS  # enough rows of joints are a log of joints
    return bool(each.words & ARMS) or (few and is_of_a_machine(each, tracks))
