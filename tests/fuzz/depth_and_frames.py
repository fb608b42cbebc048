"""Depth images and what lies beside them, trees of frames in bags, and tensors."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.intrinsics import read_cameras
from samrl_ros.log_import.formats.point_clouds import read_cloud
from samrl_ros.log_import.formats.rosbag import list_topics
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from tests.fuzz.reader import Reader
from tests.recordings.logs.frame_bags import BEGIN_S, FrameLog, write_frames

SIZE = (36, 48)  # of an image [pixels], enough for a plane
INTRINSICS = {"fx": 45.0, "fy": 45.0, "ppx": 23.5, "ppy": 17.5, "depth_scale": 0.001}
MATRIX = np.array([[45.0, 0.0, 23.5], [0.0, 45.0, 17.5], [0.0, 0.0, 1.0]])
STEPS = 12  # moving transforms of a bag


def _wall() -> np.ndarray:
    """Raw depth (H, W) of a leaning wall [mm]."""
    v, u = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
    return np.round(800.0 + 0.6 * u - 0.4 * v).astype(np.uint16)


def _image(kind: str) -> Callable[[], list[bytes]]:
    def make() -> list[bytes]:
        buffer = io.BytesIO()
        Image.fromarray(_wall()).save(buffer, kind)
        return [buffer.getvalue()]

    return make


def _stack() -> list[bytes]:
    archive, array = io.BytesIO(), io.BytesIO()
    images = np.stack([_wall(), _wall()]) / np.float32(1000.0)
    np.savez(archive, depth=images, K=MATRIX)
    np.save(array, images)
    return [archive.getvalue(), array.getvalue()]


def _cameras() -> list[bytes]:
    matrix = MATRIX.ravel().tolist()
    ros = f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {matrix}\ndepth_units: 0.001\n"
    opencv = f"%YAML:1.0\n---\nK: !!opencv-matrix\n  {{rows: 3, cols: 3, dt: d, data: {matrix}}}\n"
    lines = "\n".join(" ".join(map(str, row)) for row in MATRIX)
    return [text.encode() for text in (json.dumps(INTRINSICS), ros, opencv, lines, "45 45 23.5 17.5")]


def _put_tape(path: Path) -> None:
    """Distances and a camera beside a stack of images in metres."""
    path.parent.mkdir()
    (path.parent / "tape.csv").write_text("tape_cm\n80\n81\n")
    (path.parent / "K.json").write_text(json.dumps(INTRINSICS | {"depth_scale": 1.0}))


def _put_images(path: Path, listed: bool = False) -> None:
    """Images named by their distance beside a camera's file, or that file and a table beside images."""
    path.parent.mkdir()
    for k in range(2):
        Image.fromarray(_wall()).save(path.parent / f"depth_{k}{'' if listed else '_800mm'}.png")
    if path.name != "intrinsics.json":
        (path.parent / "intrinsics.json").write_text(json.dumps(INTRINSICS))


def _read(path: Path) -> None:
    """As `samrl diagnose` and `samrl bag draft` begin."""
    read_devices([path], [])
    as_yaml(draft_any([path], None, None))


def _read_cameras(path: Path) -> None:
    text = path.read_bytes()
    for name in ("K.yaml", "K.txt", "K.xml", "K.ini"):
        path.with_name(name).write_bytes(text)
    read_cameras([path.parent])
    for name in ("K.yaml", "K.txt", "K.xml", "K.ini"):
        path.with_name(name).unlink()
    _read(path.parent)


@cache
def _frames(kind: str) -> tuple[bytes, bytes]:
    """A bag's file and its metadata: an arm, a camera on it, a tag that it sees."""
    rows = []
    for k in range(STEPS):
        pose = np.eye(4)
        pose[:3, 3] = [0.1 * k, 0.0, 0.5]
        moved = [("tool0", "base_link", pose), ("tag_1", "camera", pose)]
        rows += [(BEGIN_S + 0.1 * k + 0.01 * j, [one]) for j, one in enumerate(moved)]
    log = FrameLog(moving=rows, static=[("camera", "tool0", np.eye(4))])
    with tempfile.TemporaryDirectory() as folder:
        path = write_frames(Path(folder) / "log", log, kind)
        if path.is_file():
            return path.read_bytes(), b""
        (file,) = [each for each in path.iterdir() if each.suffix != ".yaml"]
        return file.read_bytes(), (path / "metadata.yaml").read_bytes()


def _read_frames(path: Path) -> None:
    list_topics(path, "it")
    for part in ("tag_1 in base_link", "tool0 in tag_1"):
        read_table(path, CsvOptions(), "it", part)
    _read(path)


def _put_metadata(path: Path) -> None:
    path.parent.mkdir()
    (path.parent / "metadata.yaml").write_bytes(_frames("sqlite3")[1])


def _tensors() -> list[bytes]:
    import torch

    made: list[Any] = [torch.eye(4).repeat(5, 1, 1), {"tag": torch.rand(8, 7), "rest": [torch.ones(3), 2.0]}]
    out = []
    for each in made:
        for zipped in (True, False):
            buffer = io.BytesIO()
            torch.save(each, buffer, _use_new_zipfile_serialization=zipped)
            out.append(buffer.getvalue())
    return out


def _clouds() -> list[bytes]:
    points = np.column_stack([np.random.default_rng(5).uniform(-0.3, 0.3, (600, 2)), np.full(600, 0.8)])
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 600\nHEIGHT 1\n"
    head += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 600\nDATA "
    text = "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points)
    return [f"{head}ascii\n{text}".encode(), f"{head}binary\n".encode() + points.astype("<f4").tobytes()]


DEPTH_AND_FRAMES = (
    *(
        Reader(
            f"depth image {suffix}", f"log/depth_2_800mm.{suffix}", _image(kind),
            lambda path: _read(path.parent), share=0.3, prepare=_put_images,
        )
        for suffix, kind in (("png", "PNG"), ("tif", "TIFF"), ("pgm", "PPM"))
    ),
    Reader("stack of depth images .npz", "log/run.npz", _stack, _read, share=0.3, prepare=_put_tape),
    Reader("stack of depth images .npy", "log/run.npy", _stack, _read, share=0.3, prepare=_put_tape),
    Reader("depth camera", "log/intrinsics.json", _cameras, _read_cameras, share=0.3, prepare=_put_images),
    Reader(
        "list of depth images", "log/distances.csv",
        lambda: [b"image,tape_m\ndepth_0.png,0.8\ndepth_1.png,0.8\n", b"tape_cm\n80\n80\n"],
        lambda path: _read(path.parent), share=0.3, prepare=lambda path: _put_images(path, listed=True),
    ),
    Reader("frames of a bag", "log.mcap", lambda: [_frames("mcap")[0]], _read_frames, share=0.3),
    Reader("frames of a ROS 1 bag", "log.bag", lambda: [_frames("ros1")[0]], _read_frames, share=0.3),
    Reader(
        "frames of a sqlite3 bag", "log/log.db3", lambda: [_frames("sqlite3")[0]],
        lambda path: _read_frames(path.parent), share=0.3, prepare=_put_metadata,
    ),
    Reader("cloud of points", "log/0.8m.pcd", _clouds, lambda path: read_cloud(path, "it"), share=0.3),
    Reader("tensors", "a.pt", _tensors, lambda path: read_table(path, CsvOptions(), "it"), share=0.3),
)  # fmt: skip
