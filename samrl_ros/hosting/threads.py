"""What the numerical libraries may take in a process of the cell: threads, and memory that was freed."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # mallopt(3)
_ARENAS = 2  # heaps in a process; by default 8 per core, each with its own holes
_LARGE = 1 << 17  # arrays from this size on are given back when they are freed [bytes]
_HEAP_END = 4 << 20  # free memory at the end of the heap that is kept [bytes]
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


class FreedMemory:
    """Makes glibc return freed arrays to the system, which it would keep for later; elsewhere does nothing.

    By default it raises its limit for that to 32 MB with the first large array, and puts those below between
    small objects that stay: the view planner's heap grew by 290 MB an hour, of which none was in use. Images
    that a node keeps for some seconds (50 and 66 kB) stay on the heap; what a rendering works in (460 kB an
    image) must not lie between them, or the heap takes an hour to find its size. It costs a tenth of the
    processor time of an update and a fifth of a view's, in pages.

    Whole pages that are free between smaller arrays are given back every `every_s` seconds until `stop`: a
    process with a thread left ends without Python's own end, and Fast DDS then leaves its shared memory.
    """

    def __init__(self, every_s: float = TRIM_S) -> None:
        glibc = ctypes.CDLL(None)
        mallopt, trim = getattr(glibc, "mallopt", None), getattr(glibc, "malloc_trim", None)
        self._every_s = every_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._give_back, args=(trim,), name="malloc_trim", daemon=True)
        if mallopt is None or trim is None:
            return
        for name, value in (
            (_M_ARENA_MAX, _ARENAS),
            (_M_MMAP_THRESHOLD, _LARGE),
            (_M_TRIM_THRESHOLD, _HEAP_END),
        ):
            mallopt(name, value)
        trim.argtypes = [ctypes.c_size_t]
        self._thread.start()

    def stop(self) -> None:
        """End the thread; what is freed afterwards stays with the process."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _give_back(self, trim: Callable[[int], int]) -> None:
        while not self._stop.wait(self._every_s):
            trim(0)  # without the interpreter's lock: the nodes go on
