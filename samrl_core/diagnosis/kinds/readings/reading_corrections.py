"""Named effects on readings as corrections of what the sensor reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.export.recalibration import Advice, Recalibration
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial
from samrl_core.diagnosis.selection.hypothesis import Fit


def reading_recalibration(chosen: Fit, trials: Sequence[ReadingTrial]) -> Recalibration:
    """Turn the named effects into formulas for the mapping, in metres or seconds."""
    first, advice = trials[0], list[Advice]()
    for h, amplitudes, covariance in chosen.parts():
        values = h.form.parameters(first, h.shape, amplitudes)
        deviation = np.sqrt(np.diag(covariance))
        listed = ", ".join(
            f"{name} {value:.6g} +- {s:.2g}"
            for (name, value), s in zip(values.items(), deviation, strict=True)
        )
        advice.append(Advice(h.name, f"{_formula(values, first)}  # {listed}, one standard deviation"))
    sources = tuple((t.recording.source, t.recording.sha256) for t in trials)
    return Recalibration(first.recording.sensor, (), tuple(advice), sources)


def _formula(values: dict[str, float], trial: ReadingTrial) -> str:
    """What the true quantity is by the reading r."""
    if trial.recording.quantity == "stamp":
        offset = values.get("o", values.get("T", 0.0))
        drift = values.get("drift", 0.0)
        begin = trial.start
        moved = f"r - {offset:.9g}" if offset else "r"
        return f"{begin!r} + ({moved} - {begin!r}) / {1.0 + drift:.12g}" if drift else moved
    if "z" in values:
        return f"r + {values['z']:.9g}"
    slope, offset, square = 1.0 + values.get("a", 0.0), values.get("b", 0.0), values.get("c", 0.0)
    if not square:
        return f"(r - {offset:.9g}) / {slope:.9g}"
    root = f"sqrt({slope * slope:.9g} + {4 * square:.9g} * (r - {offset:.9g}))"
    return f"({root} - {slope:.9g}) / {2 * square:.9g}"
