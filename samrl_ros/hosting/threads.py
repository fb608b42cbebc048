"""What the numerical libraries may take in a process of the cell: threads, and memory that was freed."""

from __future__ import annotations

import ctypes
import os
import threading
import time

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # mallopt(3)
_ARENAS = 2  # heaps in a process; by default 8 per core, each with its own holes
_LARGE = 1 << 20  # arrays from this size on are given back when they are freed [bytes]
TRIM_S = 10.0  # wall time from one look for free pages between smaller arrays to the next


def one_thread_per_library() -> None:
    """Keep OpenMP and BLAS to one thread; call before NumPy and torch do any work.

    The nodes are the parallelism here. Worker threads that spin between small tensor operations take the
    cores from the other nodes: with two torch threads on two cores an update took ten times as long.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    import torch

    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))


def give_freed_memory_back(every_s: float = TRIM_S) -> None:
    """Make glibc return freed arrays to the system, where it would keep them for later; elsewhere do nothing.

    By default it raises its limit for that to 32 MB with the first large array, and puts those below between
    small objects that stay: the view planner's heap grew by 290 MB an hour, of which none was in use. Whole
    pages that are free between smaller arrays are given back every `every_s` seconds.
    """
    glibc = ctypes.CDLL(None)
    mallopt, trim = getattr(glibc, "mallopt", None), getattr(glibc, "malloc_trim", None)
    if mallopt is None or trim is None:
        return
    for name, value in (
        (_M_ARENA_MAX, _ARENAS),
        (_M_MMAP_THRESHOLD, _LARGE),
        (_M_TRIM_THRESHOLD, 4 * _LARGE),
    ):
        mallopt(name, value)
    trim.argtypes = [ctypes.c_size_t]

    def trim_now_and_then() -> None:
        while True:
            time.sleep(every_s)
            trim(0)  # without the interpreter's lock: other threads go on

    threading.Thread(target=trim_now_and_then, name="malloc_trim", daemon=True).start()
