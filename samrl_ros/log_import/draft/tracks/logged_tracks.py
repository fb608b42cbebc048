"""Tracks of a log with what names them: columns, files, topics, and the frames of headers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.draft.blocks import counts_rows, numbers_of
from samrl_ros.log_import.draft.column_names import (
    BASES,
    CAMERAS,
    CARRIED,
    COMMANDED,
    MEASURED,
    SEEN,
    is_time,
    words_in,
)
from samrl_ros.log_import.draft.echoed_messages import CHILD, FRAME
from samrl_ros.log_import.draft.text_layout import text_options
from samrl_ros.log_import.draft.tracks.found_track import LEAST, FoundTrack
from samrl_ros.log_import.draft.tracks.other_sensors import OtherSensor, find_sensor
from samrl_ros.log_import.draft.tracks.pose_tracks import (
    empty_zeros,
    find_positions,
    lettered_frames,
    named_frames,
    position_of,
)
from samrl_ros.log_import.formats.colmap import MAKER
from samrl_ros.log_import.formats.hdf5 import SUFFIXES as HDF5_SUFFIXES
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics, read_frames
from samrl_ros.log_import.formats.text import labels_in, rows_of
from samrl_ros.log_import.formats.transform_tree import frames_of
from samrl_ros.log_import.formats.views import files_of_views, find_views, is_of_views, name_of_file
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import SUFFIXES, TEXT_SUFFIXES, is_text_table, read_table

POSES = frozenset(
    f"geometry_msgs/msg/{name}"
    for name in ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "PointStamped", "Pose")
) | {"nav_msgs/msg/Odometry"}
# Lists of what a detector saw, each with its number and its pose in the camera of the header.
DETECTORS = frozenset(
    "apriltag_ros/msg/AprilTagDetectionArray apriltags2_ros/msg/AprilTagDetectionArray"
    " aruco_opencv_msgs/msg/ArucoDetection aruco_msgs/msg/MarkerArray ros2_aruco_interfaces/msg/ArucoMarkers"
    " fiducial_msgs/msg/FiducialTransformArray".split()
)
# Files of ETH's hand_eye_calibration: `poses_B_H`, the hand in the base, `poses_W_E`, the eye in the world.
HAND_EYE = re.compile(r"(?:^|_)([BW])_([HE])(?:_|$)")
FRAMES = {"B": "base", "H": "hand", "W": "world", "E": "eye"}
_FILE_OF_FRAMES = re.compile(r"(?<![a-z])([a-z]+)(?:2|_to_|_in_|_wrt_)([a-z]+)")  # gripper2base.csv
_KNOWN_FRAMES = SEEN | CARRIED | CAMERAS | BASES
_TRANSFORMS = frozenset("t tf h x pose transform".split())  # T_base_ee
_COMMANDED, _MEASURED = frozenset(COMMANDED.split()), frozenset(MEASURED.split())
SLAM = frozenset("slam vio orbslam orb vins okvis rovio svo dso".split())  # in names of files
NUMBERED = frozenset("id ids tag marker body object label".split())  # in names of columns that number things
MOST_LABELS = 16  # things that rows of one file are of
SHARED = 0.5  # of the time, that things beside each other are seen together


@dataclass(frozen=True, eq=False)
class LoggedTrack:
    """A pose or a position over time in its file."""

    path: Path
    table: Table
    track: FoundTrack
    part: str = ""  # of a bag: the topic
    header: tuple[str, str] = ("", "")  # child and parent frame, of a bag
    csv: CsvOptions = CsvOptions()  # how the file is written
    role: int = 0  # 1 of a target that is seen, -1 of a flange, where a tree of frames says it
    run: str = ""  # group of a file that holds one motion in each

    @property
    def frames(self) -> tuple[frozenset[str], frozenset[str]] | None:
        """Words of the child's and of the parent's name, where the log names them."""
        named = named_frames(self.track.stem)
        if named is None and self.header[1]:
            named = (self.header[0] or self.part, self.header[1])
        if named is None and (letters := HAND_EYE.search(self.path.stem)):
            named = (FRAMES[letters[2]], FRAMES[letters[1]])
        if named is None and not self.track.named and (two := _FILE_OF_FRAMES.search(self.path.stem.lower())):
            named = (two[1], two[2]) if {two[1], two[2]} <= _KNOWN_FRAMES else None
        return None if named is None else (_words(named[0]), _words(named[1]))

    @property
    def likely_frames(self) -> tuple[frozenset[str], frozenset[str]] | None:
        """The same, of a matrix called T_base_ee: mostly the second frame in the first, which is no proof."""
        if self.frames is not None or len(self.track.used) != 1:
            return self.frames
        first, *names = re.findall(r"[a-z]+\d*", self.track.used[0].rpartition(".")[2].lower()) or [""]
        if first not in _TRANSFORMS or len(names) != 2:
            return None
        return frozenset(names[1:]), frozenset(names[:1])

    @property
    def is_camera_in_world(self) -> bool:
        """Whether it is the camera's own pose by letters, as w2c: the arm's with the hand-eye calibration."""
        frames = lettered_frames(self.track.stem)
        own = self.table.maker != MAKER  # whose world is what the camera saw
        return (
            own and frames is not None and {frames[0], frames[1]} in ({"camera", "world"}, {"camera", "base"})
        )

    @property
    def is_camera_in_map(self) -> bool:
        """Whether its file says that a camera found itself in its own map, as ORB-SLAM's CameraTrajectory."""
        words = set() if self.part else set(words_in(self.path.stem))
        return (
            self.table.maker == MAKER
            or bool(words & SLAM)
            or {"camera", "trajectory"} <= words
            or {"key", "frame"} <= words
        )

    @property
    def of_frames(self) -> bool:
        """Whether a tree of frames gives it, which says what is given in what."""
        return frames_of(self.part) is not None

    @property
    def words(self) -> set[str]:
        """Of its name, or its file's where the columns say nothing; of a numbered thing its column's."""
        if self.csv.label and self.part.isdecimal():
            return set(words_in(self.csv.label)) | set(self.track.stem)
        if self.part:
            return set(_words(self.part))
        return set(self.track.stem) - {"data"} or set(self.path.stem.lower().replace("-", "_").split("_"))

    @property
    def name(self) -> str:
        """For sentences."""
        return f"{name_of_file(self.path)}: {self.run and f'{self.run}/'}{self.part or self.track.names}"

    @property
    def place(self) -> tuple[Path, str]:
        """File and part: tracks of one place share a source."""
        return self.path, self.run or self.part

    @property
    def motion(self) -> tuple[Path, str]:
        """File, and group of it, that hold one motion."""
        return self.path, self.run

    @property
    def position(self) -> np.ndarray:
        """(N, K) along its axes, as it stands in the log; NaN where nothing was seen."""
        return position_of(self.table, self.track)


