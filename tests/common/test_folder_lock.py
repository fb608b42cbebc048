"""Two processes never train in one folder, and a killed one leaves it free."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_core.common.files import folder_lock
from samrl_core.learning.sim.prepare import main
from samrl_core.learning.sim.train import CONFIG, train
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.studies.experiment import Experiment, Options

ROOT = Path(__file__).resolve().parents[2]
HOLDER = """
import subprocess, sys, time
from pathlib import Path
from samrl_core.common.files import folder_lock
with folder_lock(Path(sys.argv[1])):
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], stdout=subprocess.DEVNULL)
    print(child.pid, flush=True)
    time.sleep(float(sys.argv[2]))
child.kill()
"""


def holder(folder: Path, seconds: float) -> tuple[subprocess.Popen[str], int]:
    """A process that holds a folder's lock, and its child, which does not."""
    command = [sys.executable, "-c", HOLDER, str(folder), str(seconds)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, int(process.stdout.readline())


def test_a_second_process_is_told_which_folder(tmp_path: Path) -> None:
    process, child = holder(tmp_path / "new", 60.0)
    try:
        with (
            pytest.raises(InputError, match=f"another process is at work in {tmp_path / 'new'}"),
            folder_lock(tmp_path / "new"),
        ):
            pass
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    os.kill(child, 0)  # it outlives its parent, and keeps nothing
    try:
        with folder_lock(tmp_path / "new", wait_s=5.0):
            pass
    finally:
        os.kill(child, signal.SIGKILL)


def test_it_waits_for_one_that_ends(tmp_path: Path) -> None:
    process, _ = holder(tmp_path, 0.5)
    began = time.monotonic()
    with folder_lock(tmp_path, wait_s=30.0):
        assert time.monotonic() - began > 0.2
    process.wait()


def test_it_is_given_back_when_the_work_fails(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), folder_lock(tmp_path):
        _ = 1 / 0
    with folder_lock(tmp_path), pytest.raises(InputError, match="another process"), folder_lock(tmp_path):
        pass


def test_trainings_data_sets_and_experiments_ask_for_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    experiment = Experiment("nothing", "nothing", ("peg_insertion",), lambda options, tell: {})
    with folder_lock(tmp_path):
        with pytest.raises(InputError, match=f"at work in {tmp_path}"):
            train("peg_insertion", tmp_path, TrainSettings())
        with pytest.raises(InputError, match=f"at work in {tmp_path}"):
            experiment.result(Options(tmp_path), print)
        assert main(["peg_insertion", "--count", "2", "--out", str(tmp_path)]) == 1
        assert f"at work in {tmp_path}" in capsys.readouterr().err
    assert not (tmp_path / CONFIG).exists()
    assert experiment.result(Options(tmp_path), print)["experiment"] == "nothing"


def test_a_second_residual_worker_waits_and_then_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from samrl_core.learning.residual import worker as residual_worker

    monkeypatch.setattr(residual_worker, "BEFORE_S", 0.2)
    monkeypatch.setattr(residual_worker.os, "nice", lambda by: 0)
    monkeypatch.setattr(residual_worker.signal, "signal", lambda number, handler: None)
    monkeypatch.setattr(residual_worker.torch, "set_num_threads", lambda count: None)
    arguments = [str(tmp_path), "--task", "peg_insertion", "--parent", "1"]
    with folder_lock(tmp_path):
        assert residual_worker.main(arguments) == residual_worker.REFUSED
    assert f"at work in {tmp_path}" in capsys.readouterr().err
    assert residual_worker.main(arguments) == residual_worker.REFUSED
    assert "settings.json" in capsys.readouterr().err  # free again: the next thing that is missing
