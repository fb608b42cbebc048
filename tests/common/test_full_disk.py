"""A disk without room: path, free bytes and remedy are named, and nothing is left half-written."""

from __future__ import annotations

import errno
import os
import resource
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.common.array_file import write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.figure_file import save_figure
from samrl_core.common.files import append_line, keep_to, room_for, write_whole
from samrl_core.learning.data.checkpoint import save_checkpoint
from samrl_core.learning.residual.replay import Replay, ReplayInfo, ReplayStep
from samrl_core.studies.experiment import CaseLog
from samrl_ros.cell.reserve import Reserve
from samrl_ros.cell.summary import write_json
from samrl_ros.cli import commands, main
from samrl_ros.log_import.imported_files import write_imported

LIMIT = 40_000  # [bytes]
NOISE = np.random.default_rng(0).normal(size=20_000)  # no packing makes it small
LONG = "x" * (LIMIT + 1)


@contextmanager
def no_room() -> Generator[None]:
    """No file may grow past `LIMIT`; the system answers as it does where the disk is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def draw(path: Path) -> None:
    figure = Figure()
    figure.add_subplot().plot(NOISE, "x")
    save_figure(figure, path, dpi=300)


WRITERS: dict[str, Callable[[Path], object]] = {
    "notes.txt": lambda path: write_whole(path, LONG),
    "log.csv": lambda path: append_line(path, LONG),
    "summary.json": lambda path: write_json(path, {"long": LONG}),
    "arrays.npz": lambda path: write_arrays(path, {"noise": NOISE}),
    "picture.png": draw,
    "state.safetensors": lambda path: save_checkpoint(path, "x", {"noise": torch.from_numpy(NOISE)}, {}),
    "settings.json": lambda path: keep_to(path, {"long": LONG}, "training", {}),
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("there", [False, True])
def test_a_writer_refuses_and_leaves_what_was_there(name: str, there: bool, tmp_path: Path) -> None:
    path = tmp_path / name
    if there and name != "settings.json":
        path.write_bytes(b"as it was\n")
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with no_room(), pytest.raises(InputError) as refused:
        WRITERS[name](path)
    free = os.statvfs(tmp_path).f_bavail
    text = str(refused.value)
    assert str(path) in text and f"bytes are free at {tmp_path}" in text and free > 0
    assert "Make room" in text and "another disk" in text
    after = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert {k: v for k, v in after.items() if v} == before


def test_a_case_that_does_not_fit_leaves_the_others(tmp_path: Path) -> None:
    log = CaseLog(tmp_path)
    log.keep({"key": "a", "value": 1})
    with no_room(), pytest.raises(InputError, match="cannot write"):
        log.keep({"key": "b", "value": LONG})
    assert set(CaseLog(tmp_path).cases) == {"a"}


def test_a_replay_s_slot_without_room_is_refused_before_it_is_filled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "replay"
    info = ReplayInfo("peg_insertion", Intrinsics(64, 64, 60.0, 60.0, 32.0, 32.0), 8)
    replay = Replay.write(path, info)
    blocks = path.stat().st_blocks
    replay._take_room(8)
    assert path.stat().st_blocks > blocks  # the file is sparse, and has this slot's room now
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(InputError, match=f"cannot write {path}.*bytes are free"):
        replay.append(step())
    assert len(replay) == 0 and replay.last == 0
    replay.close()


def step() -> ReplayStep:
    return ReplayStep(
        episode=1,
        step=0,
        color=np.zeros((64, 64, 3), np.uint8),
        depth=np.ones((64, 64)),
        camera_in_world=Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])),
        tip_in_base=np.zeros(3),
        nominal=np.zeros(3),
        residual=np.zeros(3),
        executed=np.zeros(3),
    )


def test_what_is_no_lack_of_room_passes(tmp_path: Path) -> None:
    with pytest.raises(PermissionError), room_for(tmp_path):
        raise PermissionError(errno.EACCES, "no", str(tmp_path))


def test_a_run_keeps_room_for_its_summary(tmp_path: Path) -> None:
    with no_room(), pytest.raises(InputError, match=str(tmp_path)):
        Reserve(tmp_path)
    reserve = Reserve(tmp_path)
    reserve.give_up()
    reserve.give_up()
    assert not list(tmp_path.iterdir())


def test_a_library_s_own_writer_shows_no_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(**_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(commands, "app", full)
    assert main.run(["effects"]) == 3
    assert "No space left on device" in (said := capsys.readouterr().err) and "bytes are free at" in said


def test_an_import_without_room_leaves_nothing(tmp_path: Path) -> None:
    """Recordings without their index would be read as if all of them could be fitted."""
    made = [SimpleNamespace(recording=SimpleNamespace(name=n), role="fit") for n in "ab"]
    sizes = {"a": 10, "b": LIMIT + 1}
    kept = tmp_path / "mine"
    kept.mkdir()
    (kept / "notes.txt").write_text("mine")
    for out in (tmp_path / "new", kept):
        with no_room(), pytest.raises(InputError, match=r"b\.txt: File too large; \d+ bytes are free"):
            write_imported(
                made, out, ".txt", lambda each, file: write_whole(file, "x" * sizes[each.recording.name])
            )
    assert sorted(tmp_path.rglob("*")) == [kept, kept / "notes.txt"]
