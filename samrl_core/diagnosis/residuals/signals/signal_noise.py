"""What readings are worth: their clock, their steps, their white noise, and what stands out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage, signal
from scipy.interpolate import make_interp_spline

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.residuals.signals.low_pass import LowPass, find_offline_filter
from samrl_core.diagnosis.residuals.signals.spectrum import detrended_spectrum

DIFFERENCED = 1e-6  # of the largest velocity: rounding of what is the same
BACKWARD = 1e-3  # the same of a driver's, whose period is that of its stamps but for their jitter
MOST_ROWS = 0.95  # that must be so; behind a lost row, none is
UNEVEN = 0.01  # relative, of a published log's steps
APART = 0.1  # of a velocity's power where there is noise, by which the positions' derivative may miss it
SURE_SPAN_S = 2.0  # of the spectra that tell a motion from noise
SURE_SAMPLES = 64  # of them, at least
FAST_HZ = 60.0  # a log of such a rate follows what arms do; a slower one must show that it does
JITTER = 0.02  # of that rate: frames that come late make 59.5 of 60 Hz
SLOWEST_HZ = 8.0  # no log below it tells accelerations
NEARBY = 11  # samples over which an acceleration that is not known is spread by the band
FOLLOWED = 0.2  # of what accelerations are made of may stay unknown between every other sample
STANDS_OUT = 6.0  # times the power of noise: chance does not reach it in a spectrum of a few averages


@dataclass(frozen=True, eq=False)
class Noise:
    """White noise of the raw channels at full rate, from their content above the moving band; each (J,).

    Of a torque that a driver filtered, it is the white noise that is as large within the band.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    commanded_effort: np.ndarray
    effort_filter: LowPass  # before the joints' torque sensors
    torque_filter: LowPass  # before the torque that the drives report


@dataclass(frozen=True, eq=False)
class Reading:
    """The readings that accelerations are differences of."""

    values: np.ndarray  # (F, J)
    deviation: np.ndarray  # (J,) of their white noise
    order: int  # of those differences: 1 of velocities, 2 of positions


def without_differences(states: JointSignal) -> JointSignal:
    """States without a velocity that somebody differenced from the positions: it is no reading of its own.

    Its noise is that of the positions, and rises with frequency where a tachometer's is white. What a driver
    makes of its last two readings is half a period late as well: of a log at 100 Hz, 5 ms.
    """
    return replace(states, velocity=None) if is_difference(states) or _looks_back(states) else states


def is_difference(logged: JointSignal) -> bool:
    """Whether all speeds of states or of a command are central differences of the logged positions."""
    if logged.position is None or logged.velocity is None or len(logged) < 3:
        return False
    apart = np.gradient(logged.position, logged.time, axis=0) - logged.velocity
    return bool(np.abs(apart).max() <= DIFFERENCED * np.abs(logged.velocity).max())


def _looks_back(states: JointSignal) -> bool:
    """Whether most speeds are what the last two logged readings make, by their stamps or the driver's period.

    Behind a lost row they are not: the reading before it is not in the log. Of a command no such question
    arises: a controller that is fed a speed that looks back is fed that speed.
    """
    if states.position is None or states.velocity is None or len(states) < 3:
        return False
    steps, moved = np.diff(states.time)[:, None], np.diff(states.position, axis=0)
    speed, largest = states.velocity[1:], np.abs(states.velocity).max(axis=0)
    off = np.minimum(np.abs(moved / steps - speed), np.abs(moved / np.median(steps) - speed))
    turns = largest > 0.0
    alike = np.all(off[:, turns] <= BACKWARD * largest[turns], axis=1)
    return bool(turns.any() and np.mean(alike) >= MOST_ROWS)


def without_filtered_rate(states: JointSignal, band: float) -> JointSignal:
    """States without a velocity that was worked out of the positions before both were filtered and published.

    It differs from the difference of what was published, which has fewer samples, and is no reading either.

    Args:
        states: as logged.
        band: up to which motions are compared where positions are differenced [Hz].
    """
    q, dq, time = states.position, states.velocity, states.time
    if q is None or dq is None or len(states) < 3:
        return states
    steps = np.diff(time)
    rate = 1.0 / float(np.median(steps))
    if np.abs(steps * rate - 1.0).max() > UNEVEN:
        return states
    behind = find_offline_filter(q, rate, min(band, rate / 5.0))
    if behind.form is None:
        return states
    ticks = np.arange(len(q))
    derived = make_interp_spline(ticks, q, k=7)(ticks, nu=1) * rate
    length = min(len(q), SURE_SAMPLES)
    frequency, own = signal.welch(dq, fs=rate, nperseg=length, axis=0)
    _, apart = signal.welch(dq - derived, fs=rate, nperseg=length, axis=0)
    inside = (frequency > behind.begins * rate) & (frequency < behind.corner * rate)
    if not inside.any() or np.median(apart[inside] / np.maximum(own[inside], 1e-300), axis=0).max() > APART:
        return states
    return replace(states, velocity=None)


