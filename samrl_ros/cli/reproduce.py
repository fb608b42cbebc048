"""`samrl reproduce`: every training, table and figure, side by side on what the machine has."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import torch
from rich.console import Console

from samrl_core.common.errors import InputError
from samrl_core.common.files import folder_lock
from samrl_core.studies.job_queue import JobQueue, Machine
from samrl_core.studies.reproduction import Reproduction

SAMRL = (sys.executable, "-m", "samrl_ros.cli.main")


def reproduce_all(
    out: Path, trained: Path | None, only: tuple[str, ...], count: int, steps: int, list_them: bool
) -> int:
    """Run what is left, or list it. After an interrupt the same command goes on.

    Raises:
        InputError: no job has such a name, or the folder cannot be written.
        SolveError: some jobs failed.
        KeyboardInterrupt: interrupted.
    """
    console = Console()
    gpus = range(torch.cuda.device_count())
    memory = tuple(torch.cuda.get_device_properties(gpu).total_memory / 1e9 for gpu in gpus)
    machine = Machine(len(os.sched_getaffinity(0)), memory)
    jobs = Reproduction(out.absolute(), SAMRL, bool(memory), trained, count, steps).jobs()
    if only:
        unknown = [part for part in only if not any(part in job.name for job in jobs)]
        if unknown:
            raise InputError(f"no job's name holds {unknown[0]!r}; `samrl reproduce --list` lists them")
        wanted = {job.name for job in jobs if any(part in job.name for part in only)}
        for job in reversed(jobs):  # what is needed stands before what needs it
            wanted |= set(job.needs) if job.name in wanted else set()
        jobs = [job for job in jobs if job.name in wanted]
    if list_them:
        for job in jobs:
            needs = f"  after {', '.join(job.needs)}" if job.needs else ""
            console.print(f"{job.name}{needs}", highlight=False, soft_wrap=True)
        return 0
    try:
        with folder_lock(out):
            JobQueue(jobs, machine, out.absolute(), lambda line: console.print(line, highlight=False)).run()
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on from {out}", highlight=False)
        raise
    except OSError as error:
        raise InputError(f"cannot write to {out} ({error}); give another --out") from error
    return 0
