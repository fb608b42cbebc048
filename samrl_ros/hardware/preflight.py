"""Whether drivers speak as the cell expects, checked on observed messages before anything may move.

Pure functions: no ROS, no clock. Each returns what speaks against moving, empty when nothing does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.robot import CellSpec, RobotSpec
from samrl_core.cell.types.camera import Intrinsics
from samrl_ros.hardware.driver_file import DriverFile, Stream

LEAST_SAMPLES = 5
MAX_OFFSET_S = 0.05  # median age of stamps at reception; commands are stamped 40 ms ahead
MAX_IMAGE_AGE_S = 0.25  # of images, which take time to be aligned and labelled; the arms rest meanwhile
MAX_REST_SPEED = 0.02  # [rad/s]: an arm that moves before the cell commands it
MAX_PAIR_S = 0.005  # between the stamps of colour and depth


@dataclass(frozen=True)
class JointSample:
    """A JointState as it was received."""

    received_s: float  # by this computer's clock [s]
    stamp_s: float
    names: tuple[str, ...]
    position: tuple[float, ...]  # [rad]
    velocity: tuple[float, ...]  # [rad/s]
    effort: tuple[float, ...]  # [N m]


@dataclass(frozen=True)
class ImageSample:
    """An Image or CameraInfo as it was received; a CameraInfo has no encoding."""

    received_s: float
    stamp_s: float
    frame: str
    width: int
    height: int
    encoding: str = ""
    k: tuple[float, ...] = ()  # of a CameraInfo, row by row [pixel]
    d: tuple[float, ...] = ()  # of a CameraInfo: distortion


def arm_faults(driver: DriverFile, spec: RobotSpec, samples: Sequence[JointSample]) -> list[str]:
    """Names, sizes, finite numbers, limits, rest, rate and clock of one arm's joint states."""
    stream = driver.streams["joint_states"]
    faults = _timing_faults(stream, [(s.received_s, s.stamp_s) for s in samples])
    if len(samples) < LEAST_SAMPLES:
        return faults
    joints = driver.joints or {}
    if len(joints) != len(spec.joint_names):
        return [*faults, f"the driver's file has {len(joints)} joints, {spec.name} {len(spec.joint_names)}"]
    for sample in samples:
        wrong = _wrong_sample(stream.driver_topic, joints, sample)
        if wrong:
            return [*faults, wrong]
    position, velocity = (
        np.array([reordered(joints, sample.names, getattr(sample, field)) for sample in samples])
        for field in ("position", "velocity")
    )
    for k, name in enumerate(spec.joint_names):
        low, high = float(spec.limits.lower[k]), float(spec.limits.upper[k])
        worst = position[np.argmax(np.abs(position[:, k] - 0.5 * (low + high))), k]
        if not low <= worst <= high:
            faults.append(
                f"{name} is at {worst:.3f} rad, outside {low:.3f} .. {high:.3f}: check the order and units "
                "of the joints, and that this is the arm that the cell describes"
            )
        speed = float(np.abs(velocity[:, k]).max())
        if speed > MAX_REST_SPEED:
            faults.append(f"{name} moves at {speed:.3f} rad/s before any command; let the arm come to rest")
    return faults


def _wrong_sample(topic: str, joints: Mapping[str, int], sample: JointSample) -> str:
    """Why a sample cannot be read, empty if it can."""
    if not set(joints) <= set(sample.names) or len(set(sample.names)) < len(sample.names):
        return f"{topic} has joints {list(sample.names)}, the driver's file {list(joints)}; correct `joints`"
    for field in ("position", "velocity", "effort"):
        values = getattr(sample, field)
        if len(values) != len(sample.names):
            return (
                f"{topic} has {len(values)} values of {field} for {len(sample.names)} joints; the cell needs"
                " them"
            )
        if not np.isfinite(reordered(joints, sample.names, values)).all():
            return f"{topic} has a {field} that is not finite; check the driver"
    return ""


def is_of(joints: Mapping[str, int], names: Sequence[str]) -> bool:
    """Whether a joint state is of an arm; grippers and other arms may publish on the same topic."""
    return any(name in joints for name in names)


def reordered(joints: Mapping[str, int], names: Sequence[str], values: Sequence[float]) -> list[float]:
    """Values in the order of our joints, from the driver's; those of other joints are left out."""
    by_number = {joints[name]: value for name, value in zip(names, values, strict=True) if name in joints}
    return [by_number[number] for number in sorted(by_number)]


