"""Data sets of labelled states: made, resumed after a kill to the same bytes, and loaded."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.learning.sim.prepare import free_cores, load_states, main, prepare_states
from samrl_core.learning.sim.sample_states import StateSource
from samrl_core.learning.states.explore import ExploreSettings, Starts
from tests.waiting import wait_for

ROOT = Path(__file__).resolve().parents[3]
TASK = "peg_insertion"
SMALL = StateSource(ExploreSettings(slots=2, longest=6))


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir()}


@pytest.mark.thorough
def test_a_killed_run_resumes_to_the_same_bytes(tmp_path: Path) -> None:
    """SIGKILL while shards are being made."""
    arguments = (
        "from pathlib import Path; from samrl_core.learning.states.explore import ExploreSettings\n"
        "from samrl_core.learning.sim.prepare import prepare_states\n"
        "from samrl_core.learning.sim.sample_states import StateSource\n"
        f"prepare_states({TASK!r}, 40, Path({str(tmp_path / 'killed')!r}), 7, 1, "
        "StateSource(ExploreSettings(slots=2, longest=6)), shard_size=8)"
    )
    process = subprocess.Popen([sys.executable, "-c", arguments], cwd=ROOT)
    try:
        folder = tmp_path / "killed"
        wait_for(
            lambda: len(list(folder.glob("*.npz"))) >= 2 or process.poll() is not None, "two shards", 0.01
        )
    finally:
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
        process.wait()
    made: list[int] = []

    def watch(done: int, wanted: int) -> None:
        assert wanted == 40
        made.append(done)

    prepare_states(TASK, 40, tmp_path / "killed", 7, 1, SMALL, shard_size=8, progress=watch)
    assert made[0] >= 8 and made[-1] == 40, "what was made before is not made again"
    prepare_states(TASK, 40, tmp_path / "whole", 7, 1, SMALL, shard_size=8)
    whole = contents(tmp_path / "whole")
    assert len(whole) == 6
    killed = contents(tmp_path / "killed")
    assert {k: v for k, v in killed.items() if not k.endswith(".half")} == whole


@pytest.mark.slow
def test_processes_make_the_same_data_set(tmp_path: Path) -> None:
    one = prepare_states(TASK, 12, tmp_path / "one", 7, 1, SMALL, shard_size=4)
    prepare_states(TASK, 12, tmp_path / "two", 7, 2, SMALL, shard_size=4)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    loaded = load_states(tmp_path / "two", TASK)
    assert len(loaded) == 12
    np.testing.assert_array_equal(loaded.action, one.action)
    few = loaded.rows(np.array([3, 1]))
    np.testing.assert_array_equal(few.values, loaded.values[[3, 1]])


def test_another_seed_or_start_is_another_data_set(tmp_path: Path) -> None:
    prepare_states(TASK, 4, tmp_path, 7, 1, SMALL)
    with pytest.raises(InputError, match="its seed is 7, must be 8"):
        prepare_states(TASK, 4, tmp_path, 8, 1, SMALL)
    given = Starts(np.array([[0.5, 0.0]]), np.array([[0.5, 0.0, 0.1]]))
    with pytest.raises(InputError, match="its settings"):
        prepare_states(TASK, 4, tmp_path, 7, 1, StateSource(SMALL.explore, given))


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([TASK, "--count", "6", "--out", str(tmp_path), "--seed", "1", "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    assert "6 of 6 states" in printed and "reach their sub-goal" in printed
    assert main([TASK, "--count", "7", "--out", str(tmp_path), "--workers", "1"]) == 1
    assert "another data set" in capsys.readouterr().err
    assert main(["no_task", "--out", str(tmp_path / "other")]) == 1
    assert "no task is named" in capsys.readouterr().err
    assert free_cores() >= 1
