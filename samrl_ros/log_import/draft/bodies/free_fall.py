"""What free fall proves about a track: which axis is up, the unit of its lengths and that of its time.

Nothing else in a recording has a size that everybody knows. Units differ by factors of ten and more, so a
fall tells them apart however wrong the frame rate or the length is that the diagnosis looks for later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.body_recording import GRAVITY

G = -GRAVITY[2]  # [m/s^2]
WINDOWS_S = (0.15, 0.3)  # of fitted parabolas; the longer where noise hides a fall in the shorter
LEAST_SAMPLES = 6  # of a window
SIZES = (0.6, 1.6)  # of what is seen over 9.81 m/s^2, for a unit to be possible
# Likewise, beyond which another frame rate or unit is likelier than an error of one.
SURE_SIZES = (0.75, 1.35)
SURE_LEAN = 0.3  # [rad] of gravity from an axis, beyond which that axis is hardly up
FAR_OFF = 3.0  # standard deviations by which a window may differ from the others
CLEAR = 0.12  # of gravity, that noise may make of a window's acceleration
FALLS_S = (0.18, 1.6)  # that a fall lasts; a longer one is one of metres in another unit
UNEVEN = 0.12  # of gravity, by which the acceleration of one fall may vary, and what noise does
LEAST_SPEED = 0.3  # [m/s] that a fall gains; less is any slow curve
MOST_WINDOWS = 4000


@dataclass(frozen=True)
class FreeFall:
    """A fall that was found, in the track's own axes."""

    unit: str  # of lengths
    time_unit: str
    axis: int  # 0, 1, 2 of the track's columns
    up: int  # +1 or -1 along it
    gravity: float  # as seen [m/s^2]
    lean: float  # of gravity from the axis [rad]
    seconds: float  # of falling

    @property
    def sure(self) -> bool:
        """Whether nothing about it is strange."""
        return SURE_SIZES[0] < self.gravity / G < SURE_SIZES[1] and self.lean < SURE_LEAN


def find_free_fall(
    time: np.ndarray, position: np.ndarray, time_units: dict[str, float], units: dict[str, float]
) -> FreeFall | None:
    """The unit of time and length, and the axis, for which the track holds a fall; None where none does.

    Args:
        time: (N,) as logged, increasing.
        position: (N, K) as logged, NaN left out.
        time_units: possible ones, as factors to s.
        units: likewise of lengths, as factors to m.
    """
    best: FreeFall | None = None
    for length in WINDOWS_S:
        for time_unit, seconds in time_units.items():
            windows = _fitted_windows(seconds * time, position, length)
            for unit, metres in units.items():
                for axis, up in _directions(position.shape[1]):
                    found = None if windows is None else _fall(windows, metres, axis, up)
                    if found is not None and (best is None or found[2] > best.seconds):
                        best = FreeFall(unit, time_unit, axis, up, *found)
        if best is not None:
            return best
    return None


def find_unscaled_fall(time: np.ndarray, position: np.ndarray) -> FreeFall | None:
    """A fall of positions in an unknown unit, whose `gravity` is in this unit per s^2; None where none is.

    Args:
        time: (N,) [s], increasing.
        position: (N, K) in any unit, pixels for example.
    """
    best: FreeFall | None = None
    for length in WINDOWS_S:
        windows = _fitted_windows(time, position, length)
        size = np.zeros(0) if windows is None else np.linalg.norm(windows.acceleration, axis=1)
        # The typical acceleration is that of the fall, unless most of the track rests.
        for typical in np.quantile(size, (0.5, 0.8)) if size.any() else ():
            for axis, up in _directions(position.shape[1]):
                found = None if windows is None or typical == 0 else _fall(windows, G / typical, axis, up)
                if found is None or found[1] > SURE_LEAN or (best and found[2] <= best.seconds):
                    continue
                best = FreeFall("", "s", axis, up, found[0] * typical / G, found[1], found[2])
    return best


def _directions(axes: int) -> list[tuple[int, int]]:
    """Axes that may be up, each with its sign."""
    return [(axis, up) for axis in range(axes) for up in (1, -1)]


