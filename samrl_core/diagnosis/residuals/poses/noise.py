"""Noise of detected poses, from what the recording itself leaves when everything in the chain may be off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.corner_noise import corner_noise
from samrl_core.diagnosis.residuals.poses.student import ROBUST, log_student

POWERS = (0, 1, 2)  # of the distance with which noise of a detected pose may grow
ALIKE = ((0, 1), (2,), (3, 4, 5))  # channels that grow alike: across the view, along it, turns
CLEARLY = 5.0  # [nat] by which growing noise must be likelier than even noise
DECIMALS_S = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)  # to which stamps are rounded
DIGITS = 0.01  # of a decimal: as exact as stamps of 1.5e9 s are
BESIDE = 0.01  # of the steps, that are one decimal longer or shorter than most
JITTERS_S = (0.0, *(1e-4 * 2.0 ** (0.5 * k) for k in range(13)))  # [s] of stamps, up to 6 ms
LEAST_STEPS = 40  # views from which on differences tell it
NEAREST_M = 0.01  # of a target: nearer poses have the noise of this distance
LEAST_SPREAD = 0.3  # of the distance's logarithm, below which growth does not show
OUTLIER = 6.0  # standard deviations beyond which a detection is not one of the target
MOST_APART = 0.5  # of the detections: a median is of the others only as long as those are most
PAIRS_BREAK = 1.0 - np.sqrt(0.5)  # mistakes: of more, most differences of neighbours hold one
LEAST_CHANGED = 3  # detections in a row at one end that are no chance
IN_ROW, ELSEWHERE = 0.8, 0.1  # shares that stand apart at the end where something changed, and before it
ROUNDS = 6
SLOWEST = 1.0 / 3.0  # share of the views
SHARED = (
    4.0 / 3.0
)  # variance of what is read between two noisy readings, over what differences of neighbours hold
LEAST = np.array([1e-6] * 3 + [1e-6] * 3)  # [m], [rad]: rounding of a log


@dataclass(frozen=True, eq=False)
class DetectorNoise:
    """Noise of detected poses by how the target was seen: by corners where they tell, else its distance."""

    level: np.ndarray  # (6,) standard deviations where `growth` is one
    power: np.ndarray  # (6,) of the distance; not used with a square
    square: tuple[float, float] = (0.0, 0.0)  # half side [m] and beginning, as `corner_noise`; 0: none

    def growth(self, views: np.ndarray) -> np.ndarray:
        """Noise (N, 6) of views (N, 4, 4) of the target in the camera, up to the level."""
        if self.square[0]:
            return corner_noise(views, *self.square)
        return distance_of(views)[:, None] ** self.power

    def at(self, views: np.ndarray) -> np.ndarray:
        """Standard deviations (N, 6) of views (N, 4, 4) of the target in the camera."""
        return self.level * self.growth(views)


def distance_of(views: np.ndarray) -> np.ndarray:
    """Of the target in views (N, 4, 4), (N,) [m], no less than `NEAREST_M`."""
    return np.maximum(np.linalg.norm(views[:, :3, 3], axis=1), NEAREST_M)


def find_apart(
    left: np.ndarray, floor: np.ndarray, least: np.ndarray, step: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """The noise level (6,) of what is left (N, 6), and how far each detection (N,) stands apart.

    Where so many stand apart that differences of neighbours tell of them, their scatter tells first who does,
    and the others then tell the noise. Where most do, nobody does: there is nothing to compare with.

    Args:
        left: what is left of the residuals, as if all were at one distance.
        floor: what a detector's errors that last may be, (6,).
        least: no noise is less, (6,).
        step: detections from one to the next whose noise is another's, as `noise_level`.

    Returns:
        The level, and standard deviations beyond `OUTLIER`; 0 of those that do not stand apart.
    """
    level = np.maximum(noise_level(left, floor, step), least)
    by_scatter = _score(left, np.maximum(scale(left), least)) > OUTLIER
    if PAIRS_BREAK < by_scatter.mean() <= MOST_APART:
        level = np.maximum(noise_level(left[~by_scatter], floor, step), least)
    score = _score(left, level)
    apart = score > OUTLIER
    return level, np.where(apart & (apart.mean() <= MOST_APART), score, 0.0)


def find_tour(places: Sequence[np.ndarray]) -> np.ndarray:
    """An order (N,) in which each view lies near the one before it: from the first to the nearest, and so on.

    Views at rest come in any order. An error that a place makes is alike in places that are near, and is no
    noise; differences of views in the order of a log hold all of it.

    Args:
        places: positions (N, 3) of what may make the error, each weighed by how far it spreads.
    """
    spread = [np.sqrt(np.mean(np.sum((x - x.mean(axis=0)) ** 2, axis=1))) for x in places]
    x = np.hstack([p / s for p, s in zip(places, spread, strict=True) if s > 0.0] or [places[0]])
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    order, left = [0], np.ones(len(x), dtype=bool)
    left[0] = False
    while left.any():
        order.append(int(np.where(left, apart[order[-1]], np.inf).argmin()))
        left[order[-1]] = False
    return np.array(order)


def _score(left: np.ndarray, level: np.ndarray) -> np.ndarray:
    """How far detections (N,) are from the others, in standard deviations of the channel that is worst."""
    return np.max(np.abs(left) / np.hypot(level, 1.5 * np.median(np.abs(left), axis=0)), axis=1)


def find_change(apart: np.ndarray) -> tuple[int, int] | None:
    """Where detections that stand apart are all at one end: something was moved in between.

    Args:
        apart: which detections stand apart from the others, (N,) bool.

    Returns:
        Begin and end of those in a row; None where they come in any order, as a detector's mistakes do.
    """
    count = len(apart)
    for order, is_end in ((apart, True), (apart[::-1], False)):
        for begin in range(1, count - LEAST_CHANGED + 1):
            if order[begin] and order[begin:].mean() >= IN_ROW and order[:begin].mean() <= ELSEWHERE:
                return (begin, count) if is_end else (0, count - begin)
    return None


def growth_power(left: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Powers (6,) of the distance (N,) with which what is left (N, 6) grows; 0 where it does not clearly.

    A corner's noise in pixels moves a pose across the view with the distance, and along it and in its turns
    up to its square. By the likelihood of a Student distribution, which wrong detections hardly move.
    """
    out, x = np.zeros(left.shape[1]), np.log(distance)
    if float(np.ptp(x)) < LEAST_SPREAD:
        return out
    x = x - x.mean()
    for channels in ALIKE:
        y = left[:, list(channels)]
        likely = np.array([log_student(y * np.exp(-p * x)[:, None]) for p in POWERS])
        best = int(np.argmax(likely))
        out[list(channels)] = POWERS[best] if likely[best] > likely[0] + CLEARLY else 0
    return out


