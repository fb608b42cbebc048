"""Logs of sensors that tell no motion, with nothing beside them: what to record instead."""

from __future__ import annotations

from collections.abc import Sequence

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTable
from samrl_ros.log_import.draft.tracks.other_sensors import OtherSensor
from samrl_ros.log_import.formats.transform_tree import shorten
from samrl_ros.log_import.formats.views import name_of_file

_NAMED = 4  # files in a message
_REMEDIES = {
    OtherSensor.INERTIAL: (
        "what an inertial sensor feels, and no position. Where its carrier is follows from integrating twice,"
        " where an offset of 0.05 m/s^2 makes 2.5 m in 10 s: no motion of a body or of a joint is known."
        " Record where it is: a video or a motion capture (t,x,y or poses), or a joint's encoder beside its"
        " command. If x, y, z are a position after all, call the columns pos_x, pos_y, pos_z"
    ),
    OtherSensor.CORNERS: (
        "corners of a tag or a board in an image, and no pose: corners tell one with the camera's intrinsics"
        " and the board's size alone. cv2.solvePnP gives rvec and tvec of a view's corners: write them as"
        " rvec_x, ..., tvec_z, a row for each view, beside the flange's poses. So do pupil_apriltags,"
        " detect(image, estimate_tag_pose=True, camera_params=[fx, fy, cx, cy], tag_size=...), as pose_R and"
        " pose_t, and `kalibr_calibrate_cameras ... --export-poses` as a CSV"
    ),
}


def refuse_lone_sensor(tables: Sequence[LoggedTable]) -> None:
    """Say of what tables are that tell no motion.

    Raises:
        InputError: all of them are an IMU's, or corners in images.
    """
    kinds = {each.sensor for each in tables}
    if not tables or len(kinds) != 1 or (kind := kinds.pop()) is OtherSensor.NONE:
        return
    names = list(dict.fromkeys(name_of_file(each.path) for each in tables))
    raise InputError(f"{shorten(names, _NAMED)}: {_REMEDIES[kind]}")
