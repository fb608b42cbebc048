"""The replay on disk: what is written is read, a kill costs one step at most, strangers are refused."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.learning.residual.replay import HEADER_BYTES, End, Replay, ReplayInfo, ReplayStep
from samrl_core.learning.residual.transitions import transitions_of
from tests.learning.small_cell import SMALL, random_step

INFO = ReplayInfo("peg_insertion", SMALL.intrinsics, 8)


def filled(path: Path, ends: list[End], info: ReplayInfo = INFO) -> Replay:
    """Episodes one after another; every list item is the end that its step is given."""
    replay = Replay.write(path, info)
    episode = step = 0
    for k, end in enumerate(ends):
        number = replay.append(random_step(np.random.default_rng(k), episode, step))
        replay.end_episode(number, end)
        episode, step = (episode, step + 1) if end == End.OPEN else (episode + 1, 0)
    return replay


def test_what_was_written_is_read_by_another_and_after_a_restart(tmp_path: Path) -> None:
    path = tmp_path / "replay"
    writer = Replay.write(path, INFO)
    reader = Replay.read(path, INFO)
    steps = [random_step(np.random.default_rng(k), 0, k) for k in range(3)]
    numbers = [writer.append(step) for step in steps]
    assert numbers == [1, 2, 3] and len(reader) == 0
    assert reader.refresh() == 3 and len(reader) == 3 and reader.refresh() == 0
    writer.close()
    again = Replay.write(path, INFO)
    assert again.next_episode() == 1
    for replay in (reader, again):
        for row, step in zip(replay.bodies(np.array(numbers)), steps, strict=True):
            assert np.array_equal(row["color"], step.color)
            known = np.isfinite(step.depth)
            assert np.array_equal(row["depth"] > 0, known)
            assert np.allclose(row["depth"][known] * 1e-4, step.depth[known], atol=5.1e-5)
            for name in ("nominal", "residual", "executed"):
                assert np.array_equal(row[name], getattr(step, name))
            assert np.array_equal(row["tip"], step.tip_in_base)


def test_two_that_find_no_replay_at_once_share_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second one makes its file while the first one already writes: it gets that one's, or a refusal."""
    path, link, writers = tmp_path / "replay", os.link, []

    def overtaken(half: Path, whole: Path) -> None:
        monkeypatch.setattr(os, "link", link)
        writers.append(filled(path, [End.OPEN]))
        link(half, whole)

    monkeypatch.setattr(os, "link", overtaken)
    with pytest.raises(InputError, match="is being written by another process"):
        Replay.write(path, INFO)
    assert len(Replay.read(path, INFO)) == 1
    assert [f.name for f in tmp_path.iterdir()] == ["replay"]


def test_the_ring_keeps_the_newest(tmp_path: Path) -> None:
    replay = filled(tmp_path / "replay", [End.OPEN] * 21)
    assert replay.present().tolist() == list(range(14, 22))
    with pytest.raises(InputError, match="overwritten"):
        replay.bodies(np.array([13]))
    with pytest.raises(InputError, match="not in the replay"):
        replay.end_episode(13, End.SUCCESS)
    assert Replay.read(replay.path, INFO).present().tolist() == list(range(14, 22))


def test_transitions_end_as_their_episodes_do(tmp_path: Path) -> None:
    o, success, failure, cut = End.OPEN, End.SUCCESS, End.FAILURE, End.CUT
    replay = filled(tmp_path / "replay", [o, o, success, o, failure, o, cut, o])
    one = transitions_of(replay, 1, 0.9)
    assert one.start.tolist() == [1, 2, 3, 4, 5, 6]  # 7 was cut, what follows 8 is not known yet
    assert one.after.tolist() == [2, 3, 3, 5, 5, 7]
    assert one.reward.tolist() == [0, 0, 1, 0, 0, 0]
    assert one.discount == pytest.approx([0.9, 0.9, 0, 0.9, 0, 0.9])
    three = transitions_of(replay, 3, 0.9)
    assert three.start.tolist() == one.start.tolist()
    assert three.reward == pytest.approx([0.81, 0.9, 1, 0, 0, 0])
    assert three.discount == pytest.approx([0, 0, 0, 0, 0, 0.9])


def test_a_step_that_was_missed_is_not_bridged(tmp_path: Path) -> None:
    replay = Replay.write(tmp_path / "replay", INFO)
    for step in (0, 1, 3):
        replay.append(random_step(np.random.default_rng(step), 0, step))
    assert transitions_of(replay, 3, 0.9).start.tolist() == [1]


WRITER = """
import sys
from pathlib import Path
import numpy as np
from samrl_core.learning.residual.replay import Replay, ReplayInfo
from tests.learning.small_cell import SMALL, random_step
replay = Replay.write(Path(sys.argv[1]), ReplayInfo("peg_insertion", SMALL.intrinsics, 64))
step = random_step(np.random.default_rng(0), 0, 0)
while True:
    print(replay.append(step), flush=True)
"""


