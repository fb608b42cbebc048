"""Which part of a track is flight and which is contact: the best sequence of parabolas and lines.

The height over the support (or along gravity) is a parabola in flight and a line in contact, whatever height
the support really has. Every stretch of samples has a cost as flight, as contact or as neither (an impact, a
hand, a tumble); dynamic programming finds the sequence of least cost (optimal partitioning; Jackson 2005).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

FLIGHT, CONTACT, NEITHER = "flight", "contact", "neither"
CURVED = (0.4, 1.8)  # of the stated gravity: what a flight's parabola may have, drag and wrong units included
FLAT = 0.15  # likewise, up to which it is a line
CLIMB = 0.12  # [m/s] of height in contact: a support that is not quite as stated
APIECE = 12.0  # cost of a piece [squared standard deviations]
STRANGE = 8.0  # more for a parabola of another kind
DROPPED = 2.0  # cost of a sample of a flight that is left to a hand
LAW_S = 0.3  # for which a cubic follows what moves by itself along a support
PER_SAMPLE = 9.0  # cost of a sample that is neither
LEAST = {FLIGHT: 5, CONTACT: 4}  # samples of a piece
LOCAL_S = 0.06  # to either side, over which a cubic follows any motion
MOST_LOCAL = 100  # places at which it is fitted
LONGEST = 400  # samples of a piece before it is joined with its neighbours
RISES = 5.0  # standard deviations by which a flight rises over its ends, at least
SLACK = 5e-4  # [m] by which a flight is no parabola and a table no plane
JUMP = 0.25  # [m/s] between two parabolas, below which they are one flight


@dataclass(frozen=True)
class MotionPhase:
    """Samples begin to end (excluded) of one kind."""

    kind: str
    begin: int
    end: int


def rough_noise(time: np.ndarray, values: np.ndarray) -> float:
    """Largest noise of signals (N, K) or (N,) at times (N,) by what local cubics leave, coloured or not.

    A tracker that filters leaves little in differences of neighbours, and all the more over some frames.
    """
    count = len(values)
    if count < 8:
        return SLACK
    reach = int(np.clip(round(LOCAL_S / float(np.median(np.diff(time)))), 3, 40))
    stride = max(1, count // MOST_LOCAL)
    left = []
    for k in range(0, count, stride):
        first = min(max(0, k - reach), max(0, count - 2 * reach - 1))
        rows = slice(first, min(count, first + 2 * reach + 1))
        t = time[rows] - time[k]
        basis = np.vander(t / max(float(np.ptp(t)), 1e-9), 4)
        rest = values[rows] - basis @ np.linalg.lstsq(basis, values[rows], rcond=None)[0]
        left.append(np.sum(rest**2, axis=0) / max(len(t) - 4, 1))
    return float(np.sqrt(np.max(np.median(left, axis=0))))


def find_phases(time: np.ndarray, height: np.ndarray, gravity: float) -> list[MotionPhase]:
    """Pieces in order of heights (N,) [m] under a gravity [m/s^2] that pulls them down, `gravity` > 0."""
    noise = float(np.hypot(rough_noise(time, height), SLACK))
    pieces = _partition(time, height / noise, gravity / noise, CLIMB / noise)
    joined = _joined(time, height, pieces, noise, gravity)
    # What rests in noise may look like short flights; with what is neither around them they are one hand's.
    risen = [
        p if p.kind != FLIGHT or _rises(time, p, gravity, noise) else replace(p, kind=NEITHER) for p in joined
    ]
    return _joined(time, height, risen, noise, gravity)


def out_of_hand(
    time: np.ndarray, height: np.ndarray, gravity: float, flight: MotionPhase, hands: tuple[bool, bool]
) -> MotionPhase:
    """A flight without what is a hand's at its beginning and its end, where `hands` says that there is one.

    Near a release hand and flight together may bend as a flight does. Poses at an end are dropped where a
    cubic through all of it, which drag and turns hardly leave, misses them by more than the middle; then the
    time for which gravity's bend g t^2 / 2, squared and summed over samples, costs less than a piece.
    """
    noise = float(np.hypot(rough_noise(time, height), SLACK))
    step = float(np.median(np.diff(time)))
    unseen = float((20.0 * APIECE * step * (noise / gravity) ** 2) ** 0.2)
    begin, end = flight.begin, flight.end
    quarter = (end - begin) // 4
    if quarter < LEAST[FLIGHT]:
        return flight
    middle = slice(begin + quarter, end - quarter)
    around = max(noise**2, _missed(time[middle], height[middle]) / max(end - begin - 2 * quarter - 4, 1))
    if hands[0]:
        cost = [_missed(time[b:end], height[b:end]) / around + DROPPED * (b - begin)
                for b in range(begin, begin + quarter)]  # fmt: skip
        begin += int(np.argmin(cost))
    if hands[1]:
        cost = [_missed(time[begin:e], height[begin:e]) / around + DROPPED * (end - e)
                for e in range(end, end - quarter, -1)]  # fmt: skip
        end -= int(np.argmin(cost))
    first, last = time[begin] + hands[0] * unseen, time[end - 1] - hands[1] * unseen
    return MotionPhase(FLIGHT, int(np.searchsorted(time, first)), int(np.searchsorted(time, last, "right")))


def under_one_law(time: np.ndarray, values: np.ndarray, noise: float, most: int, least: int) -> int:
    """Rows, `most` at most, to leave out at the beginning of a motion (N, K) until one law rules it.

    What stands, is struck and then moves by itself is told by no speed over some frames: those hold both. A
    cubic follows LAW_S of any motion by itself. It is cut where the squares that it misses, against `noise`
    or what it misses of the rest, fall by more than a piece costs and DROPPED a row. At least `least` stay.
    """
    last = min(len(time), max(int(np.searchsorted(time, time[0] + LAW_S)), most + 2 * least))
    most = min(most, last - least)
    if most < 1:
        return 0
    missed = np.array([_missed(time[b:last], values[b:last]) for b in range(most + 1)])
    # What no cubic follows is for the diagnosis to see.
    around = max(noise**2, float(missed[-1]) / max(last - most - 4, 1))
    cost = missed / around + DROPPED * np.arange(most + 1) + APIECE * (np.arange(most + 1) > 0)
    return int(np.argmin(cost))


def _missed(time: np.ndarray, values: np.ndarray) -> float:
    """Sum of squares that a cubic leaves of values (N,) or (N, K)."""
    basis = np.vander((time - time[0]) / max(float(np.ptp(time)), 1e-9), 4)
    return float(np.sum((values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]) ** 2))


def _rises(time: np.ndarray, flight: MotionPhase, gravity: float, noise: float) -> bool:
    """Whether a flight lasts long enough to rise out of the noise."""
    lasts = float(time[flight.end - 1] - time[flight.begin])
    # A float's power raises where it is too large, its product is infinite: stamps may be anything.
    return gravity * lasts * lasts / 8.0 > RISES * noise


def _partition(time: np.ndarray, y: np.ndarray, gravity: float, climb: float) -> list[MotionPhase]:
    """The cheapest sequence of pieces of y (N,) in units of its noise."""
    count = len(y)
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    came: list[tuple[int, str]] = [(0, NEITHER)] * (count + 1)
    sums = _Sums(time, y)
    for end in range(1, count + 1):
        begin = np.arange(max(0, end - LONGEST), end)
        flight, contact, any_way = sums.costs(begin, end, gravity, climb)
        size = end - begin
        flight = np.where(size >= LEAST[FLIGHT], flight, np.inf)
        contact = np.where(size >= LEAST[CONTACT], contact, np.inf)
        # A hand, a rope, a roll: one parabola of another kind is neither, and not many short flights.
        neither = np.where(size >= LEAST[FLIGHT], any_way + STRANGE, np.inf)
        for kind, cost in ((FLIGHT, flight), (CONTACT, contact), (NEITHER, neither)):
            total = best[begin] + cost + APIECE
            k = int(np.argmin(total))
            if total[k] < best[end]:
                best[end], came[end] = float(total[k]), (int(begin[k]), kind)
        last = came[end - 1][1] if end > 1 else ""
        alone = best[end - 1] + PER_SAMPLE + (0.0 if last == NEITHER else APIECE / 4.0)
        if alone < best[end]:
            best[end], came[end] = float(alone), (end - 1, NEITHER)
    out: list[MotionPhase] = []
    end = count
    while end > 0:
        begin_of, kind = came[end]
        if out and kind == NEITHER and out[-1].kind == NEITHER:
            out[-1] = MotionPhase(NEITHER, begin_of, out[-1].end)
        else:
            out.append(MotionPhase(kind, begin_of, end))
        end = begin_of
    return out[::-1]


class _Sums:
    """Moments of a signal, from which the fit of any stretch follows at once."""

    def __init__(self, time: np.ndarray, y: np.ndarray) -> None:
        # Extended precision: the moments of a short stretch are small differences of long sums.
        t, v = time.astype(np.longdouble), y.astype(np.longdouble)
        self._time = t
        self._t = [np.concatenate([[0.0], np.cumsum(t**k)]) for k in range(5)]
        self._y = [np.concatenate([[0.0], np.cumsum(v * t**k)]) for k in range(3)]
        self._yy = np.concatenate([[0.0], np.cumsum(v * v)])

    def costs(
        self, begin: np.ndarray, end: int, gravity: float, climb: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Squared errors (K,) of stretches `begin` (K,) to `end` as flight, contact, any parabola."""
        at = self._time[begin]
        m = [t[end] - t[begin] for t in self._t]
        b = [y[end] - y[begin] for y in self._y]
        t1 = m[1] - at * m[0]
        t2 = m[2] - 2 * at * m[1] + at**2 * m[0]
        t3 = m[3] - 3 * at * m[2] + 3 * at**2 * m[1] - at**3 * m[0]
        t4 = m[4] - 4 * at * m[3] + 6 * at**2 * m[2] - 4 * at**3 * m[1] + at**4 * m[0]
        y0, y1 = b[0], b[1] - at * b[0]
        y2 = b[2] - 2 * at * b[1] + at**2 * b[0]
        n = m[0]
        # About the means, then orthogonal to the line: q is half the squared time.
        s_tt, s_ty = t2 - t1**2 / n, y1 - t1 * y0 / n
        s_tq, s_qq = 0.5 * (t3 - t1 * t2 / n), 0.25 * (t4 - t2**2 / n)
        s_qy, s_yy = 0.5 * (y2 - t2 * y0 / n), self._yy[end] - self._yy[begin] - y0**2 / n
        s_tt, safe = np.maximum(s_tt, 1e-30), s_tt > 1e-30
        slope = s_ty / s_tt
        s_qq, s_qy = s_qq - s_tq**2 / s_tt, s_qy - s_tq * slope
        s_yy = s_yy - s_ty * slope
        curve = np.where(s_qq > 1e-30, s_qy / np.maximum(s_qq, 1e-30), 0.0)
        left = s_yy - curve**2 * s_qq

        def held(low: float, high: float) -> np.ndarray:
            return left + (curve - np.clip(curve, low, high)) ** 2 * s_qq

        flight = held(-CURVED[1] * gravity, -CURVED[0] * gravity)
        flat = held(-FLAT * gravity, FLAT * gravity) + (slope - np.clip(slope, -climb, climb)) ** 2 * s_tt
        return (
            np.where(safe, np.maximum(flight, 0.0), np.inf).astype(float),
            np.where(safe, np.maximum(flat, 0.0), np.inf).astype(float),
            np.where(safe, np.maximum(left, 0.0), np.inf).astype(float),
        )