def rounding(stamps: np.ndarray) -> float:
    """Standard deviation [s] of stamps (N,) that were rounded, as to the 10 ms that 12 digits hold; else 0.

    Steps are whole numbers of a decimal, and neighbouring ones: an exact clock of 30 ms with lost poses has
    steps of 30 and 60 ms, one that was rounded of 30 and 40. What it does lasts over neighbours where the
    rate and the decimal nearly agree, so that differences need not show it.
    """
    steps = np.diff(stamps)
    for decimal in DECIMALS_S:
        count = steps / decimal
        whole = np.round(count)
        middle = float(np.median(whole)) if len(whole) else 0.0
        if middle >= 2.0 and float(np.abs(count - whole).max()) < DIGITS:
            beside = float((np.abs(whole - middle) == 1.0).mean())
            return decimal / np.sqrt(12.0) if beside > BESIDE else 0.0
    return 0.0


def stamp_jitter(
    left: np.ndarray, rate: np.ndarray, level: np.ndarray, step: int = 1, least: float = 0.0
) -> float:
    """By how much stamps scatter [s], where noise clearly grows with speed (N, 6) per s; else `least`.

    By differences of neighbours, which hold no delay and no drift: those are no noise.

    Args:
        left: what is left of the residuals (N, 6).
        rate: change of the target's pose per second (N, 6) that a shift of stamps makes.
        level: noise (6,) of any view.
        step: views from one to the next whose noise is another's.
        least: by how much they scatter as is known.
    """
    steps = (left[step:] - left[:-step]) / np.sqrt(2.0)
    speed = np.abs(0.5 * (rate[step:] + rate[:-step])) / level

    def likely(jitter: float) -> float:
        grown = np.sqrt(1.0 + (jitter * speed) ** 2)
        return log_student(steps / grown) - float(np.sum(np.log(grown)))

    found = {jitter: likely(jitter) for jitter in (least, *(j for j in JITTERS_S if j > least))}
    best = max(found, key=found.__getitem__)
    return best if found[best] > found[least] + CLEARLY else least


