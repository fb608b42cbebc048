"""Processes that share a training's work: they end with it, whatever ends it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context

import torch

from samrl_core.common.errors import SolveError

_PR_SET_PDEATHSIG = 1  # prctl(2)


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes with one thread each; work that has not begun is given up where the block fails.

    Raises:
        SolveError: a process was ended from outside.
    """
    pool = ProcessPoolExecutor(count, get_context("spawn"), initializer=_begin, initargs=(os.getpid(),))
    try:
        yield pool
    except BrokenProcessPool as error:
        raise SolveError(
            f"one of {count} worker processes was ended, perhaps for lack of memory; ask for fewer workers. "
            f"What was finished is kept: the same command goes on from there"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def free_cores() -> int:
    """Cores that this process may use and that nobody else keeps busy, at least 1."""
    return max(1, len(os.sched_getaffinity(0)) - round(os.getloadavg()[0]))


def _begin(parent: int) -> None:
    torch.set_num_threads(1)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before this was asked for
            os._exit(1)
