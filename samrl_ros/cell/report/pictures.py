"""Pictures of a run: what the camera saw, the model after each update, and their difference."""

from __future__ import annotations

import os
import sys
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Collection, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import RawMessage, open_bag
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.cell.report.run_record import PHASE, READY, STATE, losses_of
from samrl_ros.contract.topics import camera_topic, cell_topic
from samrl_ros.conversions.from_message import image

COLOR, MODEL = camera_topic("color/image_raw"), cell_topic("model_updater/image")

CARDS = 12  # updates shown of an episode, evenly chosen, first and last included
QUALITY = 88  # of JPEG pictures, per cent
PANEL = 240  # height and width of a video's picture [px]
CAPTION = 32  # height of a video's caption [px]
FRAMES = 300  # of a video, at most
RECENT = 100  # camera images kept for the model that belongs to one of them: 10 s
RATE = 10.0  # pictures per second of a video


@dataclass(frozen=True)
class Card:
    """One update: three JPEG files."""

    episode: int
    step: int
    time: float  # [s] since the episode's first update
    losses: str  # as `losses_of` says them
    real: bytes
    model: bytes
    difference: bytes


def difference_image(real: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Absolute difference of two rgb8 images (H, W, 3), made twice as bright."""
    return np.clip(2 * np.abs(real.astype(np.int16) - model.astype(np.int16)), 0, 255).astype(np.uint8)


class Cards:
    """Keeps pictures of updates while a bag is read: of failures first, of all their updates `CARDS`."""

    topics = frozenset({COLOR, MODEL, STATE, READY})

    def __init__(self, succeeded: Collection[int], most: int) -> None:
        """Args:
        succeeded: numbers of the episodes that did.
        most: episodes that are shown.
        """
        self._succeeded, self._most = frozenset(succeeded), most
        self._images: OrderedDict[int, RawMessage] = OrderedDict()  # of the last seconds, by stamp
        self._states: dict[int, Any] = {}  # of this episode, by stamp
        self._found: dict[int, list[Card]] = {}

    def take(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        """See `Watcher`."""
        if raw.topic == READY:
            self._thin()
            self._states = {}
        elif raw.topic == STATE:
            self._states[header_stamp_ns(raw.type, raw.data) or 0] = decoded(raw)
        elif raw.topic == COLOR:
            self._images[header_stamp_ns(raw.type, raw.data) or 0] = raw
            while len(self._images) > RECENT:
                self._images.popitem(last=False)
        else:
            self._add(raw, decoded)

    def shown(self) -> dict[int, list[Card]]:
        """Cards of the episodes that are shown, failures first chosen, in their order."""
        self._thin()
        return {e: self._found[e] for e in sorted(self._chosen()) if self._found[e]}

    def _chosen(self) -> list[int]:
        return sorted(self._found, key=lambda e: (e in self._succeeded, e))[: self._most]

    def _add(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        stamp = header_stamp_ns(raw.type, raw.data) or 0
        state, color = self._states.get(stamp), self._images.get(stamp)
        if state is None:
            return
        episode = int(state.episode)
        self._found.setdefault(episode, [])
        if color is None or episode not in self._chosen():
            return
        real, model = image(decoded(color)), image(decoded(raw))
        if real.shape != model.shape:
            return
        time = (stamp - min(self._states)) * 1e-9
        jpegs = [_jpeg(p) for p in (real, model, difference_image(real, model))]
        self._found[episode].append(Card(episode, int(state.step), time, losses_of(state), *jpegs))

    def _thin(self) -> None:
        """Keep some of the updates of each episode, and no pictures of those that are not shown."""
        chosen = self._chosen()
        for episode, cards in self._found.items():
            if episode not in chosen:
                cards.clear()
            elif len(cards) > CARDS:
                at = np.unique(np.linspace(0, len(cards) - 1, CARDS).round().astype(int))
                self._found[episode] = [cards[i] for i in at]


def _jpeg(rgb: np.ndarray) -> bytes:
    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise InputError(f"an image of shape {rgb.shape} cannot be written as JPEG; check the camera's topic")
    return data.tobytes()


class Video:
    """Makes a WebM (VP8) of camera, model and difference while a bag is read, from the first episode on."""

    topics = frozenset({COLOR, MODEL, PHASE, READY})

    def __init__(self, bag_path: Path) -> None:
        """Raises `InputError` if the bag cannot be read."""
        bag = open_bag(bag_path)
        count = next((t.count for t in bag.topics if t.name == COLOR), 0)
        self._stride = max(-(-count // FRAMES), 1)
        begun = any(t.name == READY and t.count for t in bag.topics)
        self._begin, self._first, self._end = (-1 if begun else bag.start_ns), -1, -1  # [ns]
        self._seen = self._frames = 0
        self._caption = ""
        self._model = self._difference = _waiting()
        self._recent: OrderedDict[int, RawMessage] = OrderedDict()  # camera images by stamp
        self._folder = tempfile.TemporaryDirectory()
        self._writer: cv2.VideoWriter | None = None

    def __enter__(self) -> Video:
        return self

    def __exit__(self, *ignored: object) -> None:
        if self._writer is not None:
            self._writer.release()
        self._folder.cleanup()

    def take(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        """See `Watcher`."""
        if raw.topic == READY:
            self._begin = raw.log_time_ns if self._begin < 0 else self._begin
        elif raw.topic == PHASE:
            self._caption = decoded(raw).data
        elif raw.topic == MODEL:
            self._take_model(raw, decoded)
        else:
            self._recent[header_stamp_ns(raw.type, raw.data) or 0] = raw
            while len(self._recent) > RECENT:
                self._recent.popitem(last=False)
            if self._begin >= 0:
                self._take_camera(raw, decoded)

    def made(self) -> tuple[bytes, float]:
        """The file, and how much faster than robot time it runs; no bytes of fewer than two images."""
        if self._writer is None or self._seen < 2:
            return b"", 1.0
        self._writer.release()
        seconds = (self._end - self._first) * 1e-9
        return self._path.read_bytes(), max(seconds * RATE / self._frames, 0.1)

    @property
    def _path(self) -> Path:
        return Path(self._folder.name) / "run.webm"

    def _take_model(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        drawn = image(decoded(raw))
        self._model = _panel(drawn)
        color = self._recent.get(header_stamp_ns(raw.type, raw.data) or 0)
        real = image(decoded(color)) if color is not None else drawn[:0]
        same = real.shape == drawn.shape
        self._difference = _panel(difference_image(real, drawn) if same else np.zeros_like(drawn))

    def _take_camera(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        if not self._seen:
            self._first = raw.log_time_ns
        self._end = raw.log_time_ns
        self._seen += 1
        if (self._seen - 1) % self._stride:
            return
        bar = np.zeros((CAPTION, 3 * PANEL, 3), np.uint8)
        now = (raw.log_time_ns - self._begin) * 1e-9
        for i, text in enumerate((f"camera  {now:.1f} s  {self._caption}", "model", "difference x2")):
            place = (i * PANEL + 8, 21)
            cv2.putText(bar, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (235, 235, 235), 1, cv2.LINE_AA)
        pictures = np.hstack([_panel(image(decoded(raw))), self._model, self._difference])
        if self._writer is None:
            self._writer = _open_writer(self._path)
        self._writer.write(np.vstack([bar, pictures]))
        self._frames += 1


def _open_writer(path: Path) -> cv2.VideoWriter:
    with _quiet_stderr():
        writer = cv2.VideoWriter(
            str(path), cv2.VideoWriter.fourcc(*"VP80"), RATE, (3 * PANEL, PANEL + CAPTION)
        )
    if not writer.isOpened():
        raise InputError("this OpenCV cannot write VP8 video; install opencv-python-headless from PyPI")
    return writer


def _waiting() -> np.ndarray:
    """What stands for the model until its first update."""
    panel = np.zeros((PANEL, PANEL, 3), np.uint8)
    place, grey = (PANEL // 2 - 78, PANEL // 2 + 5), (150, 150, 150)
    cv2.putText(panel, "before the first update", place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, grey, 1, cv2.LINE_AA)
    return panel


def _panel(rgb: np.ndarray) -> np.ndarray:
    """A BGR square of `PANEL`, the picture's proportions kept."""
    height, width = rgb.shape[:2]
    scale = PANEL / max(height, width)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    interpolation = cv2.INTER_NEAREST if scale >= 1 else cv2.INTER_AREA
    small = cv2.resize(np.ascontiguousarray(rgb[..., ::-1]), size, interpolation=interpolation)
    panel = np.zeros((PANEL, PANEL, 3), np.uint8)
    top, left = (PANEL - size[1]) // 2, (PANEL - size[0]) // 2
    panel[top : top + size[1], left : left + size[0]] = small
    return panel


@contextmanager
def _quiet_stderr() -> Generator[None]:
    """FFmpeg prints, from C, that WebM has no four-letter tags; it finds the codec all the same."""
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
