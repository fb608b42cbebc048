"""Commands that need each other, run side by side on one machine's cores and GPUs.

Each makes one file when it is done, and goes on from its own folder when it was stopped: so a queue that is
started again runs what is left, and needs no memory of its own.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.errors import InputError, SolveError
from samrl_core.common.files import room_for

Progress = Callable[[str], None]  # receives a line of progress
DEVICE, WORKERS = "{device}", "{workers}"  # in a command: filled in when it starts
STOP_S = 10.0  # for commands that are interrupted to end by themselves
OVERBOOKED = 1.5  # times the cores: no command keeps all its processes busy all the time


@dataclass(frozen=True)
class CommandJob:
    """One command."""

    name: str
    command: tuple[str, ...]
    makes: Path  # there when it is done, and not before
    needs: tuple[str, ...] = ()  # names of jobs that must be done first
    gpu_gb: float = 0.0  # of one GPU that it keeps; 0: it shares whatever there is
    share: float = 1.0  # of the cores, that its processes are meant for
    then: Callable[[], None] | None = None  # once it is done


@dataclass(frozen=True)
class Resources:
    """What there is to share out."""

    cores: int
    gpu_gb: tuple[float, ...] = ()  # memory of each GPU

    def __post_init__(self) -> None:
        if self.cores < 1:
            raise InputError(f"{self.cores} cores, must be at least 1")

    def workers(self, job: CommandJob) -> int:
        """Processes for a job."""
        return max(1, round(job.share * self.cores))


@dataclass(eq=False)
class _Running:
    job: CommandJob
    process: subprocess.Popen[bytes]
    gpu: int  # that it keeps, -1 for none
    began: float


class JobQueue:
    """One run of a list of jobs.

    Raises:
        InputError: two jobs have the same name, or one needs a job that is not there.
    """

    def __init__(
        self, jobs: Sequence[CommandJob], resources: Resources, folder: Path, progress: Progress
    ) -> None:
        """`folder`: where the commands run; their output goes to `logs/NAME.log` in it."""
        names = [job.name for job in jobs]
        for job in jobs:
            if names.count(job.name) > 1:
                raise InputError(f"two jobs are named {job.name!r}")
            missing = [name for name in job.needs if name not in names]
            if missing:
                raise InputError(f"job {job.name!r} needs {missing[0]!r}, which is not in the list")
        self._left, self._resources, self._folder, self._progress = list(jobs), resources, folder, progress
        self._running: list[_Running] = []
        self._done: set[str] = set()
        self._failed: list[str] = []

    def run(self, poll_s: float = 0.5) -> None:
        """All jobs that are not done; whatever ends this ends the commands.

        Raises:
            SolveError: some failed; the others have been run, but for those that need one of them.
        """
        (self._folder / "logs").mkdir(parents=True, exist_ok=True)
        try:
            while self._left or self._running:
                self._reap()
                self._drop_needy()
                self._start()
                if self._running:
                    time.sleep(poll_s)
        finally:
            self._interrupt()
        if self._failed:
            raise SolveError(
                f"failed: {', '.join(self._failed)}; see {self._folder / 'logs'}, and start again to go on"
            )

    def _start(self) -> None:
        for job in list(self._left):
            if job.makes.exists():
                self._left.remove(job)
                self._finish(job, "was done before")
            elif all(name in self._done for name in job.needs):
                gpu = self._gpu_for(job)
                if gpu is not None and self._has_cores(job):
                    self._left.remove(job)
                    self._running.append(self._started(job, gpu))

    def _started(self, job: CommandJob, gpu: int) -> _Running:
        device = "cpu" if not self._resources.gpu_gb else "cuda" if gpu < 0 else f"cuda:{gpu}"
        filled = {DEVICE: device, WORKERS: str(self._resources.workers(job))}
        command = [filled.get(part, part) for part in job.command]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        if device == "cpu" or DEVICE not in job.command:
            environment["CUDA_VISIBLE_DEVICES"] = ""
        path = self._folder / "logs" / f"{job.name}.log"
        with room_for(path), path.open("ab") as log:
            process = subprocess.Popen(
                command,
                cwd=self._folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # a terminal's Ctrl-C reaches this process, which passes it on
                preexec_fn=ends_with_parent(signal.SIGINT),
            )
        self._progress(f"{job.name}: started, {filled[WORKERS]} processes, {device}")
        return _Running(job, process, gpu, time.monotonic())

    def _reap(self) -> None:
        for one in list(self._running):
            code = one.process.poll()
            if code is None:
                continue
            self._running.remove(one)
            minutes = (time.monotonic() - one.began) / 60.0
            if code == 0 and one.job.makes.exists():
                self._finish(one.job, f"done in {minutes:.1f} min")
            else:
                self._failed.append(one.job.name)
                self._progress(f"{one.job.name}: failed with code {code} after {minutes:.1f} min")

    def _finish(self, job: CommandJob, how: str) -> None:
        if job.then is not None:
            job.then()
        self._done.add(job.name)
        self._progress(f"{job.name}: {how}")

    def _drop_needy(self) -> None:
        for job in list(self._left):
            lost = [name for name in job.needs if name in self._failed]
            if lost:
                self._left.remove(job)
                self._failed.append(job.name)
                self._progress(f"{job.name}: left out, {lost[0]} failed")

    def _gpu_for(self, job: CommandJob) -> int | None:
        """The GPU with most memory left, -1 where none is needed, None while there is not enough."""
        sizes = self._resources.gpu_gb
        if not sizes or not job.gpu_gb:
            return -1
        left = list(sizes)
        for one in self._running:
            if one.gpu >= 0:
                left[one.gpu] -= one.job.gpu_gb
        best = max(range(len(left)), key=left.__getitem__)
        alone = not any(one.gpu == best for one in self._running)
        return best if left[best] >= job.gpu_gb or alone else None

    def _has_cores(self, job: CommandJob) -> bool:
        used = sum(self._resources.workers(one.job) for one in self._running)
        return not used or used + self._resources.workers(job) <= OVERBOOKED * self._resources.cores

    def _interrupt(self) -> None:
        for one in self._running:
            one.process.send_signal(signal.SIGINT)
        end = time.monotonic() + STOP_S
        for one in self._running:
            try:
                one.process.wait(max(0.1, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                one.process.kill()
                one.process.wait()
