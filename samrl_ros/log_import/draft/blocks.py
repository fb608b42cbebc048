"""The numbers of a log as blocks: a column per joint, of one table, at its times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.column_names import is_time, split_names
from samrl_ros.log_import.draft.evidence import runs_on, time_unit
from samrl_ros.log_import.draft.joints.arm_messages import ARM_MESSAGES, labels_of_array
from samrl_ros.log_import.draft.joints.runs_beside import first_of, recordings_beside
from samrl_ros.log_import.draft.letter_names import torques_by_letter
from samrl_ros.log_import.draft.text_layout import text_options
from samrl_ros.log_import.formats.hdf5 import SUFFIXES as HDF5
from samrl_ros.log_import.formats.hdf5 import demonstrations
from samrl_ros.log_import.formats.parquet import is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics
from samrl_ros.log_import.formats.transform_tree import KINDS, describe_tree
from samrl_ros.log_import.joint_rows import find_joint_column, join_samples
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table

ROS_TYPES = {
    "sensor_msgs/msg/JointState": "states of joints",
    "control_msgs/msg/JointTrajectoryControllerState": "a controller's set point and feedback",
    "control_msgs/msg/DynamicJointState": "states of joints, by interface",
    "control_msgs/msg/JointControllerState": "one joint's set point and feedback",
    "control_msgs/msg/MultiDOFStateStamped": "a controller's set point and feedback",
    "std_msgs/msg/Float64MultiArray": "commands of a forward controller",
    **{kind: message.about for kind, message in ARM_MESSAGES.items()},
}
# Packages whose messages are known and are no joints of a machine; those of a laboratory's own may be.
_KNOWN_PACKAGES = frozenset(
    "action_msgs actionlib_msgs bond builtin_interfaces control_msgs diagnostic_msgs dynamic_reconfigure"
    " geometry_msgs lifecycle_msgs map_msgs moveit_msgs nav_msgs pcl_msgs rcl_interfaces roscpp rosgraph_msgs"
    " sensor_msgs shape_msgs statistics_msgs std_msgs std_srvs stereo_msgs tf tf2_msgs theora_image_transport"
    " trajectory_msgs type_description_interfaces unique_identifier_msgs vision_msgs"
    " visualization_msgs".split()
)
LEAST_ROWS = 50  # rows of a table that is looked at
_ACROSS = 4  # numbers of a row for each row, beyond which the rows are signals
_STAMPS = ("log_time", "header.stamp", "header.seq")  # of a bag's messages; their table has a time


@dataclass(frozen=True, eq=False)
class LogBlock:
    """Columns that differ in the joint alone."""

    part: str  # of the log: topic, episode, group
    stem: str  # name with {} for the joint, or the name of an array
    labels: tuple[str, ...]  # of the joints: names, numbers, or one empty
    columns: tuple[str, ...]  # one per label, or one that holds all
    values: np.ndarray  # (N, J), rows with NaN left out
    rows: np.ndarray  # (M,) bool, which rows of the table these are
    transposed: bool = False  # whether the one column has a row per joint, as MATLAB's users store signals
    first: int = 0  # column of the one array at which the block begins

    def ordered(self, labels: Sequence[str]) -> np.ndarray:
        """Values of these labels, in their order (N, len(labels))."""
        return self.values[:, [self.labels.index(label) for label in labels]]


@dataclass(frozen=True, eq=False)
class LogPart:
    """A table of a log."""

    path: Path
    part: str
    kind: str  # message type of ROS_TYPES, or empty
    table: Table
    blocks: tuple[LogBlock, ...]
    times: tuple[str, ...]  # columns of numbers that are named as time, those that run on first
    dates: tuple[str, ...]  # columns of text that may be time
    csv: CsvOptions = CsvOptions()  # how the file is written
    joint_column: str = ""  # that says which joint a row of the file is of
    # Of several recordings beside each other, of which the table holds the first: columns by quantity.
    beside: dict[str, dict[str, str]] = field(default_factory=dict)

    @property
    def ros(self) -> bool:
        """Whether it is a topic of a message whose units and stamps are known."""
        return bool(self.kind)


def read_parts(path: Path, joints: Sequence[str]) -> list[LogPart]:
    """Every table of a log that may hold joints.

    Args:
        path: of the log.
        joints: of the robot's description, if there is one.

    Raises:
        InputError: the log cannot be read, or holds no table of numbers.
    """
    if is_bag(path):
        topics = list_topics(path, "the log")
        long = [t for t in topics if t.count >= LEAST_ROWS]
        parts = [(t.name, t.type) for t in long if t.type in ROS_TYPES] or [
            (t.name, "") for t in long if t.type.partition("/")[0] not in _KNOWN_PACKAGES
        ]
        if not parts:
            if not any(t.count for t in topics):
                raise InputError(f"{path} holds no message; name another bag, or record anew")
            present = ", ".join(f"{t.name} ({t.type})" for t in topics) or "none"
            trees = describe_tree(path) if any(t.type in KINDS for t in topics) else ""
            raise InputError(
                f"{path} has no topic of {', '.join(sorted(ROS_TYPES))}, or of messages of its own, with"
                f" {LEAST_ROWS} messages; topics are {present}{trees}"
            )
    elif is_lerobot(path):
        parts = [("0", "")]
    else:
        parts = [(part, "") for part in _parts(path)]
    found = [_part(path, part, kind, joints) for part, kind in parts]
    useful = [each for each in found if each.blocks]
    if not useful:
        raise InputError(f"{path} {_nothing_found(found)}")
    return useful


def _nothing_found(parts: Sequence[LogPart]) -> str:
    """Why tables hold neither joints nor anything else, and what to do about it."""
    names = sorted({name for each in parts for name in each.table.columns})
    for each in parts:
        if told := _rows_of_signals(each.table):
            return told
    rows = max((len(each.table.columns[name]) for each in parts for name in each.table.columns), default=0)
    unnamed = bool(names) and all(name.isdecimal() for name in names)
    if unnamed and rows < LEAST_ROWS and len(names) > _ACROSS * rows:
        return (
            f"holds {rows} rows of {len(names)} numbers: a signal in each row, as it seems. Turn it over, so"
            " that each row is a moment (numpy.savetxt('turned.txt', numpy.loadtxt(...).T)), and name its"
            f" {rows} columns in a first line, such as time,q1,q2,tau1,tau2"
        )
    why = f"no columns of numbers with {LEAST_ROWS} rows" if rows >= LEAST_ROWS else (
        f"{rows} rows: joints need {LEAST_ROWS}, and neither two poses (a target's and a flange's), nor a"
        " body's track, nor readings beside a reference were found"
    )  # fmt: skip
    advice = "; name its columns in a first line, such as time,x,y,z" if unnamed else ""
    return f"holds {why}; its columns are {names[:40]}{advice}"


def _rows_of_signals(table: Table) -> str:
    """What to write for a matrix with a signal in each row, the first of them the time; else empty."""
    for name in table.columns:
        values = numbers_of(table, name)
        if values is None or values.ndim != 2 or len(values) >= LEAST_ROWS or values.shape[1] < LEAST_ROWS:
            continue
        steps = np.diff(values[0])
        if (steps > 0).all() and time_unit(steps):
            return (
                f"holds {name!r}, {len(values)} signals of {values.shape[1]} samples in a row each, the first"
                " of them the time, as Simulink's To File stores them, and no names. Say in a mapping which"
                f" is which: columns: {{x: {{column: {name}, transpose: true}}}}, time: {{column:"
                f" '{name}[0]'}}, and formulas such as x[1]"
            )
    return ""


def _parts(path: Path) -> list[str]:
    """Groups of an HDF5 file, of robomimic's kind the first demonstration; else the file as one."""
    return (demonstrations(path)[:1] if path.suffix.lower() in HDF5 else []) or [""]


