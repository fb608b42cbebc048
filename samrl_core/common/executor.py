"""The same work on many items: in this process, in worker processes, in threads, or on a Ray cluster.

Results come as they are ready. What has not begun when the caller stops, by an error or an interrupt, never
begins; what is finished is the caller's to keep, so that the same command goes on from there.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from samrl_core.common.child_process import end_with
from samrl_core.common.errors import InputError, SolveError

NODES_LOST = 3  # under one item of work, before it is given up


@dataclass(frozen=True)
class Done:
    """One item's end: its result, or the error that it raised."""

    index: int  # in the items that were handed in
    item: Any
    result: Any = None
    error: BaseException | None = None


@dataclass(frozen=True)
class RayCluster:
    """In place of a number of worker processes: the Ray cluster that `ray.init` finds."""


Workers = int | RayCluster


def run_calls(calls: Sequence[Callable[[], Any]], workers: Workers) -> Iterator[Done]:
    """Calls without arguments (`functools.partial`), in so many processes, one by one in this one, or on Ray.

    The first error ends the rest.

    Raises:
        Exception: what a call raised.
        SolveError: a worker process was ended from outside.
    """
    if isinstance(workers, RayCluster):
        for done in run_on_ray(_call, calls, 0):
            if done.error is not None:
                raise done.error
            yield done
        return
    workers = min(workers, len(calls))
    if workers <= 1:
        for index, call in enumerate(calls):
            yield Done(index, call, call())
        return
    for done in run_in_processes(_call, calls, workers):
        if done.error is not None:
            raise done.error
        yield done


def run_in_processes(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[Done]:
    """Each item in a worker process, see `worker_pool`; `work` and the items must be picklable."""
    with worker_pool(workers) as pool:
        for done in _as_they_come(pool, work, items):
            ended = isinstance(done.error, BrokenProcessPool)
            yield replace(done, error=_worker_ended(workers)) if ended else done


def run_in_threads(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[Done]:
    """Each item in a thread, for work that itself starts a subprocess, which ends with this process."""
    pool = ThreadPoolExecutor(max_workers=workers)
    try:
        yield from _as_they_come(pool, work, items)
    except KeyboardInterrupt:
        pool.shutdown(wait=False, cancel_futures=True)  # the end of this process ends their subprocesses
        raise
    except BaseException:
        pool.shutdown(wait=True)
        raise
    pool.shutdown(wait=True)


def run_on_ray(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[Done]:
    """Each item on the Ray cluster that `ray.init` finds; its nodes must see the same folder.

    Args:
        work: picklable.
        items: picklable.
        workers: not used: the cluster's cores decide.

    Raises:
        InputError: Ray is not installed.
    """
    try:
        ray = importlib.import_module("ray")
    except ImportError as error:
        raise InputError(
            "--ray needs the package ray, which is not installed: pip install 'ray>=2.10' (extra cluster)"
        ) from error
    ray.init(ignore_reinit_error=True, log_to_driver=False)
    # A node that dies takes its tasks with it: Ray runs them on the nodes that are left.
    task = ray.remote(num_cpus=1, max_retries=NODES_LOST)(work)
    pending = {task.remote(item): (index, item) for index, item in enumerate(items)}
    while pending:
        ready, _ = ray.wait(list(pending), num_returns=1)
        index, item = pending.pop(ready[0])
        try:
            result = ray.get(ready[0])
        except (ray.exceptions.RayError, InputError) as error:
            yield Done(index, item, error=getattr(error, "cause", None) or error)
        else:
            yield Done(index, item, result)


@contextmanager
def worker_pool(count: int) -> Generator[ProcessPoolExecutor]:
    """A pool of processes with one thread each, which end with this process, whatever ends it.

    They start as a new Python (spawn) and inherit nothing. Work that has not begun is given up where the
    block fails, and an interrupt ends what has begun: a terminal's Ctrl-C reaches this process alone.

    Raises:
        SolveError: a process was ended from outside.
    """
    context = _DeafContext()
    pool = ProcessPoolExecutor(count, context, initializer=_begin, initargs=(os.getpid(),))
    try:
        yield pool
    except BrokenProcessPool as error:
        raise _worker_ended(count) from error
    except KeyboardInterrupt:
        for process in context.started:
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def free_cores() -> int:
    """Cores that this process may use and that nobody else keeps busy, at least 1."""
    return max(1, len(os.sched_getaffinity(0)) - round(os.getloadavg()[0]))


def _as_they_come(pool: Executor, work: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Done]:
    pending: dict[Future[Any], int] = {pool.submit(work, item): k for k, item in enumerate(items)}
    try:
        while pending:
            ready, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in ready:
                index = pending.pop(future)
                error = future.exception()
                result = None if error is not None else future.result()
                yield Done(index, items[index], result, error)
    finally:
        for future in pending:
            future.cancel()


def _call(task: Callable[[], Any]) -> Any:
    return task()


def _worker_ended(count: int) -> SolveError:
    return SolveError(
        f"one of {count} worker processes was ended, perhaps for lack of memory; ask for fewer workers. "
        f"What was finished is kept: the same command goes on from there"
    )


class _DeafContext(SpawnContext):
    """Starts processes that a terminal's Ctrl-C or hang-up does not reach, from their first moment on."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(self, *arguments: Any, **named: Any) -> SpawnProcess:
        """A process that is not started yet; it inherits the mask of the thread that will start it."""
        process = _DeafProcess(*arguments, **named)
        self.started.append(process)
        return process


class _DeafProcess(SpawnProcess):
    def start(self) -> None:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(parent: int) -> None:
    end_with(parent)
    signal.signal(signal.SIGTERM, _give_up)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"  # of libraries that the work will load
    if "torch" in sys.modules:  # the main module has loaded it
        sys.modules["torch"].set_num_threads(1)


def _give_up(number: int, frame: object) -> None:
    """Leave the present work by an exception, so that no half file stays behind."""
    raise SystemExit(1)
