"""Readings of a sensor as the effects see them: reading minus reference, in one channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
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
ALIKE_M = 1e-5  # by which two reference depths are one
# Readings at one depth, and depths, from and up to which they share errors.
LEAST_ALIKE, MOST_PLATEAUS = (5, 60)
GROUPS, LEAST_SPREAD = 8, 0.4  # of readings by depth, and of its logarithm, that show how noise grows
NEXT_TO_STEP, STEP = 25, 8.0  # stamps on either side of a step of the clocks, and its size in their noise
SLOW = 6.0  # readings that count as one where it is asked whether anything at all is there
MOST_STEPS = 5  # that are told
# Share of the depth, and [m], by which no sensor is off: such a reading is of another surface.
ELSEWHERE, ELSEWHERE_M = 0.25, 0.05
LEFT_OUT = 1e3  # times the noise: as good as left out
APART = 6.0  # standard deviations beyond which a reading is none of this quantity


class ReadingTrial(Observed):
    """Residuals of depth [m] over the plane's distance, or of stamps [s] over the time that has passed."""

    kind = "readings"
    exact = True

    def __init__(self, recording: ReadingRecording, start: float, like: ReadingTrial | None = None) -> None:
        """Form the residual and its noise, or with the noise of another recording.

        `start` is the reference's stamp from which drifts count [s].

        Raises:
            InputError: fewer than `LEAST_READINGS` readings.
        """
        if len(recording.reading) < LEAST_READINGS:
            raise InputError(
                f"{recording.name} has {len(recording.reading)} readings; {LEAST_READINGS} are the least."
                " Give every reading, not their mean"
            )
        self.recording, self.start = recording, start
        self.channels = (recording.quantity,)
        self.cached: dict[tuple[str, str], Any] = {}
        self.tolerated = self.tolerances()
        self._error = recording.reading - recording.reference
        self.outliers = int(np.count_nonzero(self._elsewhere))
        if like is None:
            self.power = self._noise_power()
            self.level, apart = self._noise()
            self.outliers = int(np.count_nonzero((apart > 1.0) | self._elsewhere))
            self._sigma = self.level * apart * self._growth
        else:
            self.power, self.level = like.power, like.level
            self._sigma = self.level * self._growth
        self._sigma[self._elsewhere] *= LEFT_OUT

    @cached_property
    def _elsewhere(self) -> np.ndarray:
        """Readings (N,) that are of another surface, as the wall behind a board; none where most would be."""
        if self.recording.quantity != "depth":
            return np.zeros(len(self._error), dtype=bool)
        found = np.abs(self._error) > ELSEWHERE * self.over + ELSEWHERE_M
        return found & (found.mean() <= 0.5)

    @property
    def over(self) -> np.ndarray:
        """What the error may grow with (N,): depth [m], or the time since the first stamp [s]."""
        reference = self.recording.reference
        return reference if self.recording.quantity == "depth" else reference - self.start

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

    def tolerances(self, plateaus: Sequence[float] = ()) -> dict[str, tuple[np.ndarray, float]]:
        """What may be off by name, with the error (N,) that one unit of it makes, and its deviation."""
        stated, ones = self.recording.tolerances, np.ones_like(self.over)
        if self.recording.quantity == "depth":
            rows = {"scale": (self.over, stated.depth_scale), "offset": (ones, stated.depth_offset)}
            # What a plane's distance was measured wrong by, all readings at it share.
            for depth in plateaus:
                there = np.abs(self.over - depth) < ALIKE_M
                rows[f"plane at {depth!r} m"] = there * self.over, stated.depth_pattern
        else:
            rows = {"offset": (ones, stated.stamp), "drift": (self.over, stated.drift)}
        return {name: (row, stated.deviation * width) for name, (row, width) in rows.items() if width > 0}

    def shown(self, plateaus: Sequence[float]) -> set[str]:
        """Tolerances that stand out of the noise, each beyond what stronger ones explain."""
        rows = {name: by * row / self._sigma for name, (row, by) in self.tolerances(plateaus).items()}
        found, basis = set(), np.zeros((0, len(self._sigma)))
        for name in sorted(rows, key=lambda each: -float(rows[each] @ rows[each])):
            left = rows[name] - (basis @ rows[name]) @ basis
            if (strength := float(left @ left)) > SLOW:
                found.add(name)
                basis = np.vstack([basis, left / np.sqrt(strength)])
        return found

    def jumps(self) -> list[tuple[float, float]]:
        """(when, by how much) [s] the clocks step apart for good, the largest first; none of depth."""
        if self.recording.quantity != "stamp" or len(self._error) < 4 * NEXT_TO_STEP:
            return []
        size = NEXT_TO_STEP
        windows = np.median(np.lib.stride_tricks.sliding_window_view(self._error, size), axis=1)
        rise = windows[size:] - windows[:-size]
        rise = rise - np.median(rise)  # of a drift
        level = np.hypot(float(scale(rise[:, None])[0]), self.recording.tolerances.stamp)
        found: list[tuple[float, float]] = []
        while len(found) < MOST_STEPS and np.abs(rise).max() > STEP * level:
            at = int(np.argmax(np.abs(rise)))
            near = slice(max(at - size, 0), at + size)
            # A flank is as wide as the window; its middle is where the step is.
            flank = np.flatnonzero(np.abs(rise[near]) > 0.5 * abs(rise[at])) + near.start
            k = int(np.median(flank)) + size
            found.append((float(self.elapsed("")[k]), float(rise[at])))
            rise[near] = 0.0
        return found

    def drift_between(self, jumps: Sequence[tuple[float, float]]) -> tuple[float, float]:
        """By how much the clocks drift between their steps [s/s], and its standard deviation."""
        time, y = self.elapsed(""), self._error / self._sigma
        near = NEXT_TO_STEP * float(np.median(np.diff(time)))
        rows = [np.ones_like(time), time - np.mean(time), *(time > when for when, _ in jumps)]
        far = np.all([np.abs(time - when) > near for when, _ in jumps], axis=0)
        a = (np.stack(rows, axis=1) / self._sigma[:, None])[far]
        covariance = np.linalg.pinv(a.T @ a)
        return float((covariance @ (a.T @ y[far]))[1]), float(np.sqrt(covariance[1, 1]))

    @property
    def _growth(self) -> np.ndarray:
        """Noise (N,) against that of a reading at 1 m, or of any stamp."""
        return self.over**self.power if self.power else np.ones_like(self.over)

    def _noise_power(self) -> int:
        """Power of the depth with which noise grows: 2 as of disparity, less of a camera that times light.

        By what neighbouring readings differ by, at near and at far ones.
        """
        if self.recording.quantity != "depth":
            return 0
        error, over = self._error[~self._elsewhere], self.over[~self._elsewhere]
        steps, x = np.diff(error), 0.5 * (over[1:] + over[:-1])
        groups = np.array_split(np.argsort(x, kind="stable"), max(2, min(GROUPS, len(x) // LEAST_READINGS)))
        depth = np.log([float(np.median(x[g])) for g in groups])
        if float(np.ptp(depth)) < LEAST_SPREAD:
            return 2
        level = np.log([float(scale(steps[g][:, None])[0]) for g in groups])
        return int(np.clip(round(float(np.polyfit(depth, level, 1)[0])), 0, 2))

    def _noise(self) -> tuple[float, np.ndarray]:
        """Standard deviation at 1 m around a smooth error, and factors (N,) above one that stand apart."""
        kept = ~self._elsewhere
        x, by = self.over[kept], self._growth[kept]
        centred = (x - np.mean(x)) / max(float(np.std(x)), 1e-12)
        basis = np.stack([np.ones_like(x), centred, centred**2], axis=1) / by[:, None]
        y, weight = self._error[kept] / by, np.ones_like(x)
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
        # Delays and rounded depths have longer tails than a Gaussian, of which quantiles tell too little.
        steps = np.diff(left)[~(apart[1:] | apart[:-1])]
        level = max(level, float(np.std(steps)) / np.sqrt(2.0)) if len(steps) > LEAST_READINGS // 2 else level
        factors = np.ones(len(kept))
        factors[kept] = np.where(apart, score**2, 1.0)
        return level, factors


def tolerance_columns(trial: ReadingTrial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations."""
    return [(trial.columns(row), widened * by) for row, by in trial.tolerated.values()]


def plateaus_of(recordings: Sequence[ReadingRecording]) -> tuple[float, ...]:
    """Reference depths [m] that several readings have: planes that stood still. None where depth varies."""
    if recordings[0].quantity != "depth":
        return ()
    depths = np.concatenate([r.reference for r in recordings])
    values, count = np.unique(np.round(depths / ALIKE_M) * ALIKE_M, return_counts=True)
    often = values[count >= LEAST_ALIKE]
    return tuple(map(float, often)) if len(often) <= MOST_PLATEAUS else ()
