"""Pictures of a run: what the camera saw, the model after each update, and their difference."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import Bag, open_bag
from samrl_ros.cell.report.run_record import PHASE, READY, STATE
from samrl_ros.contract.topics import camera_topic, cell_topic
from samrl_ros.conversions.from_message import image, stamp_ns

COLOR, MODEL = camera_topic("color/image_raw"), cell_topic("model_updater/image")

CARDS = 12  # updates shown of an episode, evenly chosen, first and last included
QUALITY = 88  # of JPEG pictures, per cent
PANEL = 240  # height and width of a video's picture [px]
CAPTION = 32  # height of a video's caption [px]
FRAMES = 300  # of a video, at most
RATE = 10.0  # pictures per second of a video


@dataclass(frozen=True)
class Card:
    """One update: three JPEG files."""

    episode: int
    step: int
    time: float  # [s] since the episode's first update
    before: float
    after: float
    real: bytes
    model: bytes
    difference: bytes


def difference_image(real: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Absolute difference of two rgb8 images (H, W, 3), made twice as bright."""
    return np.clip(2 * np.abs(real.astype(np.int16) - model.astype(np.int16)), 0, 255).astype(np.uint8)


def update_cards(bag_path: Path, episodes: list[int]) -> dict[int, list[Card]]:
    """At most `CARDS` updates of each episode.

    Raises:
        InputError: the bag cannot be read.
    """
    bag = open_bag(bag_path)
    chosen: dict[int, tuple[int, int, float, float]] = {}
    by_episode: dict[int, dict[int, tuple[int, int, float, float]]] = {e: {} for e in episodes}
    for _, m in bag.decoded((STATE,)):
        if int(m.episode) in by_episode:
            about = (int(m.episode), int(m.step), float(m.loss_before), float(m.loss_after))
            by_episode[int(m.episode)][stamp_ns(m)] = about
    for updates in by_episode.values():
        stamps = sorted(updates)
        at = np.unique(np.linspace(0, len(stamps) - 1, CARDS).round().astype(int)) if stamps else []
        chosen.update({stamps[i]: updates[stamps[i]] for i in at})
    pictures: dict[str, dict[int, np.ndarray]] = {COLOR: {}, MODEL: {}}
    for raw, m in bag.decoded((COLOR, MODEL)):
        if stamp_ns(m) in chosen:
            pictures[raw.topic][stamp_ns(m)] = image(m)
    cards: dict[int, list[Card]] = {e: [] for e in episodes}
    for stamp in sorted(pictures[COLOR].keys() & pictures[MODEL].keys()):
        real, model = pictures[COLOR][stamp], pictures[MODEL][stamp]
        if real.shape != model.shape:
            continue
        episode, step, before, after = chosen[stamp]
        first = min(by_episode[episode])
        jpegs = [_jpeg(p) for p in (real, model, difference_image(real, model))]
        cards[episode].append(Card(episode, step, (stamp - first) * 1e-9, before, after, *jpegs))
    return {episode: found for episode, found in cards.items() if found}


def _jpeg(rgb: np.ndarray) -> bytes:
    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise InputError(f"an image of shape {rgb.shape} cannot be written as JPEG; check the camera's topic")
    return data.tobytes()


def make_video(bag_path: Path) -> tuple[bytes, float]:
    """A WebM (VP8) of camera, model and difference, as they were in force, from the first episode on.

    Returns:
        The file, and how much faster than robot time it runs; no bytes where the bag has fewer than two
        camera images.

    Raises:
        InputError: the bag cannot be read, or this OpenCV has no VP8.
    """
    bag = open_bag(bag_path)
    begin = next((r.log_time_ns for r in bag.messages((READY,))), bag.start_ns)
    stamps = [r.log_time_ns for r in bag.messages((COLOR,)) if r.log_time_ns >= begin]
    if len(stamps) < 2:
        return b"", 1.0
    stride = -(-len(stamps) // FRAMES)
    seconds = (stamps[-1] - stamps[0]) * 1e-9
    speed = max(seconds * RATE / max(len(stamps) // stride, 1), 0.1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.webm"
        size = (3 * PANEL, PANEL + CAPTION)
        with _quiet_stderr():
            writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"VP80"), RATE, size)
        if not writer.isOpened():
            raise InputError("this OpenCV cannot write VP8 video; install opencv-python-headless from PyPI")
        try:
            for frame in _frames(bag, begin, stride):
                writer.write(frame)
        finally:
            writer.release()
        return path.read_bytes(), speed


def _frames(bag: Bag, begin: int, stride: int) -> Iterator[np.ndarray]:
    """BGR frames in recorded order; model and difference are those of the last update."""
    black = np.zeros((PANEL, PANEL, 3), np.uint8)
    model, difference, caption, count = black, black, "", 0
    recent: dict[int, np.ndarray] = {}  # images of the last seconds, by stamp
    for raw, m in bag.decoded((COLOR, MODEL, PHASE)):
        if raw.topic == PHASE:
            caption = m.data
        elif raw.topic == MODEL:
            drawn, real = image(m), recent.get(stamp_ns(m))
            model = _panel(drawn)
            same = real is not None and real.shape == drawn.shape
            difference = _panel(difference_image(real, drawn)) if real is not None and same else black
        else:
            recent[stamp_ns(m)] = image(m)
            while len(recent) > 100:
                del recent[next(iter(recent))]
            if raw.log_time_ns < begin:
                continue
            count += 1
            if (count - 1) % stride:
                continue
            bar = np.zeros((CAPTION, 3 * PANEL, 3), np.uint8)
            now = (raw.log_time_ns - begin) * 1e-9
            for i, text in enumerate((f"camera  {now:.1f} s  {caption}", "model", "difference x2")):
                place = (i * PANEL + 8, 21)
                cv2.putText(bar, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (235, 235, 235), 1, cv2.LINE_AA)
            yield np.vstack([bar, np.hstack([_panel(image(m)), model, difference])])


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
def _quiet_stderr() -> Iterator[None]:
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
