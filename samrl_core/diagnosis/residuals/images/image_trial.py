"""A recording of images as the effects see it: rows of all compared frames, by channel, with their noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from samrl_core.cell.types.image_recording import LEAST_FRAMES, ImageRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.linearisation import Point, linearised, rows_at
from samrl_core.diagnosis.residuals.images.noise import noise_of_rows
from samrl_core.diagnosis.residuals.images.object_pose import solved_object
from samrl_core.diagnosis.residuals.images.rows import CHANNELS, TILES, UNITS, ComparedFrame, joined
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.images.spreads import SIZES
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.phases import phases_of_speed

DEPTH_NOISE_PER_Z2 = 0.08 / (447.0 * 0.05) * np.sqrt(0.5)  # [1/m] of neighbours, of a stereo camera's 0.08 px
LINEARISED = 16  # frames of all fitted recordings, from which the point of linearisation is found
UNTOLD = 1e4  # times its noise, of a row that tells nothing
MOVING_RAD_S = 0.03  # of the camera or the tool in the image, below which nothing is said of clocks


@dataclass(frozen=True, eq=False)
class ImageConstants:
    """What recordings of one scene share: the scene, where its object stands, each channel's noise."""

    scene: ImageScene
    object_pose: np.ndarray  # (4, 4) about the object's origin
    level: Mapping[str, float]
    point: Point = field(default_factory=dict)  # about which rows are linear


class ImageTrial(Observed):
    """Residuals of depth [m], outlines [px], brightness [1] and depth's noise [log] per tile and frame."""

    kind = "images"
    exact = True
    tiles_along_side = TILES
    unsure = 0.15  # calibrated from the recording itself: 4 to 9 % too little in development cells

    def __init__(
        self, recording: ImageRecording, constants: ImageConstants, frames: Sequence[ComparedFrame]
    ) -> None:
        """Form the residuals of chosen frames at the given constants."""
        self.recording, self.constants, self.frames = recording, constants, tuple(frames)
        self.cached: dict[tuple[str, str], Any] = {}
        made = [
            rows_at(constants.scene, f, constants.object_pose, DEPTH_NOISE_PER_Z2, constants.point)
            for f in frames
        ]
        self._rows = {c: joined([m[c] for m in made]) for c in CHANNELS}
        self._frame = {c: np.repeat(np.arange(len(made)), [len(m[c].value) for m in made]) for c in CHANNELS}
        self.channels = tuple(c for c in CHANNELS if len(self._rows[c].value))
        self.level, self._sigma, self.outliers = noise_of_rows(
            {c: self._rows[c] for c in self.channels}, constants.level
        )

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.recording.name

    @property
    def places(self) -> tuple[str, ...]:
        """The camera."""
        return (f"sensor:{self.recording.camera}",)

    @property
    def units(self) -> Mapping[str, str]:
        """Of each channel."""
        return UNITS

    @cached_property
    def residual(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, 1), frame after frame."""
        return {c: self._rows[c].value[:, None] for c in self.channels}

    @cached_property
    def sigma(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, 1)."""
        return {c: self._sigma[c][:, None] for c in self.channels}

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.recording.duration

    def tiles_of(self, channel: str) -> np.ndarray:
        """(N,) index of each sample's tile, row by row of `TILES` x `TILES`."""
        return self._rows[channel].tile

    def surfaces(self, channel: str) -> np.ndarray:
        """(N,) index of each sample's surface and colour; (0,) of channels that are of no colour."""
        return self._rows[channel].surface

    def elapsed(self, channel: str) -> np.ndarray:
        """Times (N,) since the first image [s]."""
        times = np.array([f.view.time for f in self.frames])
        return times[self._frame[channel]] - float(self.recording.time[0])

    def spacing(self, channel: str) -> float:
        """Mean time between samples [s]: those of one frame have one stamp."""
        return max(self.duration, 1e-3) / max(1, len(self._frame[channel]))

    @cached_property
    def speeds(self) -> np.ndarray:
        """(F, 2) how fast camera and tool move in the image [rad/s], about."""
        out = []
        for frame in self.frames:
            v = frame.view
            camera = v.camera_rate[:3] + np.cross(v.camera_rate[3:], [0.0, 0.0, 0.35])
            tool = v.tool_rate[:3] + np.cross(v.tool_rate[3:], v.flange[:3, 3])
            out.append([np.linalg.norm(camera) / 0.35, np.linalg.norm(tool) / 0.35])
        return np.array(out)

    def phases(self, channel: str) -> np.ndarray:
        """Rest, slow or fast (N, 1), by how fast the image moves."""
        return phases_of_speed(self.speeds.sum(axis=1))[self._frame[channel]][:, None]

    def drivers(self, channel: str, row: int) -> dict[str, np.ndarray]:
        """Where in the image, and when."""
        tile = self.tiles_of(channel)
        right, below = tile % TILES - 0.5 * (TILES - 1), tile // TILES - 0.5 * (TILES - 1)
        return {
            "right in the image": right,
            "below in the image": below,
            "distance from the image's centre": np.hypot(right, below),
            "time": self.elapsed(channel),
            "camera's speed": self.speeds[self._frame[channel], 0],
            "tool's speed": self.speeds[self._frame[channel], 1],
        }

    def names_of(self, kind: str) -> tuple[str, ...]:
        """The camera, the object, both arms and the cell."""
        return {
            "sensor": self.places,
            "body": (f"body:{self.constants.scene.body}",),
            "cell": ("cell",),
            "arm": ("arm:camera_arm", "arm:tool_arm"),
            "joint": tuple(f"joint:{j}" for names in self.joints.values() for j in names),
        }.get(kind, ())

    @property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """Names of the joints of `camera` and `tool`."""
        cell = self.constants.scene.cell
        return {"camera": cell.camera_arm.joint_names, "tool": cell.tool_arm.joint_names}

    def joint_of(self, place: str) -> tuple[str, int]:
        """`camera` or `tool`, and the index of `joint:<name>`."""
        name = place.partition(":")[2]
        for arm, names in self.joints.items():
            if name in names:
                return arm, names.index(name)
        raise InputError(f"{self.name} has no {place}")

    def moves(self, arm: str) -> bool:
        """Whether the image of some frames moves by an arm, `camera` or `tool`."""
        speeds = self.speeds[:, ("camera", "tool").index(arm)]
        return bool(np.count_nonzero(speeds > MOVING_RAD_S) >= 3)

    def column(self, name: str) -> Columns:
        """Columns (p, N) of a name of `SIZES`, in every channel that it moves."""
        found = {(c, 0): self._rows[c].columns[name] for c in self.channels if name in self._rows[c].columns}
        return {key: rows for key, rows in found.items() if np.any(rows)}

    def without(self, channel: str, rows: np.ndarray) -> ImageTrial:
        """The same recording, rows of a channel, as a mask (N,), so noisy that they tell nothing."""
        out = copy(self)
        out.__dict__.pop("sigma", None)
        out.cached = {}
        out._sigma = {**self._sigma, channel: np.where(rows, UNTOLD, 1.0) * self._sigma[channel]}
        return out

    def added(self, *parts: tuple[float, str]) -> Columns:
        """Sums of columns of equal size, each times a factor."""
        out: dict[tuple[str, int], np.ndarray] = {}
        for factor, name in parts:
            for key, rows in self.column(name).items():
                out[key] = out.get(key, 0.0) + factor * rows
        return out

    def stacked(self, *names: str) -> Columns:
        """Columns of several names, one after the other; zero where a channel lacks one."""
        found = [self.column(n) for n in names]
        # In an order: a set's differs between processes, and with it the last digits of sums over channels.
        keys = dict.fromkeys(key for columns in found for key in columns)
        return {
            key: np.concatenate(
                [
                    columns.get(key, np.zeros((SIZES[n], len(self.residual[key[0]]))))
                    for n, columns in zip(names, found, strict=True)
                ]
            )
            for key in keys
        }


