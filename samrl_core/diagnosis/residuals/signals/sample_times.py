"""When samples were taken: at the ticks of a regular clock, some of them missing, or at their own stamps.

A logger that is woken late stamps late what a drive read on time: then its ticks are the better times. One
that reads when it is woken takes a later reading too: then its stamps are. The readings tell which it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import interpolate

JITTERS = 0.45  # of a period, at most, in a clock that is still one
MOST_ROWS = 0.8  # of a clock's ticks, at least, that a log holds
MISSING = 1.5  # periods from a sample to the next, from where on one between them is missing
SLOPE_SAMPLES = 4  # to either side, that tell how fast a reading moves
HOLDS_SAMPLES = 10  # over which a clock that wanders still keeps its period
SURE = 6.0  # standard errors of white noise by which stamps must tell the motion better than ticks


@dataclass(frozen=True, eq=False)
class SampleTimes:
    """Of the samples of one channel."""

    time: np.ndarray  # (N,) [s], increasing
    ticks: np.ndarray  # (N,) [s] of the clock, or stamps that belong to none
    regular: bool  # ticks of a clock
    own: bool  # each sample was taken at its stamp, and not at the clock's tick


def sample_times(time: np.ndarray, *readings: np.ndarray | None) -> SampleTimes:
    """Of stamps (N,) [s] and what was read then, each (N, J) or not recorded."""
    ticks = regular(time)
    if any(taken_at_stamps(time, ticks, read) for read in readings if read is not None):
        return SampleTimes(time, ticks, False, True)
    return SampleTimes(ticks, ticks, ticks is not time, False)


def regular(time: np.ndarray) -> np.ndarray:
    """Stamps freed of their jitter, where they belong to a regular clock; else as they are."""
    counts = [np.arange(len(time))]
    steps = np.diff(time)
    if len(steps) and (some := steps[steps <= MISSING * np.median(steps)]).any():
        index = np.concatenate([[0], np.cumsum(np.maximum(np.round(steps / np.mean(some)), 1.0))])
        if len(time) >= MOST_ROWS * (index[-1] + 1):
            counts.append(index)
    for index in counts:  # with every row there; else with as many missing as the steps say
        period, start = np.polyfit(index, time, 1)
        fitted = start + period * index
        if float(np.max(np.abs(fitted - time))) < JITTERS * period:
            return fitted
    return time


def taken_at_stamps(time: np.ndarray, ticks: np.ndarray, read: np.ndarray) -> bool:
    """Whether readings (N, J) move by their speed times the jitter of their stamps.

    A sample that is taken late by d holds x + d dx/dt. Fourth differences over neighbours leave nothing of
    the motion itself; how much of d dx/dt is in them is a regression over all joints.
    """
    reach, steps = 2 * SLOPE_SAMPLES + 1, np.diff(time)
    if len(time) < 8 * reach:
        return False
    if ticks is time:  # no clock over the whole recording; one that wanders keeps its period for a while
        index = np.arange(len(time))
        knots = np.unique(np.append(index[::HOLDS_SAMPLES], index[-1]))
        ticks = np.interp(index, knots, time[knots])
    late = time - ticks
    there = steps < MISSING * np.median(steps)
    usable = np.all(np.lib.stride_tricks.sliding_window_view(there, reach - 1), axis=1)
    middle = slice(SLOPE_SAMPLES, len(time) - SLOPE_SAMPLES)
    moment = power = rest = 0.0
    for column in read.T:
        slope = (column[reach - 1 :] - column[: 1 - reach]) / (time[reach - 1 :] - time[: 1 - reach])
        whole = np.diff(np.where(usable, column[middle], np.nan), n=4)
        moved = np.diff(np.where(usable, slope * late[middle], np.nan), n=4)
        seen = np.isfinite(whole) & np.isfinite(moved)
        noise = float(np.mean(whole[seen] ** 2)) if seen.any() else 0.0
        if noise <= 0.0:
            continue
        moment += float(whole[seen] @ moved[seen]) / noise
        power += float(moved[seen] @ moved[seen]) / noise
        rest += float(np.count_nonzero(seen))
    if power <= 0.0:
        return False
    share = moment / power  # 1 where stamps are right, 0 where ticks are
    return share > 0.5 and (share - 0.5) * np.sqrt(power) > SURE


def between(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (N, J) between samples: a curve through the nearest few, that does not swing beside steps."""
    curve = interpolate.Akima1DInterpolator(time, values, axis=0, extrapolate=True)
    return np.asarray(curve(np.clip(at, time[0], time[-1])))
