"""Readings of a sensor as the effects see them: reading minus reference, in one channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from samrl_core.cell.types.reading_recording import UNITS, ReadingRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.phases import REST
from samrl_core.diagnosis.residuals.poses.noise import noise_level, scale

LEAST_READINGS = 20
ROUNDS = 8
APART = 6.0  # standard deviations beyond which a reading is none of this quantity


class ReadingTrial(Observed):
    """Residuals of depth [m] over the plane's distance, or of stamps [s] over the time that has passed."""

    kind = "readings"
    exact = True

    def __init__(self, recording: ReadingRecording, start: float, level: float | None = None) -> None:
        """Form the residual and its noise, or with the noise `level` of another recording.

        `start` is the reference's stamp from which drifts count [s].

        Raises:
            InputError: fewer than `LEAST_READINGS` readings.
        """
        if len(recording.reading) < LEAST_READINGS:
            raise InputError(
                f"{recording.name} has {len(recording.reading)} readings; {LEAST_READINGS} are the least"
            )
        self.recording, self._start = recording, start
        self.channels = (recording.quantity,)
        self.cached: dict[tuple[str, str], Any] = {}
        self._error = recording.reading - recording.reference
        self.outliers = 0
        if level is None:
            self.level, apart = self._noise()
            self.outliers = int(np.count_nonzero(apart > 1.0))
            self._sigma = self.level * apart * self._growth
        else:
            self.level, self._sigma = level, level * self._growth

    @property
    def over(self) -> np.ndarray:
        """What the error may grow with (N,): depth [m], or the time since the first stamp [s]."""
        reference = self.recording.reference
        return reference if self.recording.quantity == "depth" else reference - self._start

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.recording.name

    @property
    def places(self) -> tuple[str, ...]:
        """The sensor."""
        return (f"sensor:{self.recording.sensor}",)

    @property
    def units(self) -> Mapping[str, str]:
        """Of the quantity."""
        return UNITS

    @property
    def residual(self) -> Mapping[str, np.ndarray]:
        """(N, 1)."""
        return {self.channels[0]: self._error[:, None]}

    @property
    def sigma(self) -> Mapping[str, np.ndarray]:
        """(N, 1)."""
        return {self.channels[0]: self._sigma[:, None]}

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.recording.duration

    def elapsed(self, channel: str) -> np.ndarray:
        """Times (N,) since the first reading [s]."""
        return self.recording.time - self.recording.time[0]

    def phases(self, channel: str) -> np.ndarray:
        """All at rest (N, 1)."""
        return np.full((len(self._error), 1), REST)

    def drivers(self, channel: str, row: int) -> dict[str, np.ndarray]:
        """Depth or time, and their squares."""
        name = "depth" if self.recording.quantity == "depth" else "time passed"
        return {name: self.over, f"square of {name}": self.over**2, "time": self.elapsed(channel)}

    def names_of(self, kind: str) -> tuple[str, ...]:
        """The sensor."""
        return self.places if kind == "sensor" else ()

    def columns(self, *rows: np.ndarray) -> Columns:
        """Columns (N,) each of the residual."""
        return {(self.channels[0], 0): np.stack([np.broadcast_to(r, self._error.shape) for r in rows])}

    @property
    def _growth(self) -> np.ndarray:
        """Noise (N,) against that of a reading at 1 m: of depth it grows as disparity's noise does."""
        x = self.over
        return x**2 if self.recording.quantity == "depth" else np.ones_like(x)

    def _noise(self) -> tuple[float, np.ndarray]:
        """Standard deviation at 1 m around a smooth error, and factors (N,) above one that stand apart."""
        x, by = self.over, self._growth
        centred = (x - np.mean(x)) / max(float(np.std(x)), 1e-12)
        basis = np.stack([np.ones_like(x), centred, centred**2], axis=1) / by[:, None]
        y, weight = self._error / by, np.ones_like(x)
        left = y
        for _ in range(ROUNDS):
            a = basis * weight[:, None]
            left = y - basis @ np.linalg.lstsq(a, y * weight, rcond=None)[0]
            level = float(scale(left[:, None])[0])
            weight = np.sqrt(1.0 / (1.0 + (left / (2.5 * level)) ** 2))
        stated = self.recording.tolerances
        lasting = stated.deviation * stated.depth_pattern / max(float(np.median(x)), 1e-6)
        floor = np.array([lasting if self.recording.quantity == "depth" else 0.0])
        level = float(noise_level(left[:, None], floor)[0])
        score = np.abs(left) / np.hypot(level, 1.5 * float(np.median(np.abs(left))))
        apart = score > APART
        return level, np.where(apart, score**2, 1.0)


def tolerance_columns(trial: ReadingTrial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations."""
    stated = trial.recording.tolerances
    by, ones = widened * stated.deviation, np.ones_like(trial.over)
    if trial.recording.quantity == "depth":
        rows = [(trial.over, stated.depth_scale), (ones, stated.depth_offset)]
    else:
        rows = [(ones, stated.stamp), (trial.over, stated.drift)]
    return [(trial.columns(row), by * width) for row, width in rows if width > 0]
