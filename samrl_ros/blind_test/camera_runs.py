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
from samrl_core.blind_test.scores.outcome import TILE_CHANGE
from samrl_core.blind_test.scores.study import Study, move_folder
from samrl_core.common.array_file import write_arrays
from samrl_core.common.files import write_whole

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
    recordings = recorder.recorded(item.world)
    for recording in recordings:
        write_image_bag(recording, half / f"{recording.name}.mcap")
    if changes := recorder.changed_tiles(item.world, recordings[0]):
        arrays = {f"{TILE_CHANGE}{channel}": size for channel, size in changes.items()}
        write_arrays(study.oracle(item.id), arrays)
    label = json.dumps(label_of(item, recorder.cell), indent=1) + "\n"
    write_whole(study.label(item.id), label)
    move_folder(half, study.observations(item.id))
    return time.monotonic() - began


@cache
def _recorder(duration_s: float) -> CameraRecorder:
    """Its motions take some seconds to plan."""
    return CameraRecorder(duration_s)
