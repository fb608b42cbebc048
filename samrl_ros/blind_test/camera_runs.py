"""A camera world's bags and its label. Picklable, for other processes."""

from __future__ import annotations

import json
import os
import shutil
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from samrl_core.blind_test.camera_worlds.forge_plan import CameraItem
from samrl_core.blind_test.camera_worlds.label import label_of
from samrl_core.blind_test.camera_worlds.record import CameraRecorder
from samrl_core.blind_test.scores.study import Study, move_folder, write_atomically

PARTS = ("A", "C")  # fitted, held out


@dataclass(frozen=True)
class CameraMaking:
    """A camera world to be made in a study's folder."""

    root: Path
    item: CameraItem


def make_camera(job: CameraMaking) -> float:
    """Make a camera world; its observations are moved into place last.

    Returns:
        how long it took [s].
    """
    from samrl_ros.recordings.write_images import write_image_bag

    began = time.monotonic()
    study, item = Study(job.root), job.item
    half = job.root / "obs" / f".{item.id}.{os.getpid()}"
    shutil.rmtree(half, ignore_errors=True)
    half.mkdir(parents=True)
    recorder = _recorder(item.duration_s)
    for recording in recorder.recorded(item.world):
        write_image_bag(recording, half / f"{recording.name}.mcap")
    label = json.dumps(label_of(item, recorder.cell), indent=1) + "\n"
    write_atomically(study.label(item.id), label.encode())
    move_folder(half, study.observations(item.id))
    return time.monotonic() - began


@cache
def _recorder(duration_s: float) -> CameraRecorder:
    """Its motions take some seconds to plan."""
    return CameraRecorder(duration_s)
