"""What a driver package publishes: topics, types, rates, frames, encodings and joint names, from a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, Self

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_yaml, read_text
from samrl_core.common.validation import Checked

FOLDER = Path(__file__).resolve().parents[1] / "config" / "drivers"
MAX_BYTES = 2**20
STREAMS = {"arm": {"joint_states"}, "camera": {"color", "depth", "info"}, "segmenter": {"mask"}}
PARTS = {"tool_arm": "arm", "camera_arm": "arm", "camera": "camera", "segmenter": "segmenter"}  # their kinds


class Stream(Checked):
    """One topic of a driver."""

    driver_topic: str
    type: str
    reliability: Literal["reliable", "best_effort"]
    rate_hz: float  # as the package publishes it
    least_rate_hz: float  # that the cell can do with
    frame: str | None = None
    encodings: list[str] | None = None


class CommandTopic(Checked):
    """What an arm's controller listens to."""

    driver_topic: str
    type: Literal["trajectory_msgs/msg/JointTrajectory"]


class DriverFile(Checked):
    """A driver: an arm with `joint_states`, a camera (`color`, `depth`, `info`), a segmenter (`mask`)."""

    package: str
    sources: list[str]
    kind: Literal["arm", "camera", "segmenter"]
    part: Literal["tool_arm", "camera_arm", "camera", "segmenter"] | None = None  # unless told otherwise
    streams: dict[str, Stream]
    command: CommandTopic | None = None  # of an arm; without it the arm can only be observed
    joints: dict[str, int] | None = None  # the driver's name: number of our joint, from 1

    @classmethod
    def from_file(cls, path: Path) -> Self:
        """Read one. Raises InputError for what cannot be read or does not fit."""
        try:
            data = parse_yaml(read_text(path, "the driver", MAX_BYTES), str(path))
        except InputError as error:
            raise InputError(f"{error}; see samrl_ros/config/drivers") from error
        found = cls.read(data, f"{path}:")
        wanted = STREAMS[found.kind]
        if set(found.streams) != wanted:
            raise InputError(f"{path}: streams are {sorted(found.streams)}, must be {sorted(wanted)}")
        joints = sorted((found.joints or {}).values())
        if found.kind == "arm" and (not joints or joints != list(range(1, len(joints) + 1))):
            raise InputError(f"{path}: joints are numbered {joints}, must be 1, 2, ... without a gap")
        for name, stream in found.streams.items():
            if not 0.0 < stream.least_rate_hz <= stream.rate_hz:
                raise InputError(
                    f"{path}: streams.{name}.least_rate_hz is {stream.least_rate_hz}, must be above 0 and "
                    f"at most rate_hz, {stream.rate_hz}"
                )
        return found


def driver_named(name: str) -> DriverFile:
    """A driver of the package's own files, or a file by its path.

    Raises:
        InputError: neither.
    """
    own = FOLDER / f"{name}.yaml"
    known = sorted(path.stem for path in FOLDER.glob("*.yaml"))
    if name in known:
        return DriverFile.from_file(own)
    if not name.endswith((".yaml", ".yml")):
        raise InputError(f"no driver is named {name!r}; there are {', '.join(known)}, or give a YAML file")
    return DriverFile.from_file(Path(name))


def drivers_by_part(named: Sequence[str]) -> dict[str, DriverFile]:
    """Drivers by the part of the cell that they drive.

    Args:
        named: `DRIVER` or `PART=DRIVER`; a driver by its name or a YAML file. Without a part, the file's own.

    Raises:
        InputError: no such driver or part, a part twice, or a driver of another kind.
    """
    found: dict[str, DriverFile] = {}
    for text in named:
        before, equals, after = text.partition("=")
        driver = driver_named(after if equals else before)
        part = before if equals else driver.part
        if part is None:
            raise InputError(f"{text} says no part; write PART={text} with one of {', '.join(PARTS)}")
        if part not in PARTS:
            raise InputError(f"{part!r} in {text} is no part of the cell; there are {', '.join(PARTS)}")
        if part in found:
            raise InputError(f"{part} has two drivers, {found[part].package} and {driver.package}; give one")
        if driver.kind != PARTS[part]:
            raise InputError(
                f"{driver.package} drives a {driver.kind}; {part} needs one of kind {PARTS[part]}"
            )
        found[part] = driver
    return found
