"""What a watch does with messages and diagnoses, apart from where they come from."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from samrl_core.common.files import append_line
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.watch.judgement import NO_GAP, REFUSED, Judgement, Running
from samrl_ros.watch.windows import LoggedWindow, Windows

NOT_TESTABLE = "not_testable"
LOST_SHARE = 1e-3  # of a window's messages; holes that this machine made look like jitter of the robot
WINDOWS, REPORTS, LOG = "windows", "reports", "watch.jsonl"


@dataclass(frozen=True)
class WatchSettings:
    """What is watched, and what is kept."""

    out: Path
    window_s: float = 30.0
    keep: int = 10  # newest bags without a gap; those with one all stay
    options: tuple[str, ...] = ()  # further arguments of `samrl diagnose`


class GapWatch:
    """Windows of a stream, one diagnosis at a time, and the state that follows."""

    def __init__(self, settings: WatchSettings, on_judgement: Callable[[Judgement], object]) -> None:
        """`on_judgement` hears each window's.

        Raises:
            InputError: as `Windows`.
        """
        self._settings, self._on_judgement = settings, on_judgement
        self._windows = Windows(settings.out / WINDOWS, settings.window_s)
        self._running: Running | None = None
        self._plain: list[int] = []  # windows whose bags may go
        self.latest: Judgement | None = None  # that says something of simulation and machine
        self.refusal: Judgement | None = None  # newest window, if it says nothing
        self.since: Judgement | None = None  # first of the gaps in a row that lasts until now
        self.judged = self.refused = self.skipped = self.lost = 0

    def take(self, topic: str, type_name: str, qos: QoS, data: bytes, now_ns: int) -> None:
        """Take one message at the graph's clock."""
        ended = self._windows.take(topic, type_name, qos, data, now_ns)
        if ended is not None:
            self._begin(ended)

    def describe(self, topic: str, type_name: str, qos: QoS, data: bytes) -> None:
        """Take a latched message before the graph's clock begins."""
        self._windows.describe(topic, type_name, qos, data)

    def lose(self, messages: int) -> None:
        """Count messages that the middleware dropped on the way here."""
        self.lost += messages
        self._windows.lose(messages)

    def poll(self) -> None:
        """Hear the running diagnosis; call often."""
        if self._running is None:
            return
        found = self._running.result()
        if found is not None:
            self._running = None
            self._record_judgement(found)

    def close(self) -> None:
        """End at once; whole windows and reports stay."""
        self._windows.end()
        if self._running is not None:
            self._running.stop()
            self._running = None

    @property
    def answered(self) -> int:
        """Windows with an answer, refusals included."""
        return self.judged + self.refused

    def status(self) -> tuple[bool, str, dict[str, str]]:
        """Whether all is well as far as known, one line, and values, for /diagnostics."""
        w = self._windows
        writing = f"window {w.number}: {w.elapsed_s:.0f} of {self._settings.window_s:g} s"
        values = {
            "recording": writing if w.number else "nothing arrived yet",
            "judged": str(self.judged),
            "not judged": str(self.refused),
            "skipped": str(self.skipped),  # a diagnosis took longer than a window
            "messages lost": str(self.lost),
        }
        if self.refusal is not None:
            values["last not judged"] = f"window {self.refusal.window}: {self.refusal.says}"
        if self.latest is None:
            if self.refusal is not None:
                return False, f"not diagnosed: {self.refusal.says}", values
            return True, values["recording"], values
        values |= {
            "window": str(self.latest.window),
            "verdict": self.latest.verdict,
            "effects": ", ".join(self.latest.effects),
            "where": ", ".join(self.latest.places),
            "report": self.latest.report,
        }
        if self.since is not None:
            values["gap since window"] = str(self.since.window)
            if self.since.onset_s is not None:
                values["onset"] = f"{self.since.onset_s:.2f} s"
        return not self.latest.is_gap, self.latest.says, values

    def _begin(self, window: LoggedWindow) -> None:
        if not window.messages:
            self._windows.drop(window.number)
        elif window.lost > LOST_SHARE * window.messages:
            says = (
                f"{window.lost} messages were lost on the way beside {window.messages} that arrived, over "
                f"{LOST_SHARE:.1%}: give this machine less to do, or publishers a deeper queue (QoS depth)"
            )
            self._record_judgement(Judgement(window.number, REFUSED, says))
        elif self._running is not None:
            self.skipped += 1
            self._forget(window.number)
        else:
            out = self._settings.out / REPORTS / f"{window.number:04d}"
            self._running = Running(window, out, self._settings.options)

    def _record_judgement(self, found: Judgement) -> None:
        if found.verdict in (REFUSED, NOT_TESTABLE):
            self.refused += 1
            self.refusal = found
        else:
            self.judged += 1
            self.latest, self.refusal = found, None
            if not found.is_gap:
                self.since = None
            elif self.since is None:
                self.since = found
        if not found.is_gap:
            self._forget(found.window)
        append_line(self._settings.out / LOG, json.dumps(asdict(found), allow_nan=False))
        self._on_judgement(found)

    def _forget(self, number: int) -> None:
        """Keep the newest bags without a gap, and no more."""
        self._plain.append(number)
        while len(self._plain) > self._settings.keep:
            self._windows.drop(self._plain.pop(0))


def lines_of(found: Judgement) -> Sequence[str]:
    """A judgement for a terminal."""
    mark = "not judged" if found.verdict in (REFUSED, NOT_TESTABLE) else found.verdict
    says = found.says.removeprefix(f"{found.verdict}: ")
    lines = [f"window {found.window}: {mark}" + (f": {says}" if found.verdict != NO_GAP else "")]
    if found.is_gap:
        lines.append(f"  where: {', '.join(found.places) or 'not told'}; {found.report}")
    return lines
