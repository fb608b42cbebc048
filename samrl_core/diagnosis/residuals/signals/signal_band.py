"""One uniform clock and one zero-phase band for every channel of a recording."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy import interpolate, signal

from samrl_core.diagnosis.residuals.signals.sample_times import SampleTimes, between, regular
from samrl_core.diagnosis.residuals.signals.signal_noise import highest_sure_frequency
from samrl_core.diagnosis.residuals.signals.zero_phase import ZeroPhaseFilter

SMOOTH_HZ = 80.0  # for quantities that enter a nonlinear formula before the band is applied
EDGE_PERIODS = 2.5  # of the band: so long after the start, and before the end, a filter bends signals
LEAST_SURE_HZ = 1.0  # up to which a motion counts as one, or a fiftieth of a slower log's rate
SAME_INSTANT = 1e-3  # of a sample, by which a stamp that has been rounded may follow it
MOST_OF_IT = 0.04  # of a recording, at most, that is lost so at either end


class SignalBand:
    """Filters of signals at `full` rate (F, ...) and their band-limited samples (N, ...)."""

    def __init__(self, rate: float, band: float, duration: float, dynamic: bool) -> None:
        """Design the filters.

        Args:
            rate: of full-rate signals [Hz].
            band: what is compared reaches up to here [Hz].
            duration: of the recording [s].
            dynamic: whether accelerations are formed; else only tracking can be compared.
        """
        self.rate, self.band = rate, band
        self.dynamic = dynamic
        self.step = max(1, round(rate / (4.0 * band))) if self.dynamic else 1
        self._band_sections = signal.butter(3, band, fs=rate, output="sos") if self.dynamic else None
        self._keep_band = None if self._band_sections is None else ZeroPhaseFilter(self._band_sections)
        self._keep_smooth = ZeroPhaseFilter(
            signal.butter(3, min(SMOOTH_HZ, rate / 3.0), fs=rate, output="sos")
        )
        self.edge = 1  # samples lost to the filter at either end
        if self.dynamic:
            # To the filter a recording goes on as its mirror image. A machine that begins in mid-motion does
            # not accelerate there, says the filtered position, while the torque says that it does.
            lost = min(EDGE_PERIODS / band, max(1.0 / band, MOST_OF_IT * duration))
            self.edge = int(np.ceil(lost * rate))

    @cached_property
    def dt(self) -> float:
        """Spacing of the band-limited samples [s]."""
        return self.step / self.rate

    def smooth(self, x: np.ndarray) -> np.ndarray:
        """Full-rate signal without the noise above the smoothing band; (F, ...) to (F, ...)."""
        return self._keep_smooth(x) if self.dynamic else x

    def reduce(self, x: np.ndarray) -> np.ndarray:
        """Band-limit and decimate a full-rate signal, (F, ...) to (N, ...)."""
        return self._pick(self._filtered(x))

    def reduce_variance(self, variance: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Variance (N, J) of a band-limited signal, of that of its samples (F, J).

        Samples that keep the reading of the one before, `held` (F, J), have its error too; else errors are
        independent. So each reading's errors pass the filter together, and their squares add up: a single one
        rings in the samples around it, too, and a slow axis keeps one error for longer than the filter.
        """
        if self._band_sections is None:
            return self._pick(variance)
        reach = max(1, min(round(EDGE_PERIODS / self.band * self.rate), (len(variance) - 1) // 2))
        impulse = np.zeros(2 * reach + 1)
        impulse[reach] = 1.0
        response = signal.sosfiltfilt(self._band_sections, impulse, padtype=None)
        found = np.zeros((len(variance) + 2 * reach, variance.shape[1]))
        for j, column in enumerate(variance.T):
            (at,) = np.nonzero(column > 0)
            begins = (np.diff(at, prepend=-2) > 1) | ~held[at, j]
            for run in np.split(at, np.flatnonzero(begins)[1:]) if len(at) else []:
                rings = np.convolve(np.sqrt(column[run]), response)
                found[run[0] : run[0] + len(rings), j] += rings**2
        return self._pick(found[reach:-reach])

    def sure(self, x: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """A signal (F, J) up to where it stands out of its own white noise of deviation (J,)."""
        return self.sure_by(x, x, noise)

    def sure_by(self, x: np.ndarray, read: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """A signal (F, J) up to where a reading (F, J) stands out of white noise (J,), if within the band."""
        if not self.dynamic:
            return x
        highest = highest_sure_frequency(read, noise, self.rate)
        cut = np.flatnonzero(highest < self.band)
        if not len(cut):
            return x
        out, least = x.copy(), min(LEAST_SURE_HZ, self.rate / 50.0)
        for j in cut:
            low = signal.butter(3, max(float(highest[j]), least), fs=self.rate, output="sos")
            out[:, j] = signal.sosfiltfilt(low, x[:, j])
        return out

    def _filtered(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(x, dtype=float) if self._keep_band is None else self._keep_band(x)

    def _derivative(self, x: np.ndarray, order: int) -> np.ndarray:
        """Time derivative (F, J) of a band-limited full-rate signal.

        Differences of neighbours lose a hundredth of it at 4 Hz in a log of 125 Hz, twice that in a second
        derivative, and a quarter at the edge of the band: the torque that is missing then looks like a cause.
        """
        if not self.dynamic:
            for _ in range(order):
                x = np.gradient(x, 1.0 / self.rate, axis=0)
            return x
        ticks = np.arange(len(x))
        return np.asarray(interpolate.make_interp_spline(ticks, x, k=7)(ticks, nu=order)) * self.rate**order

    def acceleration_of(self, x: np.ndarray) -> np.ndarray:
        """Second derivative (N, J) of full-rate positions (F, J), as accelerations are made of readings."""
        return self._pick(self._derivative(self._filtered(x), 2))

    def _pick(self, x: np.ndarray) -> np.ndarray:
        return x[self.edge : len(x) - self.edge : self.step]

    def derivative(self, x: np.ndarray) -> np.ndarray:
        """Time derivative of a band-limited signal (N, ...)."""
        return np.gradient(x, self.dt, axis=0)

    def second_derivative(self, x: np.ndarray) -> np.ndarray:
        """Second time derivative of a band-limited signal (N,), good to 2 % up to the edge of the band.

        Differences of four samples a period would lose six tenths of it there, and with it all that tells a
        link that swings from one that does not. What is not finite (a shape that ran away) stays so.
        """
        if not np.isfinite(x).all():
            return np.full(len(x), np.nan)
        spline = interpolate.make_interp_spline(np.arange(len(x)), x, k=7)
        return np.asarray(spline(np.arange(len(x)), nu=2)) / self.dt**2

    def delayed(self, x: np.ndarray, delay: float) -> np.ndarray:
        """A full-rate signal later by a fraction of samples (linear); the start is held."""
        source = np.arange(len(x)) - delay * self.rate
        low = np.clip(np.floor(source).astype(int), 0, len(x) - 1)
        high = np.minimum(low + 1, len(x) - 1)
        part = np.clip(source - low, 0.0, 1.0)
        part = part.reshape((-1,) + (1,) * (x.ndim - 1))
        return x[low] * (1.0 - part) + x[high] * part

    @property
    def band_share(self) -> float:
        """Part of a white noise's variance that passes the band."""
        return 2.0 * self.band / self.rate if self.dynamic else 1.0


def onto_grid(
    taken: SampleTimes, values: np.ndarray | None, grid: np.ndarray, wandering: bool = False
) -> np.ndarray | None:
    """Samples on the grid: those of the same ticks as they are, what is missing or slower interpolated.

    `wandering` interpolates those whose stamps keep no regular clock too: nobody computed from them alone.
    """
    if values is None:
        return None
    ticks = taken.time
    period, step = float(np.median(np.diff(ticks))), float(grid[1] - grid[0])
    if period >= 1.5 * step or (wandering and not (taken.regular or taken.own)):
        return np.stack([np.interp(grid, ticks, column) for column in values.T], axis=1)
    if taken.own:
        return between(ticks, values, grid)
    # Nearest, not interpolated: the controller computed from this very sample, noise included.
    index = nearest(ticks, grid)
    out = values[index]
    missing = np.abs(ticks[index] - grid) > 0.75 * step
    if taken.regular and missing.any():
        out[missing] = between(ticks, values, grid[missing])
    return out


def read_times(taken: SampleTimes, grid: np.ndarray) -> np.ndarray:
    """When what `onto_grid` puts on the grid was read (F,) [s]: the stamps of rows that stand for others."""
    ticks, step = taken.ticks, float(grid[1] - grid[0])
    if taken.own or taken.regular or float(np.median(np.diff(ticks))) >= 1.5 * step:
        return grid
    return np.asarray(ticks[nearest(ticks, grid)])


def nearest(ticks: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Sample (F,) that is nearest to each time of the grid (F,)."""
    index = np.clip(np.searchsorted(ticks, grid), 1, len(ticks) - 1)
    return index - ((grid - ticks[index - 1]) < (ticks[index] - grid))


def held_on_grid(
    time: np.ndarray, values: np.ndarray | None, grid: np.ndarray, mean: bool
) -> np.ndarray | None:
    """What a signal (N, J) is at each sample of the grid (F, J) if each value holds until the next stamp.

    Args:
        time: stamps (N,) [s].
        values: (N, J); None gives None.
        grid: regular (F,) [s].
        mean: over a step of the grid about each sample, as the motion feels it, and not at its instant, as a
            controller that sends its torque at that instant reads it.
    """
    if values is None:
        return None
    ticks = regular(time)
    step = float(grid[1] - grid[0])
    if not mean:  # a stamp that is late by rounding alone counts as come
        return values[np.clip(np.searchsorted(ticks, grid + SAME_INSTANT * step, side="right") - 1, 0, None)]
    bounds = np.concatenate([[grid[0] - step], ticks[1:], [max(ticks[-1], grid[-1]) + step]])
    area = np.cumsum(values * np.diff(bounds)[:, None], axis=0).T

    def until(time: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(time, bounds, np.concatenate([[0.0], a])) for a in area], axis=1)

    return (until(grid + 0.5 * step) - until(grid - 0.5 * step)) / step