def quantum(position: np.ndarray) -> np.ndarray:
    """Step (J,) of the grid that readings (F, J) lie on; 0 where they lie on none."""
    out = np.zeros(position.shape[1])
    for j, steps in enumerate(np.abs(np.diff(position, axis=0)).T):
        some = steps[steps > 1e-9]
        if len(some) < 10:
            continue
        # A log's digits round the step too: what many steps make of it is finer than the smallest.
        step = float(np.min(some))
        for most in (5.0, 30.0, np.inf):
            few = some[some < (most + 0.5) * step]
            step = float(np.sum(few) / np.sum(np.round(few / step)))
        counts = some / step
        # A float's smallest difference is no grid: most steps would be thousands of it.
        if np.median(counts) < 1000.0 and np.all(np.abs(counts - np.round(counts)) < 0.02):
            out[j] = step
    return out


def highest_sure_frequency(x: np.ndarray, noise: np.ndarray, rate: float) -> np.ndarray:
    """Frequency (J,) [Hz] up to which readings (F, J) stand out of white noise (J,) of known deviation."""
    length = min(len(x), max(round(SURE_SPAN_S * rate), SURE_SAMPLES))
    frequency, power = detrended_spectrum(x, rate, length)
    above = power > STANDS_OUT * noise**2 * 2.0 / rate
    return np.array([frequency[column][-1] if column.any() else 0.0 for column in above.T])


def is_fast(rate: float) -> bool:
    """Whether a log of this rate [Hz] follows what arms do, whatever their motion."""
    return rate > (1.0 - JITTER) * FAST_HZ


def tells_accelerations(states: JointSignal, rate: float) -> bool:
    """Whether a slow log moves so slowly that its samples tell accelerations; one reading may be coarse."""
    if rate < SLOWEST_HZ:
        return False
    readings = ((states.position, 2), (states.velocity, 1))
    return any(follows(read, order) for read, order in readings if read is not None)


def follows(x: np.ndarray, order: int) -> bool:
    """Whether every other sample of readings (F, J) at a regular rate tells those between.

    What a spline of half the samples misses is above a quarter of the rate, or noise; either would be in the
    accelerations. All joints together, so that one at rest does not speak with its noise.

    Args:
        x: positions or velocities.
        order: of their differences that accelerations are made of: 2 or 1.
    """
    if len(x) < 32:
        return False
    known = np.arange(0, len(x), 2)
    between = make_interp_spline(known, x[known], k=7)(np.arange(1, known[-1], 2))
    missed = (between - x[1 : known[-1] : 2])[4:-4]  # a spline's ends are worse than what it joins
    steps = np.diff(x, n=order, axis=0)
    return float(np.sqrt(np.mean(missed**2))) < FOLLOWED * float(np.sqrt(np.mean(steps**2)))


def unknown_acceleration(x: np.ndarray, rate: float, order: int) -> np.ndarray:
    """What every other sample of readings (F, J) would make another acceleration (F, J), nearby at most.

    Readings and order as in `follows`. A start or a stop within a sample's time is told so, in a log that is
    slow enough for the rest.
    """
    ticks = np.arange(len(x))
    whole = make_interp_spline(ticks, x, k=7)(ticks, nu=order)
    halves = [make_interp_spline(ticks[k::2], x[k::2], k=7)(ticks, nu=order) for k in (0, 1)]
    missed = np.max([np.abs(half - whole) for half in halves], axis=0) * rate**order
    return np.asarray(ndimage.maximum_filter1d(missed, NEARBY, axis=0))


def white_noise(x: np.ndarray, rate: float) -> np.ndarray:
    """Standard deviation (J,) of the white part of (F, J), from the spectrum's median in its upper half.

    The median of a chi-square lies below its mean, by 1 - 1 / 9 K to the third of K averages of two degrees
    of freedom (Wilson and Hilferty 1931): by three tenths of the power where a log is one stretch.
    """
    length = min(len(x), 512)
    frequency, power = detrended_spectrum(x, rate, length)
    upper = frequency > 0.25 * rate
    averages = 1 + (len(x) - length) // (length - length // 2)
    below = (1.0 - 1.0 / (9.0 * averages)) ** 3
    return np.sqrt(np.median(power[upper], axis=0) / below * rate / 2.0)


def noise_behind(x: np.ndarray, behind: LowPass) -> np.ndarray:
    """White noise (J,) of readings (F, J): behind a filter that which is as large within the band."""
    return behind.noise(x) if behind.form else white_noise(x, behind.rate)


def sample_detail(x: np.ndarray, stride: int = 1) -> np.ndarray:
    """Standard deviation (J,) of the detail of (F, J) between samples so far apart, but for single spikes."""
    detail = (x[2 * stride :] - 2.0 * x[stride:-stride] + x[: -2 * stride]) / np.sqrt(6.0)
    return 1.4826 * np.median(np.abs(detail), axis=0)
