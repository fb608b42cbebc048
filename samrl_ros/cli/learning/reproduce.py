"""`samrl reproduce`: every training, table and figure, side by side on what the machine has."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import torch
import typer
from rich.console import Console

from samrl_core.common.errors import InputError
from samrl_core.common.files import folder_lock
from samrl_core.studies.job_queue import JobQueue, Resources
from samrl_core.studies.reproduction import Reproduction

SAMRL = (sys.executable, "-m", "samrl_ros.cli.main")


@dataclass(frozen=True)
class ReproduceOptions:
    """Options of `samrl reproduce`."""

    out: Annotated[Path, typer.Option(help="Folder of everything that is made. Goes on from it.")] = Path(
        "out/reproduce"
    )
    trained: Annotated[
        Path | None,
        typer.Option(help="Networks that need not be trained, as msgs_docs/training has them."),
    ] = None
    only: Annotated[
        tuple[str, ...], typer.Option(help="Jobs whose name holds this, and what they need; repeatable.")
    ] = ()
    count: Annotated[
        int, typer.Option(help="Episodes or states per condition; 0: each experiment's own.", min=0)
    ] = 0
    steps: Annotated[int, typer.Option(help="Real steps of sample_efficiency; 0: its own.", min=0)] = 0
    ray: Annotated[
        bool, typer.Option("--ray", help="Episodes on a Ray cluster with this folder (extra cluster).")
    ] = Reproduction.ray
    list_them: Annotated[bool, typer.Option("--list", help="List the jobs and run none.")] = False


def reproduce_all(options: ReproduceOptions) -> int:
    """Run what is left, or list it. After an interrupt the same command goes on.

    Raises:
        InputError: no job has such a name, or the folder cannot be written.
        SolveError: some jobs failed.
        KeyboardInterrupt: interrupted.
    """
    console, out, only = Console(), options.out.absolute(), options.only
    gpus = range(torch.cuda.device_count())
    memory = tuple(torch.cuda.get_device_properties(gpu).total_memory / 1e9 for gpu in gpus)
    resources = Resources(len(os.sched_getaffinity(0)), memory)
    jobs = Reproduction(
        out, SAMRL, bool(memory), options.trained, options.count, options.steps, options.ray
    ).jobs()
    if only:
        unknown = [part for part in only if not any(part in job.name for job in jobs)]
        if unknown:
            raise InputError(f"no job's name holds {unknown[0]!r}; `samrl reproduce --list` lists them")
        wanted = {job.name for job in jobs if any(part in job.name for part in only)}
        for job in reversed(jobs):  # what is needed stands before what needs it
            wanted |= set(job.needs) if job.name in wanted else set()
        jobs = [job for job in jobs if job.name in wanted]
    if options.list_them:
        for job in jobs:
            needs = f"  after {', '.join(job.needs)}" if job.needs else ""
            console.print(f"{job.name}{needs}", highlight=False, soft_wrap=True)
        return 0
    try:
        with folder_lock(out):
            JobQueue(jobs, resources, out, lambda line: console.print(line, highlight=False)).run()
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on from {options.out}", highlight=False)
        raise
    except OSError as error:
        raise InputError(f"cannot write to {options.out} ({error}); give another --out") from error
    return 0