@pytest.mark.thorough
@pytest.mark.parametrize("after", [20, 150])
def test_a_killed_writer_loses_one_step_at_most(tmp_path: Path, after: int) -> None:
    path = tmp_path / "replay"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    said = 0
    while said < after:
        said = int(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    rest = process.stdout.read().split()
    process.wait()
    said = max([said, *(int(word) for word in rest)])
    replay = Replay.write(path, ReplayInfo("peg_insertion", SMALL.intrinsics, 64))
    assert said <= replay.last <= said + 1
    assert len(replay) >= min(said, 63)
    assert replay.append(random_step(np.random.default_rng(1), 1, 0)) == replay.last


@pytest.mark.parametrize("wrapped", [False, True])
def test_a_torn_step_is_the_only_one_lost(tmp_path: Path, wrapped: bool) -> None:
    path = tmp_path / "replay"
    count = 11 if wrapped else 5
    filled(path, [End.OPEN] * count).close()
    tear(path, count % INFO.capacity)
    replay = Replay.write(path, INFO)
    assert replay.last == count and len(replay) == (7 if wrapped else 5)
    assert replay.append(random_step(np.random.default_rng(0), 5, 0)) == count + 1
    replay.close()
    assert len(Replay.read(path, INFO)) == (8 if wrapped else 6)


def tear(path: Path, slot: int) -> None:
    """As a writer leaves a slot that is killed in the middle of it."""
    with path.open("r+b") as file:
        file.seek(HEADER_BYTES + slot * INFO.slot_type().itemsize)
        file.write(np.int64(-1).tobytes())
        file.seek(300, os.SEEK_CUR)
        file.write(b"half of a new step")


def test_a_corrupt_replay_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "replay"
    filled(path, [End.OPEN] * 5).close()
    whole = path.read_bytes()
    size = INFO.slot_type().itemsize
    flipped = bytearray(whole)
    flipped[HEADER_BYTES + 2 * size + 400] ^= 1
    emptied = bytearray(whole)
    emptied[HEADER_BYTES + size : HEADER_BYTES + 2 * size] = bytes(size)
    for bad, why in (
        (bytes(flipped), "corrupt"),
        (bytes(emptied), "corrupt"),
        (whole[:-1], "cut short"),
        (whole + b"x", "cut short or grown"),
        (b"x" + whole[1:], "no replay"),
        (whole[:100], "wanted is|cut short"),
        (b"", "no replay"),
    ):
        path.write_bytes(bad)
        for open_it in (Replay.write, Replay.read):
            with pytest.raises(InputError, match=why):
                open_it(path, INFO)
        assert path.read_bytes() == bad


def test_a_foreign_replay_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "replay"
    filled(path, [End.OPEN]).close()
    other_camera = replace(SMALL.intrinsics, fx=SMALL.intrinsics.fx + 1)
    for info in (
        replace(INFO, task="needle_threading"),
        replace(INFO, intrinsics=other_camera),
        replace(INFO, capacity=9),
    ):
        with pytest.raises(InputError, match="belongs to one task"):
            Replay.write(path, info)
    with pytest.raises(InputError, match="no replay at"):
        Replay.read(tmp_path / "nothing", INFO)


def test_two_writers_are_one_too_many(tmp_path: Path) -> None:
    replay = Replay.write(tmp_path / "replay", INFO)
    with pytest.raises(InputError, match="another process"):
        Replay.write(tmp_path / "replay", INFO)
    replay.close()
    Replay.write(tmp_path / "replay", INFO).close()


def test_a_step_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    replay = Replay.write(tmp_path / "replay", INFO)
    good: ReplayStep = random_step(np.random.default_rng(0), 0, 0)
    for bad in (
        replace(good, nominal=np.array([0.0, np.nan, 0.0])),
        replace(good, residual=np.zeros(2)),
        replace(good, color=good.color[1:]),
        replace(good, depth=-good.depth),
    ):
        with pytest.raises(InputError):
            replay.append(bad)
    assert len(replay) == 0


def test_the_newest_steps_can_be_forgotten(tmp_path: Path) -> None:
    """Numbers and episodes go on from there, also after the file was opened anew; never into what is gone."""
    info = ReplayInfo("toy", SMALL.intrinsics, 8)
    replay = Replay.write(tmp_path / "replay.bin", info)
    rng = np.random.default_rng(0)
    steps = [random_step(rng, k // 2, k % 2) for k in range(6)]
    for step in steps:
        replay.append(step)
    replay.drop_after(7)
    assert replay.last == 6
    replay.drop_after(3)
    replay.close()
    replay = Replay.write(tmp_path / "replay.bin", info)
    assert replay.last == len(replay) == 3 and replay.next_episode() == 2
    assert replay.append(steps[5]) == 4
    assert np.array_equal(replay.bodies(np.array([4]))["color"][0], steps[5].color)
    for step in steps:
        replay.append(step)  # the ring goes round
    with pytest.raises(InputError, match="cannot go back"):
        replay.drop_after(9)
    replay.drop_after(10)
    assert len(replay) == 8
    replay.close()
