"""One cell of the table: a fault at a moment, the promise, and what was measured."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.files import write_whole
from tests.faults.limits import extremes, read_rows

GUARD_TIMEOUT_S = 0.1  # of the bridge's command guard
HORIZON_S = 0.045  # by which the last accepted command may lie ahead
RESTING = 1e-9  # [rad/s]
STRANGER_RAD = 0.1  # a stranger leads the first joint by 0.28 rad in its time, the bench by less than 0.06


@dataclass(frozen=True)
class Check:
    """One line of a verdict."""

    what: str
    ok: bool
    measured: str


@dataclass
class Trial:
    """Runs in a graph. `steps` is where the graph's worlds write their rows."""

    fault: str
    moment: str
    promise: str
    steps: Path
    log: Callable[[], str]
    checks: list[Check] = field(default_factory=list)
    began: float = field(default_factory=time.monotonic)
    harmed: float = 0.0  # wall time at which the fault set in
    harmed_ns: int = 0  # simulated time of it
    healed: float = 0.0  # wall time at which it was over
    healed_ns: int = 0
    rows_before: int = 0
    said_before: int = 0
    periods: int = 0  # controller periods that were looked at
    shares: dict[str, float] = field(default_factory=dict)  # highest share of each limit

    def __post_init__(self) -> None:
        self.rows_before = sum(p.stat().st_size for p in self._files())
        self.said_before = len(self.log())

    def _files(self) -> list[Path]:
        return list(self.steps.parent.glob(f"{self.steps.name}.[0-9]*"))

    def check(self, what: str, ok: Any, measured: str) -> bool:
        """Note a line."""
        self.checks.append(Check(what, bool(ok), measured))
        return bool(ok)

    def said(self) -> str:
        """What the processes have said since the trial began."""
        return self.log()[self.said_before :]

    def rows(self) -> np.ndarray:
        """The controller periods of this trial."""
        rows = read_rows(self.steps)
        return rows[self.rows_before // rows.dtype.itemsize :] if len(rows) else rows

    def check_limits(self) -> None:
        """Position, velocity, acceleration and continuity of both arms at 1 kHz."""
        rows = self.rows()
        found = extremes(rows)
        self.periods, self.shares = len(rows), {what: round(e.share, 4) for what, e in found.items()}
        broken = [f"{what} {e.share:.3f} of its limit ({e.place})" for what, e in found.items() if not e.kept]
        worst = ", ".join(f"{what} {e.share:.2f}" for what, e in found.items())
        self.check("limits kept in every period", not broken, "; ".join(broken) or f"{len(rows)} ms: {worst}")

    def check_no_traceback(self) -> None:
        """What goes wrong is told in words."""
        found = re.findall(r"Traceback.*?\n(\w[^\n]*)", self.said(), re.S)
        self.check("no traceback", not found, found[-1][:200] if found else "none")

    def check_braked(self) -> None:
        """The arm rests soon after commands have ceased, and stays at rest until they come again."""
        rows = self.rows()
        after = rows[(rows["time_ns"] >= self.harmed_ns) & (rows["time_ns"] < self.healed_ns)]
        if not len(after):
            self.check("the arm brakes", True, "no controller period passed: simulated time stood still")
            return
        speed = np.abs(after["tool_arm"]["velocity"])
        limits = cell_named().tool_arm.limits
        allowed = (
            GUARD_TIMEOUT_S + HORIZON_S + float((speed[:100].max(0) / (0.5 * limits.acceleration)).max())
        )
        moving = np.flatnonzero(speed.max(1) > RESTING)
        took = (after["time_ns"][moving[-1]] - self.harmed_ns) * 1e-9 if len(moving) else 0.0
        self.check(
            "the arm brakes",
            took <= allowed,
            f"at rest {took:.3f} s after the fault, allowed {allowed:.3f} s",
        )

    def check_not_led(self) -> None:
        """The first joint stays where the bench's own short actions keep it."""
        turned = self.rows()["tool_arm"]["position"][:, 0]
        way = float(np.ptp(turned)) if len(turned) else 0.0
        said = f"first joint turned by {way:.3f} rad, a stranger's by 0.28"
        self.check("the stranger does not lead the arm", way < STRANGER_RAD, said)

    def check_told(self, pattern: str, where: str, texts: str) -> None:
        """Somebody says what happened."""
        found = re.search(pattern, texts)
        self.check(f"told: {pattern}", found, found.group(0)[:200] if found else f"not in {where}")

    @property
    def passed(self) -> bool:
        """Whether every line holds."""
        return bool(self.checks) and all(check.ok for check in self.checks)

    def save(self, folder: Path, commit: str) -> None:
        """Write the result; from then on a resumed bench leaves this cell alone."""
        result = {
            "fault": self.fault,
            "moment": self.moment,
            "promise": self.promise,
            "passed": self.passed,
            "periods": self.periods,
            "shares": self.shares,
            "checks": [asdict(check) for check in self.checks],
            "wall_s": round(time.monotonic() - self.began, 1),
            "load": os.getloadavg()[0],
            "commit": commit,
        }
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / f"{self.fault}@{self.moment}.json", json.dumps(result, indent=1) + "\n")
