"""Whether a silent process works, stands, or hangs: judged by what it gets of the machine, not by a clock.

On a busy machine everything takes long by the wall clock. A process that runs, or waits for its turn, is then
slow and not dead. Linux's /proc tells the states and the processor time (proc_pid_stat(5)).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
BUSY_STATES = frozenset("RD")  # runs or could, waits for a disk
STOPPED_STATES = frozenset("Tt")  # SIGSTOP, a debugger


@dataclass(frozen=True)
class Pulse:
    """A look at a process, or at some of its threads."""

    states: frozenset[str]  # letters of proc_pid_stat(5); empty when it is gone
    cpu_s: float  # used so far [s]

    @property
    def stopped(self) -> bool:
        """Whether a signal or a debugger holds it."""
        return bool(self.states & STOPPED_STATES)

    @property
    def busy(self) -> bool:
        """Whether it runs or waits for its turn."""
        return bool(self.states & BUSY_STATES)


def pulse_of(pid: int, threads: frozenset[int] = frozenset()) -> Pulse:
    """Look at a process; `threads`: native ids of those that count, all when empty."""
    states, ticks = set(), 0
    for folder in _tasks(pid):
        if threads and int(folder.name) not in threads:
            continue
        try:
            # The name stands in parentheses and may hold anything.
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue  # ended since
        states.add(fields[0])
        ticks += int(fields[11]) + int(fields[12])
    return Pulse(frozenset(states - set("ZX")), ticks * TICK_S)


def _tasks(pid: int) -> list[Path]:
    try:
        return list(Path(f"/proc/{pid}/task").iterdir())
    except (FileNotFoundError, ProcessLookupError):
        return []


class Silence:
    """How long somebody who should speak has been idle, and what was used in vain, since last heard."""

    def __init__(self, now_s: float) -> None:
        self._cpu_s = self._at_word_s = -1.0
        self._woke_s = now_s
        self._stopped_since_s = -1.0
        self._now_s = now_s

    def heard(self) -> None:
        """It has spoken, or nobody expects it to."""
        self._at_word_s = self._cpu_s
        self._woke_s = self._now_s

    def look(self, pulse: Pulse, now_s: float) -> None:
        """Take a look, the oftener the better."""
        self._now_s = now_s
        if pulse.cpu_s != self._cpu_s or pulse.busy or pulse.stopped:
            self._woke_s = now_s
        self._cpu_s = pulse.cpu_s
        if self._at_word_s < 0.0:
            self._at_word_s = pulse.cpu_s
        if not pulse.stopped:
            self._stopped_since_s = -1.0
        elif self._stopped_since_s < 0.0:
            self._stopped_since_s = now_s

    @property
    def asleep_s(self) -> float:
        """Wall time in which it neither ran nor could have run [s]."""
        return self._now_s - self._woke_s

    @property
    def used_s(self) -> float:
        """Processor time used without a word [s]."""
        return self._cpu_s - self._at_word_s

    @property
    def stopped_s(self) -> float:
        """Wall time for which a signal has held it [s]."""
        return self._now_s - self._stopped_since_s if self._stopped_since_s >= 0.0 else 0.0
