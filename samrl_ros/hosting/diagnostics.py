"""What a node publishes on /diagnostics: state, message rates, losses, durations, errors."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue


@dataclass
class TopicCounter:
    """Counts of one input. `window` counts since the last report.

    A full queue drops its oldest message without telling anybody (measured with Fast DDS 2.14), so `lost`
    is a lower bound: compare `received` here with `published` in the sender's diagnostics.
    """

    received: int = 0
    window: int = 0
    lost: int = 0  # the middleware reports a gap
    ignored: int = 0  # arrived while the node was not active
    age_s: float = float("nan")  # clock minus stamp of the newest message, nan without a stamp


@dataclass
class Health:
    """Counters of one node; plain numbers that its own thread alone writes."""

    topics: dict[str, TopicCounter] = field(default_factory=dict)
    published: dict[str, int] = field(default_factory=dict)  # per topic
    unsent: int = 0  # published while the node was not active
    handler_last_s: float = 0.0
    handler_max_s: float = 0.0  # since the last report
    busy_s: float = 0.0  # since the last report
    errors: int = 0
    error: str = ""  # the failure that stopped the node, empty when there is none
    since: float = field(default_factory=time.monotonic)

    def count_handler(self, duration: float) -> None:
        """Add one handler call [s]."""
        self.handler_last_s = duration
        self.handler_max_s = max(self.handler_max_s, duration)
        self.busy_s += duration

    def report(self, name: str, state: str, figures: dict[str, str]) -> DiagnosticArray:
        """One status message; the counters of the window start anew."""
        now = time.monotonic()
        window = max(now - self.since, 1e-9)
        values = {
            "state": state,
            "errors": str(self.errors),
            "published": str(sum(self.published.values())),
            "unsent": str(self.unsent),
            "handler_last_ms": f"{1e3 * self.handler_last_s:.3f}",
            "handler_max_ms": f"{1e3 * self.handler_max_s:.3f}",
            "busy_fraction": f"{self.busy_s / window:.4f}",
        }
        for topic, counter in self.topics.items():
            values[f"{topic} rate_hz"] = f"{counter.window / window:.2f}"
            values[f"{topic} received"] = str(counter.received)
            values[f"{topic} dropped"] = str(counter.lost + counter.ignored)
            values[f"{topic} age_s"] = f"{counter.age_s:.4f}"
            counter.window = 0
        for topic, count in self.published.items():
            values[f"{topic} published"] = str(count)
        values.update(figures)
        self.since, self.handler_max_s, self.busy_s = now, 0.0, 0.0
        lost = sum(counter.lost for counter in self.topics.values())
        level, message = DiagnosticStatus.OK, state
        if self.error:
            level, message = DiagnosticStatus.ERROR, self.error
        elif lost:
            level, message = DiagnosticStatus.WARN, f"{state}; {lost} messages lost on the way here"
        status = DiagnosticStatus(
            level=level,
            name=name,
            message=message,
            hardware_id="samrl",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        return DiagnosticArray(status=[status])
