"""Work of one call shared out over a few threads; Warp releases Python's lock while a kernel runs."""

from __future__ import annotations

import threading
from collections.abc import Callable


def shares(count: int, workers: int) -> list[slice]:
    """Cuts 0..count into at most that many contiguous parts of nearly equal size."""
    workers = max(1, min(workers, count))
    ends = [count * k // workers for k in range(workers + 1)]
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]


def in_threads(work: Callable[[slice], None], parts: list[slice]) -> None:
    """Runs `work` on every part, the first one in the calling thread, and waits for all.

    The parts must write to different places: additions of kernels on a CPU are not atomic.
    A failure of any part is raised again, the first part's first.
    """
    failures: list[BaseException | None] = [None] * len(parts)

    def run(k: int) -> None:
        try:
            work(parts[k])
        except BaseException as failure:  # noqa: BLE001  (raised again in the caller's thread)
            failures[k] = failure

    others = [threading.Thread(target=run, args=(k,), daemon=True) for k in range(1, len(parts))]
    for thread in others:
        thread.start()
    run(0)
    for thread in others:
        thread.join()
    for failure in failures:
        if failure is not None:
            raise failure
