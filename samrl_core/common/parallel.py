"""A map over worlds: processes, threads around subprocesses, or a Ray cluster; results as they come."""

from __future__ import annotations

import importlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass
from typing import Any

from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class Done:
    """One item's end: its result, or the error that it raised."""

    item: Any
    result: Any = None
    error: BaseException | None = None


def in_processes(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[Done]:
    """Each item in a fresh-started Python (spawn): nothing is inherited from this process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=workers, mp_context=context) as pool:
        yield from _as_they_come(pool, work, items)


def in_threads(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[Done]:
    """For work that itself starts a subprocess."""
    with ThreadPoolExecutor(max_workers=workers) as pool:
        yield from _as_they_come(pool, work, items)


def on_ray(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[Done]:
    """On the Ray cluster that `ray.init` finds; its nodes must see the same folder.

    Raises:
        InputError: Ray is not installed.
    """
    try:
        ray = importlib.import_module("ray")
    except ImportError as error:
        raise InputError(
            "--ray needs the package ray, which is not installed: pip install 'ray>=2'"
        ) from error
    ray.init(ignore_reinit_error=True, log_to_driver=False)
    task = ray.remote(num_cpus=1, max_retries=1)(work)
    pending = {task.remote(item): item for item in items}
    while pending:
        ready, _ = ray.wait(list(pending), num_returns=1)
        item = pending.pop(ready[0])
        try:
            result = ray.get(ready[0])
        except (ray.exceptions.RayError, InputError) as error:
            yield Done(item, error=error)
        else:
            yield Done(item, result)


def _as_they_come(pool: Executor, work: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Done]:
    pending: dict[Future[Any], Any] = {pool.submit(work, item): item for item in items}
    try:
        while pending:
            ready, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in ready:
                item = pending.pop(future)
                error = future.exception()
                yield Done(item, error=error) if error is not None else Done(item, future.result())
    finally:
        for future in pending:  # interrupted: what has not begun does not begin
            future.cancel()
