"""What an experiment is: cases that can be interrupted, and a summary with a picture at the end.

A module of this package defines one `EXPERIMENT`; `registry` names them all, `samrl experiment NAME` runs
them. A case is a dict that JSON can hold, known by its key: a run that was stopped goes on with the keys
that are missing.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.devices import checked_device
from samrl_core.common.errors import InputError
from samrl_core.common.executor import RayCluster, Workers, free_cores, run_calls
from samrl_core.common.files import append_line, folder_lock, keep_to, write_whole

Progress = Callable[[str], None]  # receives a line of progress
Case = dict[str, Any]  # "key" (str), and what was found
CONFIG, CASES, RUNS = "experiment.json", "cases.jsonl", "runs.jsonl"


@dataclass(frozen=True)
class Options:
    """What the command line asks for.

    Raises:
        InputError: a number below its least value, a device or cell that is not there, weights that are no
            folder, or a relative one where other machines shall find it.
    """

    out: Path  # folder of this experiment alone
    tasks: tuple[str, ...] = ()  # none: all that the experiment knows
    count: int = 0  # of episodes or states per condition; 0 takes the experiment's own
    seed: int = 0  # of the first one
    device: str = "cpu"  # torch's name, for batched rendering
    workers: int = 0  # processes; 0 takes the free cores
    weights: Path | None = None  # folder of trained networks, in place of the package's
    conditions: tuple[str, ...] = ()  # of those that it can leave out; none: all of them
    cell: str = DEFAULT_CELL  # arms and camera, by name
    ray: bool = False  # cases on the Ray cluster that `ray.init` finds, in place of processes

    def __post_init__(self) -> None:
        if min(self.count, self.seed, self.workers) < 0:
            raise InputError(
                f"count {self.count}, seed {self.seed} and workers {self.workers} must be at least 0"
            )
        checked_device(self.device)
        cell_named(self.cell)
        if self.weights is not None and not self.weights.is_dir():
            raise InputError(
                f"no folder of networks at {self.weights}; `samrl train TASK --out DIR` makes one"
            )
        if self.ray and self.weights is not None and not self.weights.is_absolute():
            raise InputError(f"weights {self.weights}: other nodes need an absolute path")

    @property
    def processes(self) -> int:
        """How many to use."""
        return self.workers or free_cores()

    @property
    def spread(self) -> Workers:
        """Where cases that do not need each other are run."""
        return RayCluster() if self.ray else self.processes


@dataclass(frozen=True)
class Experiment:
    """One table or figure."""

    name: str
    shows: str  # one line
    tasks: tuple[str, ...]  # that it knows
    run: Callable[[Options, Progress], dict[str, Any]]  # returns the summary; writes `<name>*.png` in `out`
    on_request: tuple[str, ...] = ()  # tasks that it knows, too, and leaves out unless asked for
    conditions: tuple[str, ...] = ()  # that may be asked for without the others; none: it makes them all
    one_machine: bool = False  # its processes need each other

    def result(self, options: Options, progress: Progress) -> dict[str, Any]:
        """Run what is left of it, write `<name>.json`, and add to `runs.jsonl` when and how long it ran.

        Raises:
            InputError: a task or condition that it does not know, Ray for what needs one machine, a folder of
                another experiment, or one in which another process is at work.
        """
        self._must_know("task", options.tasks, (*self.tasks, *self.on_request))
        self._must_know("condition", options.conditions, self.conditions)
        if options.ray and self.one_machine:
            raise InputError(f"{self.name} needs all its processes on one machine; leave --ray out")
        options = replace(options, tasks=options.tasks or self.tasks)
        with folder_lock(options.out):
            free = ("out", "device", "workers", "conditions", "ray")  # may differ when it goes on
            asked = {k: v for k, v in asdict(options).items() if k not in free}
            wanted, before = {"experiment": self.name, **asked}, {"cell": DEFAULT_CELL}
            keep_to(options.out / CONFIG, wanted, "experiment", {}, before)
            began, clock, load = datetime.now(UTC), time.perf_counter(), os.getloadavg()[0]
            summary = {
                "schema": 1,
                "experiment": self.name,
                "seed": options.seed,
                **self.run(options, progress),
            }
            write_whole(options.out / f"{self.name}.json", json.dumps(summary, indent=1) + "\n")
            run = {
                "began": began.isoformat(timespec="seconds"),
                "wall_s": round(time.perf_counter() - clock, 1),
                "workers": options.processes,
                "cores": os.cpu_count(),
                "load_before": load,  # others' runnable processes, mean of a minute
                "load_after": os.getloadavg()[0],
                "conditions": list(options.conditions),
            }
            append_line(options.out / RUNS, json.dumps(run))
        return summary

    def _must_know(self, what: str, asked: Sequence[str], known: Sequence[str]) -> None:
        unknown = [name for name in asked if name not in known]
        if unknown:
            there = ", ".join(known) or f"none to choose from, leave {what}s out"
            raise InputError(f"{self.name} knows no {what} {unknown[0]!r}; there are: {there}")


class CaseLog:
    """Cases of one folder, a line each, written as soon as they are known."""

    def __init__(self, folder: Path) -> None:
        """Reads what is there; a last line that was cut off is left out and written over.

        Raises:
            InputError: another line cannot be read.
        """
        self._path = folder / CASES
        self.cases: dict[str, Case] = {}
        whole = 0
        content = self._path.read_bytes() if self._path.is_file() else b""
        for number, line in enumerate(content.splitlines(keepends=True), 1):
            try:
                case = json.loads(line)
                self.cases[case["key"]] = case
            except (ValueError, TypeError, KeyError) as problem:
                if line.endswith(b"\n"):
                    raise InputError(
                        f"{self._path}, line {number}: {problem}; use another --out"
                    ) from problem
                break
            whole += len(line)
        if whole < len(content):
            os.truncate(self._path, whole)

    def keep(self, case: Case) -> None:
        """Add one; it is on the disk when this returns."""
        append_line(self._path, json.dumps(case))
        self.cases[case["key"]] = case


def run_cases(
    log: CaseLog,
    work: Callable[[Any], list[Case]],
    jobs: Sequence[tuple[Sequence[str], Any]],
    workers: Workers,
    progress: Progress,
) -> list[Case]:
    """Every case of the jobs, in their order; jobs whose cases are all known are not run again.

    Args:
        log: keeps them.
        work: of the top level of a module: one job's cases, in a process of its own or on Ray, if asked for.
        jobs: for each the keys of its cases, and what `work` gets.
        workers: processes, or Ray.
        progress: called with each case.
    """
    keys = [key for of_job, _ in jobs for key in of_job]
    left = [job for of_job, job in jobs if not all(key in log.cases for key in of_job)]

    def take(found: Iterable[Case]) -> None:
        for case in found:
            if case["key"] not in log.cases:
                log.keep(case)
                known = sum(key in log.cases for key in keys)
                progress(f"{known}/{len(keys)}  {case['key']}  {_words(case)}")

    for done in run_calls([partial(work, job) for job in left], workers):
        take(done.result)
    return [log.cases[key] for key in keys]


def _words(case: Case) -> str:
    shown = {k: v for k, v in case.items() if k != "key" and isinstance(v, bool | int | float | str)}
    return "  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in shown.items())
