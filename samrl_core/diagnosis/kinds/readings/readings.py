"""Readings of a sensor against their reference: depth against planes, stamps against another clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import ClassVar

import numpy as np

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import READING_EFFECTS
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.findings.discrimination import FILE, discrimination, find_rivals, separation
from samrl_core.diagnosis.kinds.kind import Kind
from samrl_core.diagnosis.kinds.readings.reading_corrections import reading_recalibration
from samrl_core.diagnosis.recordings.held_out import SHARE
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.readings.depth_pattern import find_depth_pattern
from samrl_core.diagnosis.residuals.readings.reading_trial import SLOW, ReadingTrial, plateaus_of
from samrl_core.diagnosis.residuals.readings.time_pattern import find_time_pattern
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.twins import AS_MUCH
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Doubts

LEAST = 40  # readings of a recording that is cut
NEXT_DEPTHS_M = (0.3, 0.5, 0.8, 1.2, 1.8)
NEXT_READINGS = 400
NEXT_HOURS = 2.0
SURE = 5.0  # standard deviations and tolerances, from which on a drift between steps is told
PATTERN = 80.0  # [nat] beyond noise and tolerances, of which something is there whatever it is


class Readings(Kind[ReadingRecording]):
    """One quantity of one sensor."""

    effects = READING_EFFECTS
    elsewhere: ClassVar[dict[str, str]] = {
        "depth_noise": "noise is estimated from the readings; nothing is stated that it could contradict",
        "intrinsics": "needs the pixels of the readings",
    }
    shown_by = "readings against a reference"
    nothing = "no reading can be compared with its reference"

    def alike(self, recordings: Sequence[ReadingRecording]) -> tuple[list[ReadingRecording], list[str]]:
        first = recordings[0]
        for other in recordings[1:]:
            if (other.quantity, other.sensor) != (first.quantity, first.sensor):
                raise InputError(
                    f"{other.name} is {other.quantity} of {other.sensor}, {first.name} {first.quantity} of"
                    f" {first.sensor}; diagnose one sensor at a time"
                )
        return list(recordings), []

    def trials(
        self, fit: Sequence[ReadingRecording], held_out: Sequence[ReadingRecording]
    ) -> tuple[list[Observed], list[Observed]]:
        # One clock for all: a drift goes on between recordings.
        start = float(fit[0].reference[0])
        made = [ReadingTrial(r, start) for r in (*fit, *held_out)]
        # An error that noise hides needs no regressor, which would take away from what is left to see.
        at = plateaus_of([*fit, *held_out])
        shown = set[str]().union(*(trial.shown(at) for trial in made))
        for trial in made:
            trial.tolerated = {name: v for name, v in trial.tolerances(at).items() if name in shown}
        return list(made[: len(fit)]), list(made[len(fit) :])

    def notes(self, trials: Sequence[Observed]) -> list[str]:
        made = [t for t in trials if isinstance(t, ReadingTrial)]
        return [*_steps(made), *(
            f"{t.name}: {t.outliers} of {len(t.recording.reading)} readings stand apart from all others and"
            " hardly count"
            for t in made
            if t.outliers
        )]  # fmt: skip

    def system(self, trial: Observed) -> str:
        assert isinstance(trial, ReadingTrial)
        return trial.recording.sensor

    def cut(self, recording: ReadingRecording) -> tuple[ReadingRecording, ReadingRecording]:
        return split_readings(recording, 0.5)

    def correction(
        self, evidence: Evidence, chosen: Fit, far: HowFar, sure: bool, rng: np.random.Generator
    ) -> Recalibration | None:
        if not sure:
            return None
        trials = [t for t in evidence.likelihood.trials if isinstance(t, ReadingTrial)]
        return reading_recalibration(chosen, trials)

    def doubts(self, evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
        steps = _steps([t for t in evidence.likelihood.trials if isinstance(t, ReadingTrial)])
        if chosen is not None or steps:
            return steps
        excess = evidence.likelihood.deficit(evidence.likelihood.y, SLOW)
        if excess < PATTERN:
            return []
        return [
            f"errors that last over neighbouring readings hold {excess:.0f} of log evidence; no effect does"
        ]

    def doubts_of(self, fitted: Likelihood, held_out: Likelihood) -> Doubts:
        """Those of the fitted recordings, and what of all depth follows from time, or from no formula."""
        files: dict[tuple[str, str], list[ReadingRecording]] = {}
        for trial in (*fitted.trials, *held_out.trials):
            if isinstance(trial, ReadingTrial) and trial.recording.quantity == "depth":
                files.setdefault((trial.recording.source, trial.recording.sha256), []).append(trial.recording)
        every = [r for parts in files.values() for r in parts]

        @cache
        def patterns() -> list[str]:
            drifts = [found for parts in files.values() if (found := find_time_pattern(parts))]
            return drifts or ([found] if every and (found := find_depth_pattern(every)) else [])

        def doubts(evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
            return self.doubts(evidence, chosen, least) or patterns()

        return doubts

    def next_experiment(
        self, likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
    ) -> tuple[NextExperiment | None, str]:
        trial = likelihood.trials[0]
        assert isinstance(trial, ReadingTrial)
        recording, rivals = trial.recording, find_rivals(fits, names)
        time = np.arange(NEXT_READINGS) / 30.0
        if recording.quantity == "depth":
            reference = np.repeat(NEXT_DEPTHS_M, NEXT_READINGS // len(NEXT_DEPTHS_M))
            motion = f"a plane at {', '.join(f'{d:g}' for d in NEXT_DEPTHS_M)} m"
        else:
            time = np.linspace(0.0, 3600.0 * NEXT_HOURS, NEXT_READINGS)
            reference = float(recording.reference[0]) + time
            motion = f"{NEXT_HOURS:g} hours of stamps"
        planned = replace(recording, name="next", time=time, reading=reference, reference=reference)
        made = ReadingTrial(planned, float(recording.reference[0]), trial)
        best, pair = discrimination(made, rivals), " and ".join(names)
        if best < AS_MUCH:
            return None, (
                f"no recording of these readings splits {pair}: in {motion} they would differ by {best:.1f}"
                " of log evidence; an outside measurement must"
            )
        why = f"{pair} would differ by {best:.0f} of log evidence in {motion}"
        content = {
            "schema": 1,
            "kind": "readings",
            "quantity": recording.quantity,
            "why": why,
            "record": motion,
        }
        return NextExperiment(FILE, why, separation(best), content), ""


def _steps(trials: Sequence[ReadingTrial]) -> list[str]:
    """Where clocks step apart, a sentence each: no offset and no drift is one there."""
    out = []
    for t in trials:
        jumps = t.jumps()
        drift = _drift_between(t, jumps) if jumps else ""
        out += [
            f"{t.name}: the clocks step apart by {size:+.4g} s after {when:.5g} s: one was set, or events"
            f" were lost; {drift}cut there with `rows` and diagnose the parts"
            for when, size in jumps
        ]
    return out


def _drift_between(trial: ReadingTrial, jumps: Sequence[tuple[float, float]]) -> str:
    """What else the clocks do, where it is beyond noise and tolerance."""
    drift, deviation = trial.drift_between(jumps)
    if abs(drift) < SURE * max(deviation, trial.recording.tolerances.drift):
        return ""
    return f"between steps they drift by {1e6 * drift:+.3g} ppm; "


def split_readings(
    recording: ReadingRecording, held_out_share: float = SHARE
) -> tuple[ReadingRecording, ReadingRecording]:
    """Stretches of a tenth each: of depth some from everywhere are held out, of stamps the last ones.

    Raises:
        InputError: too few readings.
    """
    count = len(recording.reading)
    if count < LEAST:
        raise InputError(
            f"{recording.name} has {count} readings; at least {LEAST} are needed to hold any out. Give every"
            " reading at each distance, not their mean, or a second recording"
        )
    tenth = np.minimum(10 * np.arange(count) // count, 9)
    if recording.quantity == "depth":
        held = tenth % 2 == 1 if held_out_share >= 0.5 else np.isin(tenth, (2, 5, 8))
    else:
        held = tenth >= round(10 * (1.0 - held_out_share))

    def part(keep: np.ndarray) -> ReadingRecording:
        return replace(
            recording, time=recording.time[keep], reading=recording.reading[keep],
            reference=recording.reference[keep],
        )  # fmt: skip

    return part(~held), part(held)
