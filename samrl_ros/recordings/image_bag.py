"""Bags of a cell's camera to recordings of images: colour, depth, mask, both arms' joints and calibration."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.types.image_recording import ImageRecording, ImageTolerances
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.images.images import split_images
from samrl_ros.bags.reader import Bag, BagDecoder, RawMessage, open_bag
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.conversions import from_message
from samrl_ros.recordings.arrays_by_role import check_unseen, read_stated

COLOR, DEPTH = "/cell/camera/color/image_raw", "/cell/camera/depth/image_rect_raw"
INFO, MASK = "/cell/camera/color/camera_info", "/cell/camera/mask/image_raw"
CALIBRATION = "/cell/camera/calibration"
STATES = {role: f"/cell/{role}/joint_states" for role in ROLES}
IMAGES = (COLOR, DEPTH, MASK)
WANTED = (*IMAGES, INFO, CALIBRATION, *STATES.values())
MOST_FRAMES = 300  # that are held of a recording, evenly over it: a minute at 30 Hz of 640x480 has 4.4 GB
_SAME = 0.05  # share of held-out images found in the fitted ones from which on they count as the same
_STAMP_DIGITS = 6  # of s
_EVERY = 8  # row and column of an image that is compared: all of them take seconds
_MOST_BYTES = 3_000_000_000  # of images that are held at once


def read_image_bag(path: Path, task: str, cell: str = DEFAULT_CELL) -> ImageRecording:
    """The frames that have colour, depth and mask of one stamp, at most `MOST_FRAMES` of them.

    Raises:
        InputError: a topic is missing, images of several sizes, or messages that are broken.
    """
    bag = open_bag(path)
    present = {topic.name for topic in bag.topics if topic.count}
    if missing := [name for name in WANTED if name not in present]:
        raise InputError(
            f"bag {path} lacks {', '.join(missing)}; images are compared with colour, depth, mask,"
            " camera_info, calibration and the joint states of both arms. Record them, or diagnose the arms"
            " without --camera"
        )
    spec = cell_named(cell)
    joints: dict[str, dict[int, np.ndarray]] = {role: {} for role in ROLES}
    lens, poses = None, None
    roles = {name: role for role, name in STATES.items()}
    decode = BagDecoder(bag)
    seen: dict[str, list[tuple[int, int]]] = {name: [] for name in IMAGES}  # stamp, log time [ns]
    for raw in bag.messages(WANTED):
        if raw.topic in seen:
            seen[raw.topic].append((_stamp_of(bag, raw), raw.log_time_ns))
            continue
        message = decode(raw)
        if raw.topic in roles:
            role = roles[raw.topic]
            reading = from_message.arm_reading(message, spec.arm(role).joint_names)
            joints[role][reading.stamp_ns] = reading.position
        elif raw.topic == INFO:
            lens = _same(lens, from_message.intrinsics(message), bag)
        else:
            poses = from_message.calibration(message.data)
    stamps = _kept_stamps(bag, seen)
    images = _read_images(bag, stamps, seen, decode)
    assert lens is not None and poses is not None
    expected = (lens.height, lens.width)
    for topic, found in images.items():
        if wrong := next((i.shape for i in found.values() if i.shape[:2] != expected), None):
            raise InputError(
                f"bag {path}: {topic} is {wrong[1]}x{wrong[0]}, camera_info says {expected[1]}x{expected[0]}"
            )
    start = min(joints["camera_arm"])

    def seconds(values: Sequence[int]) -> np.ndarray:
        return 1e-9 * (np.array(sorted(values), dtype=np.int64) - start)

    def track(role: str) -> tuple[np.ndarray, np.ndarray]:
        return seconds(list(joints[role])), np.stack([joints[role][t] for t in sorted(joints[role])])

    return ImageRecording(
        path.stem if path.suffix == ".mcap" else path.name, str(path), bag.sha256(), task, cell, lens,
        poses["camera_in_flange"], poses["camera_arm"], poses["tool_arm"], seconds(stamps),
        np.stack([images[COLOR][t] for t in stamps]), np.stack([images[DEPTH][t] for t in stamps]),
        np.stack([images[MASK][t] for t in stamps]), *track("camera_arm"), *track("tool_arm"),
    )  # fmt: skip


def load_image_bags(
    fit: Sequence[Path], held_out: Sequence[Path], task: str, tolerances: Path | None
) -> tuple[list[ImageRecording], list[ImageRecording], list[str]]:
    """Recordings by role, with notes; tolerances of a YAML file replace the defaults.

    Raises:
        InputError: as `read_image_bag`; too few images to hold any out, or held-out ones that are fitted too.
    """
    groups = [[read_image_bag(path, task) for path in paths] for paths in (fit, held_out)]
    if tolerances is not None:
        stated = read_stated(ImageTolerances, tolerances)
        groups = [[replace(r, tolerances=stated) for r in group] for group in groups]
    fitted, held = groups
    if held:
        for unseen in held:
            for known in fitted:
                check_unseen(_shared(known, unseen), _SAME, unseen.name, f"the fitted {known.name}", "images")
        return fitted, held, []
    first, last = split_images(fitted[0])
    return [first], [last], [f"{fitted[0].name} is alone: its last part is held out"]


def _shared(known: ImageRecording, unseen: ImageRecording) -> float:
    """Share of the images of `unseen` that are, at the same moment and bit for bit, in `known`."""

    def frames(recording: ImageRecording) -> list[bytes]:
        pixels = [p[:, ::_EVERY, ::_EVERY] for p in (recording.color, recording.depth, recording.mask)]
        stamps = np.round(recording.time, _STAMP_DIGITS)
        return [
            hashlib.sha256(b"".join((stamp.tobytes(), *(p[k].tobytes() for p in pixels)))).digest()
            for k, stamp in enumerate(stamps)
        ]

    there = set(frames(known))
    return sum(frame in there for frame in frames(unseen)) / len(unseen.time)


def _stamp_of(bag: Bag, raw: RawMessage) -> int:
    """Stamp [ns] of a message, without decoding a pixel."""
    stamp = header_stamp_ns(raw.type, raw.data)
    if stamp is None:
        raise InputError(
            f"bag {bag.path}: {raw.topic} at log time {raw.log_time_ns} ns has no stamp; let the driver"
            " set header.stamp"
        )
    return stamp


def _kept_stamps(bag: Bag, seen: Mapping[str, Sequence[tuple[int, int]]]) -> list[int]:
    """Stamps [ns] that colour, depth and mask share, at most `MOST_FRAMES`; `seen` has (stamp, log time)."""
    shared = sorted(set.intersection(*({stamp for stamp, _ in of} for of in seen.values())))
    if not shared:
        raise InputError(
            f"bag {bag.path}: colour, depth and mask share no stamp; publish them aligned, as one frame"
        )
    if len(shared) <= MOST_FRAMES:
        return shared
    return [shared[k] for k in np.linspace(0, len(shared) - 1, MOST_FRAMES).round().astype(int)]


def _read_images(
    bag: Bag,
    stamps: Sequence[int],
    seen: Mapping[str, Sequence[tuple[int, int]]],
    decode: BagDecoder,
) -> dict[str, dict[int, np.ndarray]]:
    """Images (H, W, ...) by topic and stamp [ns]; parts of the bag that hold none of them stay unread."""
    images: dict[str, dict[int, np.ndarray]] = {name: {} for name in IMAGES}
    kept, size = set(stamps), 0
    times = {time for of in seen.values() for stamp, time in of if stamp in kept}
    for near in (times, None):  # a block whose header states another span than it has is found by reading all
        for raw in bag.messages(IMAGES, near):
            stamp = header_stamp_ns(raw.type, raw.data)
            if stamp not in kept or (near is None and stamp in images[raw.topic]):
                continue
            message = decode(raw)
            image = from_message.image(message)
            size += image.nbytes
            if size > _MOST_BYTES:
                raise InputError(
                    f"{len(stamps)} images of bag {bag.path} have more than {_MOST_BYTES / 1e9:g} GB; record"
                    " them smaller, a camera is told from images 160 pixels wide"
                )
            images[raw.topic][from_message.stamp_ns(message)] = image
        if all(stamp in of for of in images.values() for stamp in stamps):
            break
    return images


def _same(before: Any, now: Any, bag: Bag) -> Any:
    if before is not None and now != before:
        raise InputError(f"bag {bag.path}: camera_info changes from {before} to {now}; record one resolution")
    return now
