"""Timing of alternatives in one process, in turn, so that a busy machine slows all of them alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class TimedCall:
    """One alternative: what is run, and how much of it one run is."""

    name: str
    run: Callable[[], object]
    amount: float = 1.0  # images, steps or distances per run
    finish: Callable[[], None] = lambda: None  # waits for a device; its time counts


@dataclass(frozen=True)
class MedianTime:
    """What one alternative took."""

    name: str
    seconds: float  # median of one unit of work [s]
    per_second: float  # units of work, by the median [1/s]

    def times_faster(self, other: MedianTime) -> float:
        """How often this one does a unit while the other does one."""
        return other.seconds / self.seconds


def in_turn(jobs: Sequence[TimedCall], rounds: int) -> dict[str, MedianTime]:
    """Runs every job once to warm up, then all of them one after the other, `rounds` times."""
    taken: dict[str, list[float]] = {job.name: [] for job in jobs}
    for turn in range(rounds + 1):
        for job in jobs:
            start = time.perf_counter()
            job.run()
            job.finish()
            if turn:
                taken[job.name].append((time.perf_counter() - start) / job.amount)
    return {name: MedianTime(name, median(seconds), 1.0 / median(seconds)) for name, seconds in taken.items()}
