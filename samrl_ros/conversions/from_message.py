"""Messages to core types, by attribute: live messages and recorded ones both do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_json

# Names in sensor_msgs/distortion_models.hpp whose coefficients count from a pinhole; drivers may leave it
# empty.
UNDISTORTED = ("", "plumb_bob", "rational_polynomial")


def stamp_ns(message: Any) -> int:
    """Header stamp [ns]."""
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def arm_reading(message: Any, joint_names: tuple[str, ...]) -> ArmReading:
    """JointState to a reading in the order of `joint_names`.

    Raises:
        InputError: names missing or unknown, sizes that do not fit, or a value that is not finite.
    """
    names = list(message.name)
    order = _order(names, joint_names)
    columns = []
    for field in ("position", "velocity", "effort"):
        values = np.asarray(getattr(message, field), dtype=np.float64)
        if values.shape != (len(names),):
            raise InputError(f"joint state has {values.size} values of {field} for {len(names)} names")
        if not np.isfinite(values).all():
            bad = names[int(np.flatnonzero(~np.isfinite(values))[0])]
            raise InputError(f"joint state: {field} of {bad} is not finite; check the driver")
        columns.append(values[order])
    return ArmReading(stamp_ns(message), *columns)


def _order(names: list[str], joint_names: tuple[str, ...]) -> list[int]:
    if sorted(names) != sorted(joint_names):
        raise InputError(f"joint names {names} are not {list(joint_names)}; check who publishes here")
    return [names.index(n) for n in joint_names]


def arm_command(message: Any, joint_names: tuple[str, ...]) -> ArmCommand:
    """One-point JointTrajectory on `<arm>/command` to a command; limits are the guard's business.

    Raises:
        InputError: not exactly one point, wrong names, or wrong sizes.
    """
    if len(message.points) != 1:
        raise InputError(f"command has {len(message.points)} points, not one; use joint_trajectory for more")
    order = _order(list(message.joint_names), joint_names)
    point = message.points[0]
    columns = []
    for field in ("positions", "velocities", "accelerations", "effort"):
        values = np.asarray(getattr(point, field), dtype=np.float64)
        if values.size == 0 and field != "positions":
            values = np.zeros(len(order))
        if values.shape != (len(order),):
            raise InputError(f"command has {values.size} {field} for {len(order)} joints")
        columns.append(values[order])
    return ArmCommand(stamp_ns(message), *columns)


def image(message: Any) -> np.ndarray:
    """An rgb8, mono8, 32FC1 [m] or 16UC1 [mm] Image to an array; depth becomes float32 metres, NaN invalid.

    Raises:
        InputError: empty, an encoding that is not listed, or data that do not fill the image.
    """
    formats = {
        "rgb8": (np.uint8, 3),
        "mono8": (np.uint8, 1),
        "32FC1": (np.float32, 1),
        "16UC1": (np.uint16, 1),
    }
    if message.encoding not in formats:
        raise InputError(f"image encoding {message.encoding!r} is not one of {sorted(formats)}")
    dtype, channels = formats[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    if height == 0 or width == 0:
        raise InputError(f"image is {width}x{height}: empty; check that the camera streams")
    row = width * channels * np.dtype(dtype).itemsize
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    if step < row or data.size != step * height:
        raise InputError(f"image {width}x{height} {message.encoding} has {data.size} bytes and step {step}")
    if message.is_bigendian and np.dtype(dtype).itemsize > 1:
        raise InputError("image is big endian; publish little endian")
    pixels = np.ascontiguousarray(data.reshape(height, step)[:, :row]).view(dtype)
    if message.encoding == "16UC1":
        metres = pixels.astype(np.float32) / 1000.0
        metres[pixels == 0] = np.nan
        return metres
    return pixels.reshape(height, width, 3) if channels == 3 else pixels.reshape(height, width)


def intrinsics(message: Any) -> Intrinsics:
    """CameraInfo to intrinsics.

    With coefficients of zero the models of `UNDISTORTED` are a pinhole; `equidistant` is a fisheye even then.

    Raises:
        InputError: images that are distorted, cut out or made smaller, or that no pinhole takes.
    """
    if any(float(d) != 0.0 for d in message.d):  # NaN is not 0 either
        raise InputError(f"camera_info has distortion {list(message.d)}; publish rectified images")
    if message.distortion_model not in UNDISTORTED:
        raise InputError(
            f"camera_info has the distortion model {message.distortion_model!r}, must be one of "
            f"{', '.join(map(repr, UNDISTORTED))}; publish rectified images"
        )
    if max(message.binning_x, message.binning_y) > 1 or message.roi.x_offset or message.roi.y_offset:
        raise InputError(
            f"camera_info has binning {message.binning_x}x{message.binning_y} and a region of interest at "
            f"({message.roi.x_offset}, {message.roi.y_offset}); publish whole images, not binned"
        )
    k = tuple(float(v) for v in message.k)
    if len(k) == 9 and (k[1], k[3], *k[6:]) != (0.0, 0.0, 0.0, 0.0, 1.0):
        raise InputError(f"camera_info K is {k}: skewed, or no camera matrix; publish rectified images")
    return Intrinsics.from_ros_k(int(message.width), int(message.height), k)


def points(message: Any, names: tuple[str, ...]) -> np.ndarray:
    """Fields of a sensor_msgs/PointCloud2 as columns (N, F) float32.

    Raises:
        InputError: a field is missing or not float32, or the data do not fill the points.
    """
    fields = {field.name: field for field in message.fields}
    wrong = [
        name for name in names if name not in fields or (fields[name].datatype, fields[name].count) != (7, 1)
    ]
    if wrong or message.is_bigendian:
        raise InputError(f"cloud lacks {wrong} as float32, little endian; it has {sorted(fields)}")
    count, step = int(message.width) * int(message.height), int(message.point_step)
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    offsets = [int(fields[name].offset) for name in names]
    if data.size != count * step or any(offset + 4 > step for offset in offsets):
        raise InputError(f"cloud of {count} points of {step} bytes has {data.size} bytes")
    rows = data.reshape(count, step)
    return np.column_stack([np.ascontiguousarray(rows[:, o : o + 4]).view("<f4") for o in offsets])


def pose(message: Any) -> Pose:
    """geometry_msgs/Pose."""
    p, q = message.position, message.orientation
    return Pose(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def vector(message: Any) -> np.ndarray:
    """geometry_msgs/Vector3 to (3,)."""
    return np.array([message.x, message.y, message.z], dtype=np.float64)


def model_values(message: Any, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """ModelState to values (P,) and covariance (P, P), in its units.

    Raises:
        InputError: other parameters than `names`, sizes that do not fit, or a value that is not finite.
    """
    if tuple(message.names) != names:
        raise InputError(
            f"model state holds {list(message.names)}, not {list(names)}; check that all nodes run one task"
        )
    values = np.array(message.values, dtype=np.float64)
    covariance = np.array(message.covariance, dtype=np.float64)
    if values.size != len(names) or covariance.size != len(names) ** 2:
        raise InputError(
            f"model state has {values.size} values and {covariance.size} covariances for {len(names)} names"
        )
    if not (np.isfinite(values).all() and np.isfinite(covariance).all()):
        raise InputError(f"model state is not finite: values {values}; check the model_updater's log")
    return values, covariance.reshape(len(names), len(names))


def calibration(text: str) -> dict[str, Pose]:
    """`/cell/camera/calibration` to `camera_in_flange`, `tool_arm` and `camera_arm` base in world.

    Raises:
        InputError: not JSON, a key missing, or no pose under it.
    """
    data = parse_json(text, "the calibration")
    try:
        return {
            "camera_in_flange": _pose(data["camera_in_flange"]),
            "tool_arm": _pose(data["base_in_world"]["tool_arm"]),
            "camera_arm": _pose(data["base_in_world"]["camera_arm"]),
        }
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise InputError(
            f"cannot read the calibration ({error!r}); see msgs_docs/reference/topics.md"
        ) from error


@dataclass(frozen=True)
class AnnouncedWeights:
    """Residual that `residual_trainer/weights` announces; version 0 is the zero residual and has no file."""

    task: str
    version: int
    file: Path
    sha256: str  # of the file, hexadecimal
    steps: int = 0  # in the trainer's replay at that time; 0 in bags without it


def announced_weights(text: str) -> AnnouncedWeights:
    """`/cell/residual_trainer/weights` as data.

    Raises:
        InputError: not JSON, a key missing or of another type, or a version without a file.
    """
    data = parse_json(text, "the weights' announcement")
    try:
        found = AnnouncedWeights(
            data["task"], data["version"], Path(data["file"]), data["sha256"], data.get("steps", 0)
        )
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"cannot read the weights' announcement ({error!r}); see msgs_docs/reference/topics.md"
        ) from error
    texts = (found.task, found.sha256)
    numbers = (found.version, found.steps)
    right = all(type(n) is int and n >= 0 for n in numbers) and all(isinstance(t, str) for t in texts)
    if not right:
        raise InputError(f"weights are announced as {data}; see msgs_docs/reference/topics.md")
    if found.version > 0 and not (found.file.is_absolute() and found.sha256):
        raise InputError(f"weights version {found.version} needs an absolute file and its sha256, has {data}")
    return found


@dataclass(frozen=True)
class OperatorQuestion:
    """What `operator/request` asks of a person."""

    asks: str  # scene, judgement or nothing
    episode: int
    text: str


def operator_question(text: str) -> OperatorQuestion:
    """`/cell/operator/request` as data.

    Raises:
        InputError: not JSON, a key missing or of another type, or a question that nobody knows.
    """
    data = parse_json(text, "the operator's request")
    try:
        found = OperatorQuestion(data["asks"], data["episode"], data["text"])
    except (KeyError, TypeError) as error:
        raise InputError(
            f"cannot read the operator's request ({error!r}); see msgs_docs/reference/topics.md"
        ) from error
    right = found.asks in ("scene", "judgement", "nothing") and isinstance(found.text, str)
    if not right or type(found.episode) is not int:
        raise InputError(f"the operator is asked {data}; see msgs_docs/reference/topics.md")
    return found


def operator_judgement(text: str) -> tuple[int, bool]:
    """`/cell/operator/judgement`: an episode, and whether it succeeded.

    Raises:
        InputError: not JSON, a key missing or of another type.
    """
    data = parse_json(text, "the operator's judgement")
    try:
        episode, success = data["episode"], data["success"]
    except (KeyError, TypeError) as error:
        raise InputError(
            f"cannot read the operator's judgement ({error!r}); see msgs_docs/reference/topics.md"
        ) from error
    if type(episode) is not int or not isinstance(success, bool):
        raise InputError(f"the operator judges {data}; see msgs_docs/reference/topics.md")
    return episode, success


def _pose(data: dict[str, list[float]]) -> Pose:
    return Pose(np.array(data["position"]), np.array(data["quat_xyzw"]))
