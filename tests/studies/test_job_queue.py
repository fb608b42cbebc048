"""Jobs run when what they need is done, within what the machine has, and end with their queue."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError, SolveError
from samrl_core.studies.job_queue import DEVICE, WORKERS, CommandJob, JobQueue, Resources

MAKE = """
import os, sys, time
from pathlib import Path
name, device, workers, wait = sys.argv[1:5]
begin = time.monotonic()
time.sleep(float(wait))
hidden = os.environ.get("CUDA_VISIBLE_DEVICES")
Path(name).write_text(f"{device} {workers} {begin} {time.monotonic()} {hidden}")
"""


def job(folder: Path, name: str, wait: float = 0.0, **more) -> CommandJob:
    command = (sys.executable, "-c", MAKE, name, DEVICE, WORKERS, str(wait))
    return CommandJob(name, command, folder / name, **more)


def found(folder: Path, name: str) -> tuple[str, int, float, float, str]:
    device, workers, begin, end, hidden = (folder / name).read_text().split(" ")
    return device, int(workers), float(begin), float(end), hidden


def run(jobs: list[CommandJob], folder: Path, resources: Resources) -> list[str]:
    told: list[str] = []
    JobQueue(jobs, resources, folder, told.append).run(0.02)
    return told


def test_a_job_waits_for_what_it_needs_and_learns_what_came_of_it(tmp_path: Path) -> None:
    after: list[str] = []
    jobs = [
        job(tmp_path, "second", needs=("first",), share=0.5),
        job(tmp_path, "first", 0.2, then=lambda: after.append("first")),
    ]
    told = run(jobs, tmp_path, Resources(4))
    assert found(tmp_path, "first")[3] < found(tmp_path, "second")[2]
    assert found(tmp_path, "first")[:2] == ("cpu", 4) and found(tmp_path, "second")[:2] == ("cpu", 2)
    assert after == ["first"] and [line.split(":")[0] for line in told] == ["first", "first"] + 2 * ["second"]
    told = run(jobs, tmp_path, Resources(4))  # once more: nothing is left, what follows a job is done again
    assert all("before" in line for line in told) and after == ["first", "first"]


def test_gpus_are_shared_by_their_memory(tmp_path: Path) -> None:
    """Two that do not fit beside each other take two GPUs, a third one waits; who keeps none sees all."""
    big = [job(tmp_path, f"big{k}", 0.4, gpu_gb=60.0, share=0.1) for k in range(3)]
    small = job(tmp_path, "small", gpu_gb=30.0, share=0.1)
    loose = job(tmp_path, "loose", share=0.1)
    blind = CommandJob(
        "blind", (sys.executable, "-c", MAKE, "blind", "-", "1", "0"), tmp_path / "blind", share=0.1
    )
    run([*big, small, loose, blind], tmp_path, Resources(8, (100.0, 100.0)))
    devices = {one.name: found(tmp_path, one.name) for one in (*big, small, loose, blind)}
    assert {devices["big0"][0], devices["big1"][0]} == {"cuda:0", "cuda:1"}
    assert devices["big2"][2] >= min(devices["big0"][3], devices["big1"][3])
    assert devices["small"][3] < devices["big2"][3] and devices["loose"][0] == "cuda"
    assert devices["blind"][4] == "" and devices["loose"][4] != ""


def test_what_needs_a_failed_job_is_left_out(tmp_path: Path) -> None:
    bad = CommandJob("bad", (sys.executable, "-c", "raise SystemExit(3)"), tmp_path / "bad")
    lazy = CommandJob(
        "lazy", (sys.executable, "-c", "pass"), tmp_path / "lazy"
    )  # ends well and makes nothing
    jobs = [bad, lazy, job(tmp_path, "child", needs=("bad",)), job(tmp_path, "grandchild", needs=("child",))]
    with pytest.raises(SolveError, match="start again") as failed:
        run([*jobs, job(tmp_path, "other")], tmp_path, Resources(1))
    assert (tmp_path / "other").exists() and not (tmp_path / "child").exists()
    assert all(one.name in str(failed.value) for one in jobs) and "other" not in str(failed.value)


def test_commands_end_with_their_queue(tmp_path: Path) -> None:
    """Interrupted once a command runs: it is gone when `run` has been left."""
    code = "import os; from pathlib import Path; Path('pid').write_text(str(os.getpid())); import time; "
    jobs = [CommandJob("long", (sys.executable, "-c", f"{code} time.sleep(60)"), tmp_path / "never")]

    def interrupt(line: str) -> None:
        end = time.monotonic() + 20.0
        while not (tmp_path / "pid").exists() and time.monotonic() < end:
            time.sleep(0.02)
        if line.startswith("second"):
            raise KeyboardInterrupt

    jobs.append(job(tmp_path, "second", share=0.5))
    with pytest.raises(KeyboardInterrupt):
        JobQueue(jobs, Resources(4), tmp_path, interrupt).run(0.02)
    pid = int((tmp_path / "pid").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_lists_that_cannot_be_run_are_refused(tmp_path: Path) -> None:
    one = job(tmp_path, "one")
    with pytest.raises(InputError, match="two jobs are named 'one'"):
        JobQueue([one, one], Resources(1), tmp_path, print)
    with pytest.raises(InputError, match="'one' needs 'none'"):
        JobQueue([replace(one, needs=("none",))], Resources(1), tmp_path, print)
    with pytest.raises(InputError, match="0 cores"):
        Resources(0)
