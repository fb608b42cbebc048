"""How long each part of an episode takes, in seconds of a processor and of the wall clock."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager

from samrl_core.policy.agent.episode import Part

# What the loop's parts are counted as: the plant's three are the cell's motion, rest and camera.
GROUP: dict[Part, str] = {
    "update": "update",
    "view": "view",
    "act": "act",
    "observe": "move",
    "look": "move",
    "move": "move",
}
GROUPS = ("update", "view", "act", "move")


class Stopwatch:
    """A `samrl_core.policy.agent.episode.Watch`."""

    def __init__(self) -> None:
        self.entered: Counter[Part] = Counter()
        self.cpu_s: dict[str, float] = dict.fromkeys(GROUPS, 0.0)
        self.wall_s: dict[str, float] = dict.fromkeys(GROUPS, 0.0)

    @contextmanager
    def __call__(self, part: Part) -> Generator[None]:
        """Time of the block, counted also where it fails."""
        self.entered[part] += 1
        cpu, wall = time.process_time(), time.perf_counter()
        try:
            yield
        finally:
            self.cpu_s[GROUP[part]] += time.process_time() - cpu
            self.wall_s[GROUP[part]] += time.perf_counter() - wall
