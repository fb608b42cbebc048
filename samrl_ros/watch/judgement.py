"""A diagnosis of one window in a process of its own, and what it says in a few values."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.errors import InputError
from samrl_core.common.files import room_for
from samrl_core.diagnosis.report.json_report import read_report
from samrl_core.diagnosis.result import GAPS
from samrl_ros.contract.exit_codes import GAP_FOUND, INPUT_REFUSED, OK
from samrl_ros.watch.windows import LoggedWindow

NO_GAP, REFUSED = "no_gap", "refused"
NICENESS = 10  # the graph that is watched goes first


@dataclass(frozen=True)
class Judgement:
    """What a diagnosis says of a window."""

    window: int
    verdict: str  # of the contract, or `refused`
    says: str  # one line
    effects: tuple[str, ...] = ()  # family@place
    places: tuple[str, ...] = ()  # where the gap lies, strongest first
    onset_s: float | None = None  # on the graph's clock, where the gap began within the window
    report: str = ""  # page

    @property
    def is_gap(self) -> bool:
        """Whether simulation and machine differ beyond tolerances."""
        return self.verdict in GAPS


class Running:
    """One `samrl diagnose` on a window's bag."""

    def __init__(self, window: LoggedWindow, out: Path, options: Sequence[str]) -> None:
        """Start it.

        Args:
            window: finished.
            out: the report's folder; must not hold a report.
            options: further arguments of `samrl diagnose`.
        """
        self.window, self._out = window, out
        package = Path(__file__).resolve().parents[2]
        path = os.pathsep.join(p for p in (str(package), os.environ.get("PYTHONPATH", "")) if p)
        tied = ends_with_parent()

        def prepare() -> None:
            tied()
            os.nice(NICENESS)

        out.mkdir(parents=True, exist_ok=True)
        self._log = out / "diagnose.log"
        command = [sys.executable, "-m", "samrl_ros.cli.main", "diagnose", str(window.folder.resolve())]
        with room_for(self._log), self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [*command, "--out", str(out.resolve()), *options],
                env={**os.environ, "PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                preexec_fn=prepare,
            )

    def result(self) -> Judgement | None:
        """What it says; None while it runs."""
        code = self._process.poll()
        if code is None:
            return None
        number = self.window.number
        if code in (OK, GAP_FOUND):
            try:
                return judgement_of(self.window, read_report(self._out / "report.json"), self._out)
            except InputError as error:
                return Judgement(number, REFUSED, str(error))
        lines = [line.strip() for line in self._log.read_text(errors="replace").splitlines() if line.strip()]
        if code == INPUT_REFUSED:
            refusal = next(
                (line for line in lines if line.startswith("refused:")), "refused: no reason given"
            )
            return Judgement(number, REFUSED, refusal.partition(":")[2].strip())
        last = lines[-1] if lines else "no output"
        return Judgement(
            number, REFUSED, f"the diagnosis failed with exit code {code}: {last}; see {self._log}"
        )

    def stop(self) -> None:
        """End it; its report is not written."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def judgement_of(window: LoggedWindow, report: dict[str, Any], folder: Path) -> Judgement:
    """The few values of a report."""
    effects = tuple(e["name"] for e in report["effects"])
    where = report["where"]
    onsets = [w["onset"] for w in where if w.get("onset") is not None]
    verdict = report["verdict"]
    reasons = report["reasons"]
    if verdict in ("effect", "ambiguous") and effects:
        names = effects if verdict == "effect" else report["ambiguity_set"][0]
        says = f"{verdict}: {', '.join(names)}"
    else:
        says = f"{verdict}: {reasons[0]}" if reasons else verdict
    return Judgement(
        window.number,
        verdict,
        says,
        effects,
        tuple(dict.fromkeys(w["place"] for w in where)),
        window.begin_ns / 1e9 + min(onsets) if onsets else None,
        str(folder / "report.html"),
    )