@dataclass(frozen=True, eq=False)
class LoggedTable:
    """A table of a log, read once for every kind of draft."""

    path: Path
    table: Table
    part: str = ""
    header: tuple[str, str] = ("", "")
    csv: CsvOptions = CsvOptions()
    run: str = ""

    def tracks(self) -> list[LoggedTrack]:
        """Its poses and positions; of a topic the one that was seen most often."""
        return list(self._tracks)

    @cached_property
    def sensor(self) -> OtherSensor:
        """What it is of, if it tells no motion: a pose beside corners does."""
        kind = OtherSensor.NONE if self.part else find_sensor(self.path, self.table)
        posed = kind is OtherSensor.CORNERS and any(t.named and t.whole for t in find_positions(self.table))
        return OtherSensor.NONE if posed else kind

    @cached_property
    def _tracks(self) -> list[LoggedTrack]:
        # Once: zeros that a tracker wrote for lost frames are empty from then on, and would not be counted.
        if self.sensor is not OtherSensor.NONE:
            return []
        found = find_positions(self.table, plural=bool(self.run))
        moved = [track for track in found if not _counts_rows(self.table, track)]
        found = _without_commands(moved)
        if self.part:
            found = sorted(found, key=lambda each: -_count_seen(self.table, each))[:1]
        for track in found:
            empty_zeros(self.table, track)
        where = (self.part, self.header, self.csv)
        return [LoggedTrack(self.path, self.table, t, *where, run=self.run) for t in found]


