"""Leaving the graph in bounded time."""

from __future__ import annotations

import faulthandler
from collections.abc import Callable, Sequence

LEAVE_S = 30.0  # wall time in which the middleware lets go of nodes; milliseconds on a free machine
STDERR = 2  # its file descriptor, whatever `sys.stderr` is now


def leave_graph(closers: Sequence[Callable[[], object]], patience_s: float = LEAVE_S) -> None:
    """Close what was opened, the last one first; call it when all else is written and printed.

    Fast DDS 2.14 may stand still for good in here, where a node's writer goes in the instant in which its
    lease is checked (each thread waits for the other's lock, and the caller for them, Python's lock in hand).
    No signal is heard then, so after `patience_s` the process ends, stacks on standard error, exit code 1.
    """
    faulthandler.dump_traceback_later(patience_s, exit=True, file=STDERR)
    try:
        for close in reversed(closers):
            close()
    finally:
        faulthandler.cancel_dump_traceback_later()