@dataclass(frozen=True, eq=False)
class _Windows:
    time: np.ndarray  # (W,) [s] of the middle
    velocity: np.ndarray  # (W, K) at the middle
    acceleration: np.ndarray  # (W, K)
    spread: np.ndarray  # (W,) of the acceleration, by what the parabola leaves
    length: float  # [s]


def _fitted_windows(time: np.ndarray, position: np.ndarray, length: float) -> _Windows | None:
    """Parabolas over overlapping windows without gaps."""
    if len(time) < LEAST_SAMPLES:
        return None
    step = float(np.median(np.diff(time)))
    if not step > 0 or LEAST_SAMPLES * step > 2.0 * WINDOWS_S[-1]:
        return None
    size = max(LEAST_SAMPLES, round(length / step))
    stride = max(1, size // 6, len(time) // MOST_WINDOWS)
    rows = []
    for begin in range(0, len(time) - size + 1, stride):
        t = time[begin : begin + size]
        if t[-1] - t[0] > 1.5 * size * step:  # something was lost there
            continue
        middle = 0.5 * (t[0] + t[-1])
        basis = np.vander(t - middle, 3)
        inverse = np.linalg.pinv(basis)
        fitted = inverse @ position[begin : begin + size]
        rest = position[begin : begin + size] - basis @ fitted
        noise = float(np.sqrt(np.sum(rest**2) / (position.shape[1] * max(size - 3, 1))))
        rows.append((middle, fitted[1], 2.0 * fitted[0], 2.0 * noise * float(np.linalg.norm(inverse[0]))))
    if not rows:
        return None
    middle, velocity, acceleration, spread = zip(*rows, strict=True)
    return _Windows(
        np.array(middle), np.array(velocity), np.array(acceleration), np.array(spread), size * step
    )


def _fall(windows: _Windows, metres: float, axis: int, up: int) -> tuple[float, float, float] | None:
    """Gravity [m/s^2], its lean [rad] and how long [s] a track falls along an axis in a unit; None if not."""
    acceleration, spread = metres * windows.acceleration, metres * windows.spread
    down = -up * acceleration[:, axis]
    across = np.linalg.norm(np.delete(acceleration, axis, axis=1), axis=1)
    slack = FAR_OFF * spread
    falls = (
        (down > SIZES[0] * G - slack)
        & (down < SIZES[1] * G + slack)
        & (across < 0.4 * G + slack)
        & (spread < CLEAR * G)
    )
    kept: list[int] = []
    each_fall: list[float] = []
    lasted = 0.0
    for run in _runs(falls):
        seconds = float(windows.time[run[-1]] - windows.time[run[0]]) + windows.length
        sinking = -up * metres * windows.velocity[run, axis]
        uneven = float(np.std(down[run])) > UNEVEN * G + 2.0 * float(np.median(spread[run]))
        # What slides brakes likewise, but never against the way it goes: a fall speeds up downwards.
        if len(run) > 1 and FALLS_S[0] < seconds < FALLS_S[1] and sinking.max() > LEAST_SPEED and not uneven:
            kept += list(run)
            each_fall.append(float(np.mean(down[run])))
            lasted += seconds
    # One body is pulled alike in every fall; what is moved about bends now more, now less.
    if not kept or float(np.std(each_fall)) > UNEVEN * G + 2.0 * float(np.median(spread[kept])):
        return None
    weights = 1.0 / (spread[kept] ** 2 + (0.05 * G) ** 2)
    mean = (weights[:, None] * acceleration[kept]).sum(axis=0) / weights.sum()
    gravity = float(np.linalg.norm(mean))
    if not SIZES[0] < gravity / G < SIZES[1]:
        return None
    return gravity, float(np.arccos(np.clip(-up * mean[axis] / gravity, -1.0, 1.0))), lasted


def _runs(mask: np.ndarray) -> list[np.ndarray]:
    index = np.flatnonzero(mask)
    return [r for r in np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(r)]