def _count_seen(table: Table, track: FoundTrack) -> int:
    return int(np.isfinite(position_of(table, track)).all(axis=1).sum())


def _counts_rows(table: Table, track: FoundTrack) -> bool:
    """Whether an axis is a row's number: `X` beside `Y` of a trace that a drive's software exported."""
    return any(counts_rows(axis) for axis in position_of(table, track).T)


def _without_commands(tracks: list[FoundTrack]) -> list[FoundTrack]:
    """Without where an arm was sent: `target_TCP_pose` beside `actual_TCP_pose` is no tag that is seen."""
    measured = {_thing(t.stem) for t in tracks if _MEASURED & set(t.stem) and not _COMMANDED & set(t.stem)}
    return [t for t in tracks if not _COMMANDED & set(t.stem) or _thing(t.stem) not in measured]


def _thing(stem: Sequence[str]) -> frozenset[str]:
    """What a pose is of, wherever it comes from."""
    return frozenset(stem) - _COMMANDED - _MEASURED


def read_logged_tables(paths: Sequence[Path]) -> list[LoggedTable]:
    """Tables of files, of a bag's topics that are poses, or of what lies in folders; none of other logs.

    Files of a folder that cannot be read are passed over: what else lies there is no fault.

    Raises:
        InputError: a named file that cannot be read.
    """
    found: list[LoggedTable] = []
    views = find_views([file for given in paths for file in files_of(given)])
    single = {file for each in views for _, file in files_of_views(each)}
    for path in views:
        found += _tables_of(path)
    for given in paths:
        files = files_of(given)
        alone = files == [given] or not any(path.suffix.lower() in SUFFIXES for path in files)
        for path in files:
            try:
                found += [] if path in single else _tables_of(path, alone)
            except InputError:
                if path == given:
                    raise
    return found


def _tables_of(path: Path, alone: bool = False) -> list[LoggedTable]:
    """Of a file; `alone` takes text of any suffix, which beside logs of usual ones is something else."""
    if is_bag(path):
        return _topics(path)
    if is_of_views(path):
        return [LoggedTable(path, read_table(path, CsvOptions(), "the log", ""))]
    text = is_text_table(path) if alone else path.suffix.lower() in TEXT_SUFFIXES
    if not is_file(path) or not (text or path.suffix.lower() in SUFFIXES):
        return []
    options = text_options(path)
    table = read_table(path, options, "the log", "")
    whole = LoggedTable(path, table, header=_echoed_frames(path, table), csv=options)
    labelled = split_by_label(whole) if text else split_by_group(whole)
    return labelled or [whole]


def _echoed_frames(path: Path, table: Table) -> tuple[str, str]:
    """Child and parent frame of an echoed topic that names one of each; else empty."""
    parent, child = (set(table.columns.get(name, pd.Series(dtype=str))) for name in (FRAME, CHILD))
    if len(parent) != 1 or len(child) > 1:
        return "", ""
    return str(next(iter(child), path.stem)), str(next(iter(parent)))


def split_by_group(whole: LoggedTable) -> list[LoggedTable]:
    """Tables of the groups of an HDF5 file, where each holds one motion and its time; empty of any other.

    Groups of a machine hold more beside a position, and one motion's parts have columns of their own.
    """
    if whole.path.suffix.lower() not in HDF5_SUFFIXES:
        return []
    groups: dict[str, dict[str, np.ndarray | pd.Series]] = {}
    for name, values in whole.table.columns.items():
        group, _, own = name.rpartition(".")
        groups.setdefault(group, {})[own] = values
    if len(groups) < 2 or "" in groups or len({frozenset(columns) for columns in groups.values()}) > 1:
        return []
    tables = []
    for group, columns in groups.items():
        table = replace(whole.table, columns=columns)
        each = LoggedTable(whole.path, table, run=group.replace(".", "/"))
        used = {name for track in each.tracks() for name in track.track.used}
        if len(each.tracks()) != 1 or any(not is_time(name) for name in columns if name not in used):
            return []
        tables.append(each)
    return tables