def camera_faults(
    driver: DriverFile, intrinsics: Intrinsics, samples: Mapping[str, Sequence[ImageSample]]
) -> list[str]:
    """Rate, clock, frame, encoding and size of images, and that they belong together.

    Args:
        driver: of a camera, or of a segmenter.
        intrinsics: that the cell's networks and model are for.
        samples: by stream: `color`, `depth`, `info`, `mask`.
    """
    faults = []
    for name, stream in driver.streams.items():
        observed = samples.get(name, ())
        faults += _timing_faults(stream, [(s.received_s, s.stamp_s) for s in observed], MAX_IMAGE_AGE_S)
        frames = {s.frame for s in observed}
        if stream.frame is not None and frames - {stream.frame}:
            faults.append(f"{stream.driver_topic} is in frame {sorted(frames)}, expected {stream.frame}")
        encodings = {s.encoding for s in observed} - set(stream.encodings or ())
        if stream.encodings and encodings:
            faults.append(f"{stream.driver_topic} is {sorted(encodings)}, expected {stream.encodings}")
    sizes = {(s.width, s.height) for observed in samples.values() for s in observed}
    if len(sizes) > 1:
        names = ", ".join(samples)
        faults.append(f"{names} differ in size: {sorted(sizes)}; align depth to colour, label that image")
    for info in samples.get("info", ())[:1] if driver.kind == "camera" else ():
        faults += _lens_faults(info, intrinsics)
    other = "depth" if driver.kind == "camera" else "mask"
    stamps = [np.array([s.stamp_s for s in samples.get(name, ())]) for name in ("color", other)]
    if all(len(each) >= LEAST_SAMPLES for each in stamps):
        apart = float(np.median(np.abs(stamps[0][:, None] - stamps[1][None, :]).min(axis=0)))
        if apart > MAX_PAIR_S:
            faults.append(
                f"color and {other} are {1e3 * apart:.1f} ms apart, limit {1e3 * MAX_PAIR_S:.0f} ms; turn on "
                "the driver's synchronisation"
            )
    return faults


def _lens_faults(info: ImageSample, intrinsics: Intrinsics) -> list[str]:
    """The image is cut and scaled to the cell's: it has to hold all that the cell's camera sees."""
    if len(info.k) != 9 or not np.isfinite(info.k).all() or info.k[0] <= 0.0 or info.k[4] <= 0.0:
        return [f"camera info has K {list(info.k)}, no camera matrix; calibrate the camera"]
    if any(info.d):
        return [f"camera info has distortion {list(info.d)}; have the driver or image_proc rectify"]
    if min(info.width, info.height) < 1:
        return [f"images are {info.width}x{info.height}; check the driver"]
    lens = Intrinsics.from_ros_k(info.width, info.height, info.k)
    u, v = corners_seen(lens, intrinsics)
    beyond = max(-u.min(), u.max() - info.width, -v.min(), v.max() - info.height)
    if beyond > 0.01 * info.width:
        return [
            f"the camera sees less than the cell's: {info.width}x{info.height} pixels with focal length "
            f"{info.k[0]:.1f} miss {beyond:.0f} pixels at an edge; choose a wider profile of the driver, or "
            "describe this camera in the cell, and train networks for it"
        ]
    return []


def corners_seen(lens: Intrinsics, intrinsics: Intrinsics) -> tuple[np.ndarray, np.ndarray]:
    """Edges of the cell's image in a lens's: left and right u (2,), upper and lower v (2,) [px]."""
    u = (np.array([0.0, intrinsics.width]) - intrinsics.cx) * lens.fx / intrinsics.fx + lens.cx
    v = (np.array([0.0, intrinsics.height]) - intrinsics.cy) * lens.fy / intrinsics.fy + lens.cy
    return u, v


def _timing_faults(
    stream: Stream, times: Sequence[tuple[float, float]], oldest_s: float = MAX_OFFSET_S
) -> list[str]:
    """Rate and clock of a topic, from pairs of reception and stamp [s]; stamps may be `oldest_s` old."""
    topic = stream.driver_topic
    if len(times) < LEAST_SAMPLES:
        return [f"{topic}: {len(times)} messages heard, needed {LEAST_SAMPLES}; check that its driver runs"]
    received, stamps = np.array(times).T
    faults = []
    if not (np.diff(stamps) > 0.0).all():
        faults.append(f"{topic} has stamps that repeat or go back; more than one publisher?")
    period = (stamps[-1] - stamps[0]) / (len(stamps) - 1)
    if period <= 0.0 or 1.0 / period < stream.least_rate_hz:
        rate = 1.0 / period if period > 0.0 else 0.0
        faults.append(f"{topic} comes at {rate:.1f} Hz, needed {stream.least_rate_hz:.0f} Hz")
    offset = float(np.median(received - stamps))
    if not -MAX_OFFSET_S <= offset <= oldest_s:
        faults.append(
            f"{topic} is stamped {abs(offset):.3f} s {'before' if offset > 0 else 'after'} its reception, "
            f"limit {oldest_s if offset > 0 else MAX_OFFSET_S} s; synchronise the clocks "
            "(chrony, ptp4l), or set use_sim_time alike everywhere"
        )
    return faults


def cell_faults(
    cell: CellSpec,
    drivers: Mapping[str, DriverFile],
    arms: Mapping[str, Sequence[JointSample]],
    images: Mapping[str, Sequence[ImageSample]],
) -> list[str]:
    """All faults of a cell; `drivers` to be checked, by `tool_arm`, `camera_arm` and `camera`."""
    faults = []
    for part, driver in drivers.items():
        found = (
            camera_faults(driver, cell.intrinsics, images)
            if driver.kind != "arm"
            else arm_faults(driver, cell.arm(part), arms.get(part, ()))
        )
        faults += [f"{part}: {fault}" for fault in found]
    return faults


def clock_offsets(
    arms: Mapping[str, Sequence[JointSample]], images: Mapping[str, Sequence[ImageSample]]
) -> dict[str, float]:
    """Median age of stamps at reception [s] by arm and stream: delay less the lead of its clock."""
    return {
        name: float(np.median([s.received_s - s.stamp_s for s in samples]))
        for name, samples in [*arms.items(), *images.items()]
        if samples
    }
