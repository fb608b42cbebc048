"""What was guessed about a log, why, and how sure it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

EFFORT_HELP = (
    "What measured efforts are. link: of a sensor behind the gears; drive: the drive's torque times gear"
    " ratio; none: not to be used, as currents; passive: nothing drives the joints."
)


POSITION_UNITS = frozenset(("unit", "counts", "speed"))  # what is asked of a position's unit
_COUNTS = {2: "both", 3: "all three", 4: "all four"}


class Effort(StrEnum):
    """What measured efforts are."""

    ask = "ask"  # not known: a question, unless the joints' names tell
    link = "link"  # of a torque sensor behind the gears
    drive = "drive"  # torque of the drive times gear ratio, before friction
    none = "none"  # not to be used
    passive = "passive"  # nothing drives the joints: a pendulum that was let go


@dataclass(frozen=True)
class Guess:
    """One entry of a mapping."""

    key: str  # path in the mapping, such as channels.states.position
    reason: str
    question: str = ""  # what the user has to confirm or answer; empty where the log itself is proof
    asks: str = ""  # for what: `order`, `unit`, `torque_unit`, `rate`; a model or a velocity may tell it
    if_other: str = ""  # what the entry is if the position's unit is another; empty where it rests on none
    asked_with: str = ""  # key of the entry whose open question is this one's, too

    @property
    def sure(self) -> bool:
        """Whether nothing is left to ask."""
        return not self.question and not self.asked_with


@dataclass
class Draft:
    """A mapping as far as a log gives it."""

    about: str
    joints: list[str] = field(default_factory=list)
    urdf: str | None = None  # path or text
    xacro_args: dict[str, str] = field(default_factory=dict)
    sources: dict[str, dict[str, Any]] = field(default_factory=dict)
    channels: dict[str, dict[str, Any]] = field(default_factory=dict)
    controller: dict[str, Any] = field(default_factory=dict)  # of a motor whose input is recorded
    poses: dict[str, Any] = field(default_factory=dict)  # of a log of poses, which has no joints
    closes_m: float = float("inf")  # to which such poses close their chain [m]
    bodies: dict[str, Any] = field(default_factory=dict)  # of tracks of a free body, likewise
    falls: bool = False  # whether such a body was seen to fall freely
    readings: dict[str, Any] = field(default_factory=dict)  # of a log of depth against distances, likewise
    tolerances: dict[str, float] = field(default_factory=dict)  # where the log itself leaves more open
    recordings: list[dict[str, Any]] = field(default_factory=list)
    guesses: list[Guess] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)  # columns that went nowhere, and why
    would_tell: list[str] = field(default_factory=list)  # of them what would tell more, and how to use it

    @property
    def kind(self) -> str:
        """What the log holds: poses, bodies, readings or joints."""
        return next((kind for kind in ("poses", "bodies", "readings") if getattr(self, kind)), "joints")

    @property
    def questions(self) -> list[str]:
        """What is not sure, a sentence each."""
        return [f"{guess.key}: {guess.question}" for guess in self.guesses if guess.question]

    def note(self, key: str, reason: str, question: str = "", asks: str = "", if_other: str = "") -> None:
        """Remember why an entry is what it is."""
        self.guesses.append(Guess(key, reason, question, asks if question else "", if_other))

    def ask_with_position(self) -> None:
        """Let entries that rest on an open question of the position's unit be asked with it."""
        opened = next((guess for guess in self.guesses if guess.asks in POSITION_UNITS), None)
        if opened is None:
            return
        resting = [guess for guess in self.guesses if guess.if_other]
        if keys := dict.fromkeys(guess.key for guess in resting if guess.key != opened.key):
            count = _COUNTS.get(len(keys) + 1, f"all {len(keys) + 1}")
            also = f"{opened.question} Answer for {count}: {', '.join(keys)} rest on it"
            self._change(opened.asks, lambda guess: replace(guess, question=also))
        self.guesses = [
            replace(guess, reason=f"{guess.reason}; {guess.if_other}", asked_with=opened.key)
            if guess.if_other
            else guess
            for guess in self.guesses
        ]

    def settle(self, asks: str, reason: str) -> None:
        """Answer the questions for something by another reason."""
        self._change(
            asks, lambda guess: replace(guess, reason=f"{guess.reason}; {reason}", question="", asks="")
        )

    def add_reason(self, asks: str, reason: str) -> None:
        """A further reason beside an open question."""
        self._change(asks, lambda guess: replace(guess, reason=f"{guess.reason}; {reason}"))

    def ask_anew(self, asks: str, reason: str, question: str) -> None:
        """Put the question for something in another way, by a further reason."""
        self._change(
            asks, lambda guess: replace(guess, reason=f"{guess.reason}; {reason}", question=question)
        )

    def _change(self, asks: str, change: Callable[[Guess], Guess]) -> None:
        self.guesses = [change(guess) if guess.asks == asks else guess for guess in self.guesses]

    def of(self, key: str) -> Iterator[Guess]:
        """Guesses about one entry."""
        return (guess for guess in self.guesses if guess.key == key)

    def as_mapping(self) -> dict[str, Any]:
        """As a mapping file holds it; `questions` keeps it from being used before they are answered."""
        content: dict[str, Any] = {"about": self.about}
        if self.kind == "joints":
            content["joints"] = self.joints
        if self.controller:
            content["controller"] = self.controller
        if self.questions:
            content = {"questions": self.questions, **content}
        if self.urdf is not None:
            content["urdf"] = self.urdf
        if self.xacro_args:
            content["xacro_args"] = self.xacro_args
        described: dict[str, Any] = (
            {"channels": self.channels} if self.kind == "joints" else {self.kind: getattr(self, self.kind)}
        )
        if self.tolerances:
            described["tolerances"] = self.tolerances
        return content | {"sources": self.sources} | described | {"recordings": self.recordings}