def prepared(recordings: Sequence[ImageRecording], fitted: int) -> list[ImageTrial]:
    """Trials of recordings of one scene, of which the first `fitted` give the object's pose and the noise.

    Raises:
        InputError: too few frames show the object.
    """
    first = recordings[0]
    scene = ImageScene(first, compared_size(first.intrinsics)[0])
    frames = [chosen_frames(scene, r) for r in recordings]
    for recording, kept in zip(recordings, frames, strict=True):
        if len(kept) < LEAST_FRAMES:
            raise InputError(
                f"{recording.name}: the object {scene.body} (label {scene.target_label}) is in"
                f" {len(kept)} of {len(recording.time)} images with joint states, {LEAST_FRAMES} are needed;"
                f" labels in its masks: {sorted(map(int, np.unique(recording.mask)))}"
            )
    known = [f for kept in frames[:fitted] for f in kept]
    pose = solved_object(scene, known, first.tolerances, DEPTH_NOISE_PER_Z2)
    few = known[:: max(1, len(known) // LINEARISED)][:LINEARISED]
    constants = ImageConstants(
        scene, pose, {}, linearised(scene, few, pose, DEPTH_NOISE_PER_Z2, first.tolerances)
    )
    trials: list[ImageTrial] = []
    for recording, kept in zip(recordings, frames, strict=True):
        trial = ImageTrial(recording, constants, kept)
        if len(trials) == 0:
            constants = replace(constants, level=trial.level)
        trials.append(trial)
    return trials