def split_by_label(whole: LoggedTable) -> list[LoggedTable]:
    """Tables of one thing each, where a column of text says what a row is of; empty where none does.

    It does where every label has poses of its own and their times run side by side. Without times, rows that
    take turns (`hand`, `eye`, `hand`, ...) are as many of each.
    """
    for label, cells in whole.table.columns.items():
        if is_time(label) or not (isinstance(cells, pd.Series) or _numbers_things(label, cells)):
            continue
        labels = labels_in(cells)
        names = pd.Series(labels)
        count = names.value_counts()
        few = [str(name) for name in count.index if count[name] < LEAST]
        if few and isinstance(cells, np.ndarray):  # numbers that a detector mistook once or twice
            names, count = names[~names.isin(few)], count[count >= LEAST]
        if not (1 < len(count) <= MOST_LABELS and int(count.min()) >= LEAST and len(count) < len(names)):
            continue
        options = whole.csv.model_copy(update={"label": label})
        parts = [str(name) for name in dict.fromkeys(names)]
        tables = []
        for part in parts:
            rows = rows_of(whole.table.columns, part, label, f"the log: {whole.path.name}")
            table = replace(whole.table, columns=rows)
            tables.append(LoggedTable(whole.path, table, part, csv=options))
        posed = all(any(t.track.whole for t in each.tracks()) for each in tables)
        if posed and _side_by_side(whole.table, labels, parts):
            return tables
    return []


def _numbers_things(name: str, cells: np.ndarray | pd.Series) -> bool:
    """Whether a column of whole numbers says which tag, marker or body a row is of, as `tag_id`."""
    numbers = isinstance(cells, np.ndarray) and cells.ndim == 1 and bool((cells == np.round(cells)).all())
    return numbers and bool(set(words_in(name)) & NUMBERED)


def _side_by_side(table: Table, names: np.ndarray, parts: Sequence[str]) -> bool:
    """Whether labels are of things at one time, and not of one thing at several (phases of a motion)."""
    times = [name for name in table.columns if is_time(name)]
    time = numbers_of(table, times[0]) if times else None
    if time is None or time.ndim != 1:
        turns = np.array([names[k : k + len(parts)] for k in range(0, len(names) - len(parts), len(parts))])
        return len({int((names == part).sum()) for part in parts}) == 1 and bool((turns == turns[0]).all())
    spans = [(np.nanmin(time[names == part]), np.nanmax(time[names == part])) for part in parts]
    shared = min(end for _, end in spans) - max(begin for begin, _ in spans)
    switches = int((names[1:] != names[:-1]).sum())
    return bool(shared > SHARED * np.ptp(time)) and (
        bool((np.diff(time) <= 0).any()) or switches > SHARED * len(names)
    )


def files_of(path: Path) -> list[Path]:
    """What lies in a folder, or in folders of runs there that hold the same files, by name; else the path."""
    if not is_folder(path) or is_bag(path):
        return [path]
    inside = sorted(path.iterdir())
    if any(each.suffix.lower() in SUFFIXES for each in inside):
        return inside
    runs = [_logs_in(each) for each in inside if is_folder(each) and not is_bag(each)]
    names = {tuple(file.name for file in run) for run in runs}
    alike = len(runs) > 1 and len(names) == 1 and len(runs[0]) > 1
    return [file for run in runs for file in run] if alike else inside


def _logs_in(folder: Path) -> list[Path]:
    return sorted(each for each in folder.iterdir() if each.suffix.lower() in SUFFIXES)


def _topics(path: Path) -> list[LoggedTable]:
    """Topics of a bag that are poses of one thing."""
    out = []
    for topic in list_topics(path, "the log"):
        if topic.type in POSES | DETECTORS and topic.count >= LEAST:
            table = read_table(path, CsvOptions(), "the log", topic.name)
            child, parent = read_frames(path, topic.name, "the log")
            child = child or (path.stem if parent and not topic.name else "")  # of an echo its file says it
            out.append(LoggedTable(path, table, topic.name, (child, parent)))
    return out


def _words(name: str) -> frozenset[str]:
    return frozenset(re.findall(r"[a-z]+\d*", name.lower()))
