"""What keeps an episode from going on: an emergency stop that nobody has reset, and nodes that are away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_ros.contract.topics import arm_topic, cell_topic

SETTLE_NS = 200_000_000  # robot time after a change in which every node hears of it
MOVED_M = 0.005  # farther than this is not where the tool stood, only a hand moves it so [m]
MOST_AGAIN = 3  # motions of an episode that are begun anew after they were given up
AT_REST = 0.02  # below this an arm stands [rad/s], as for the command guard
ESTOP = "ESTOP"  # of the command guard's states
STOPPED = ("FAULT", ESTOP)  # in which it follows no commands until a reset
LATCHED = f"an emergency stop is latched; call {cell_topic('estop_reset')} first"  # why no episode starts
ONE_COMMANDER = "one commander at a time: stop the others"  # why no episode starts, too
HOLDS_BACK = (LATCHED, ONE_COMMANDER)  # refusals of an episode that somebody can mend while the run waits


def stopped_arms(message: Any, states: tuple[str, ...]) -> tuple[str, ...]:
    """Arms that a `safety_state` message shows in one of the guard's states."""
    return tuple(value.key for value in message.values if value.value in states)


def why_rivals(role: str, publishers: Sequence[str]) -> str:
    """Sentence about several nodes that publish an arm's commands."""
    topic = arm_topic(role, "command")
    return f"{len(publishers)} publishers on {topic} ({', '.join(publishers)}); {ONE_COMMANDER}"


@dataclass(frozen=True)
class Doubt:
    """An episode may have to end, unless word of an emergency stop comes in time."""

    since_ns: int
    reason: str
    void: bool = False  # a motion was given up: it can be begun anew


class Standstill:
    """Hears `safety_state` and `node_watch`; time is that of the tool arm's readings."""

    def __init__(self) -> None:
        self.estop = ""  # reason of the emergency stop in force
        self.away: dict[str, str] = {}  # why, by node
        self._changed_ns = 0
        self._refusal = ""
        self._stood: np.ndarray | None = None  # tip when the arm came to rest [m]
        self.displacement = 0.0  # of the tip since then [m]

    def hear_safety(self, message: Any, now_ns: int) -> None:
        """Take a `safety_state` message."""
        estop = message.message if stopped_arms(message, (ESTOP,)) else ""
        if bool(estop) != bool(self.estop):
            self._changed_ns = now_ns
            if estop:
                self._stood, self.displacement = None, 0.0
        self.estop = estop

    def hear_answer(self, refusal: str, now_ns: int) -> bool:
        """The cell begins an episode (empty), or says what holds it back; returns whether that is news.

        An all-clear on `safety_state` before a refusal was not the cell's own.
        """
        news, self._refusal = refusal != self._refusal, refusal
        if refusal:
            self._changed_ns = now_ns
        return news

    def hear_node(self, message: Any, now_ns: int) -> None:
        """Take a `node_watch` message: a node is away (level 1: held, 2: it starts anew), or back."""
        self._changed_ns = now_ns
        if message.level >= b"\x01":
            self.away[message.name] = message.message
        else:
            self.away.pop(message.name, None)

    def see(self, tip: np.ndarray, velocity: np.ndarray) -> None:
        """Where the tool's tip (3,) [m] is, and how fast the joints (J,) [rad/s] are."""
        if not self.estop:
            return
        if self._stood is None and float(np.abs(velocity).max()) < AT_REST:
            self._stood = tip
        if self._stood is not None:
            self.displacement = max(self.displacement, float(np.linalg.norm(tip - self._stood)))

    def is_over(self, now_ns: int) -> bool:
        """Whether nothing keeps the cell any more, and everybody has heard of it."""
        return not self.estop and not self.away and now_ns - self._changed_ns >= SETTLE_NS