def _part(path: Path, part: str, kind: str, joints: Sequence[str]) -> LogPart:
    options = text_options(path)
    table = read_table(path, options, "the log", part)
    joint_column = "" if kind else find_joint_column(table, joints)
    if joint_column:
        table = join_samples(table, joint_column, "the log")
    if beside := {} if kind else recordings_beside(table):
        table = first_of(table, beside)
    arrays = {name: values for name in table.columns if (values := numbers_of(table, name)) is not None}
    long = {name: values for name, values in arrays.items() if len(values) >= LEAST_ROWS}
    flat = [name for name, values in long.items() if values.ndim == 1 and not _counts(name, values)]
    named = [
        name for name in flat if (is_time(name) or _is_time_of_series(name, long)) and name not in _STAMPS
    ]
    torques = torques_by_letter(named, long)
    named = [name for name in named if name not in torques]
    times = tuple(sorted(named, key=lambda name: -runs_on(long[name])))
    dates = tuple(name for name in table.columns if name not in arrays and is_time(name))
    blocks = []
    for stem, members in split_names([name for name in flat if name not in times], joints).items():
        columns = [long[name] for _, name in members]
        if stem not in _STAMPS and not _is_index(stem) and len({len(column) for column in columns}) == 1:
            labels = tuple(label for label, _ in members)
            names = tuple(name for _, name in members)
            blocks.append(_block(part, stem, labels, names, np.column_stack(columns)))
    for name, values in long.items():
        labelled = any(other.startswith(f"{name}.") for other in flat)
        if values.ndim == 2 and not labelled:
            count = values.shape[1]
            known = kind in ARM_MESSAGES
            labels = labels_of_array(count, joints) if known else tuple(str(k) for k in range(count))
            blocks.append(_block(part, name, labels, (name,), values))
    lengths = {len(long[name]) for name in times}
    for name, values in arrays.items():
        if values.ndim == 2 and len(values) < LEAST_ROWS and values.shape[1] in lengths:
            labels = tuple(str(k) for k in range(len(values)))
            blocks.append(replace(_block(part, name, labels, (name,), values.T), transposed=True))
    useful = tuple(block for block in blocks if len(block.values) >= LEAST_ROWS)
    return LogPart(path, part, kind, table, useful, times, dates, options, joint_column, beside)