def slow_level(left: np.ndarray, rate: np.ndarray, jitter: float, step: int = 1) -> np.ndarray:
    """Noise (6,) of what is left (N, 6) beside that of scattering stamps, from the slowest third.

    Of all views most are in motion, where the stamps' noise hides any other.

    Args:
        left: what is left of the residuals (N, 6).
        rate: as `stamp_jitter`.
        jitter: scatter of the stamps [s].
        step: views from one to the next whose noise is another's.
    """
    steps = (left[step:] - left[:-step]) / np.sqrt(2.0)
    speed = np.sqrt(0.5 * (rate[step:] ** 2 + rate[:-step] ** 2))
    out = np.zeros(left.shape[1])
    for k, column in enumerate(speed.T):
        slow = column <= np.quantile(column, SLOWEST)
        total = float(ROBUST * np.median(np.abs(steps[slow, k])))
        moved = jitter * float(np.sqrt(np.mean(column[slow] ** 2)))
        out[k] = np.sqrt(max(total**2 - moved**2, 0.25 * total**2))
    return np.maximum(out, LEAST)


def leftover(residual: np.ndarray, columns: Sequence[np.ndarray], spread: Sequence[float]) -> np.ndarray:
    """Residuals (N, 6) after a robust fit of columns (N, 6) with Gaussian priors, scaled to their freedom.

    Cauchy weights keep wrong detections from pulling the fit (Huber 1981, Robust Statistics).
    """
    design = np.stack([c.reshape(-1) * s for c, s in zip(columns, spread, strict=True)], axis=1)
    y = residual.reshape(-1)
    left, used = residual, 0.0
    for _ in range(ROUNDS):
        level = scale(left)
        weight = 1.0 / (1.0 + (left / (2.5 * level)) ** 2)
        root = (np.sqrt(weight) / level).reshape(-1)
        a, b = design * root[:, None], y * root
        with np.errstate(over="ignore", invalid="ignore"):
            normal = a.T @ a
        if not np.isfinite(normal).all():
            raise InputError(
                f"poses change by up to {np.abs(design).max():.3g} m or rad; check the stamps and the unit"
            )
        # Where all that can be off moves the poses alike, rounding may hide the prior: no inverse is there.
        inverse = np.linalg.pinv(normal + np.eye(len(normal)), hermitian=True)
        left = (y - design @ (inverse @ (a.T @ b))).reshape(residual.shape)
        used = float(np.trace(inverse @ normal))
    return left * np.sqrt(y.size / max(y.size - used, 0.25 * y.size))


def scale(values: np.ndarray) -> np.ndarray:
    """Robust standard deviation (6,) of residuals (N, 6)."""
    return np.maximum(ROBUST * np.median(np.abs(values - np.median(values, axis=0)), axis=0), LEAST)


def noise_level(left: np.ndarray, floor: np.ndarray, step: int = 1) -> np.ndarray:
    """Standard deviation (6,) of what is left: its white part, and of what lasts no more than `floor` (6,).

    Differences of neighbours hold the white part alone. Errors of a detector last over neighbouring views;
    beyond what detectors are known for, what lasts is a gap. Where neighbours share a reading of an
    interpolated track, its noise is in both: those `step` views apart have theirs, and tell up to `SHARED`
    times the variance. What lasts would make them differ by more.
    """
    white = np.maximum(scale(np.diff(left, axis=0)) / np.sqrt(2.0), LEAST) if len(left) > 4 else scale(left)
    if step > 1 and len(left) > 4 + step:
        apart = scale(left[step:] - left[:-step]) / np.sqrt(2.0)
        white = np.clip(apart, white, np.sqrt(SHARED) * white)
    lasting = np.sqrt(np.maximum(scale(left) ** 2 - white**2, 0.0))
    return np.hypot(white, np.minimum(lasting, floor))