def _joined(
    time: np.ndarray, height: np.ndarray, pieces: list[MotionPhase], noise: float, gravity: float
) -> list[MotionPhase]:
    """Neighbours that are one: contact with contact, and flights between which nothing jumps."""
    out: list[MotionPhase] = []
    for piece in pieces:
        if (
            out
            and out[-1].kind == piece.kind
            and (piece.kind != FLIGHT or not _jumps(time, height, out[-1], piece, noise, gravity))
        ):
            out[-1] = MotionPhase(piece.kind, out[-1].begin, piece.end)
        else:
            out.append(piece)
    return out


def _jumps(
    time: np.ndarray, height: np.ndarray, a: MotionPhase, b: MotionPhase, noise: float, gravity: float
) -> bool:
    """Whether the velocity jumps between two flights, or both together are no flight."""
    border = 0.5 * (time[a.end - 1] + time[b.begin])
    rows = slice(a.begin, b.end)
    curve = -2.0 * float(np.polyfit(time[rows] - border, height[rows], 2)[0])
    if not CURVED[0] * gravity <= curve <= CURVED[1] * gravity:
        return True
    slopes, spreads = [], []
    for phase in (a, b):
        t, y = time[phase.begin : phase.end] - border, height[phase.begin : phase.end]
        near = np.abs(t) <= 0.15
        t, y = (t[near], y[near]) if near.sum() >= 5 else (t, y)
        basis = np.stack([np.ones_like(t), t, t**2], axis=1)
        slopes.append(float(np.linalg.lstsq(basis, y, rcond=None)[0][1]))
        spreads.append(noise * float(np.sqrt(np.linalg.pinv(basis.T @ basis)[1, 1])))
    return abs(slopes[1] - slopes[0]) > JUMP + 3.0 * float(np.hypot(*spreads))