def _block(
    part: str, stem: str, labels: tuple[str, ...], columns: tuple[str, ...], values: np.ndarray
) -> LogBlock:
    rows = np.asarray(np.isfinite(values).all(axis=1))
    return LogBlock(part, stem, labels, columns, values[rows], rows)


def _counts(name: str, values: np.ndarray) -> bool:
    """Whether a column that is not called a time is the number of its row."""
    return not is_time(name) and counts_rows(values)


def counts_rows(values: np.ndarray) -> bool:
    """Whether numbers are whole and one more from row to row; stamps of a second each are not whole."""
    return bool((np.diff(values) == 1.0).all() and values[0] == np.round(values[0]))


def _is_time_of_series(name: str, columns: Iterable[str]) -> bool:
    """Whether a name is the time of what is beside it: `log.position.Time` of `log.position.Data`."""
    series, _, own = name.rpartition(".")
    beside = (other.rpartition(".")[0] for other in columns if other != name)
    return bool(series) and is_time(own) and series in beside


def _is_index(stem: str) -> bool:
    """Counters that tools write beside the signals."""
    return stem.rpartition(".")[2] in ("index", "frame_index", "episode_index", "task_index", "seq", "step")


def numbers_of(table: Table, name: str) -> np.ndarray | None:
    """A column as numbers; None where its cells are text."""
    cells = table.columns[name]
    if isinstance(cells, pd.Series):
        try:
            return table.numbers(name, "the log")
        except InputError:
            return None
    return cells
