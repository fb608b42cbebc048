"""The motions of a trial against the nominal model, and the noise of the tracker that they leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.diagnosis.residuals.bodies.constants import BodyConstants
from samrl_core.diagnosis.residuals.bodies.find_segments import Found, Impact
from samrl_core.diagnosis.residuals.bodies.fit_inertia import with_secant
from samrl_core.diagnosis.residuals.bodies.free_rotation import FreeRotation, free_rotation
from samrl_core.diagnosis.residuals.bodies.segment import Segment, smoothed, smoothness

APART = 6.0  # standard deviations beyond which a pose is none of the body
ALIKE = (0.6, 1.6)  # noise of one trial over that of all, within which it is the same
MOST_AS_ONE = 4.0  # neighbours that coloured noise counts as one
MOST_TAKEN = 0.6  # share of noise that a curve takes at most
ENOUGH = 60  # poses that tell their own noise
LEAST = 1e-6  # [m], [rad]: rounding of a log
TRIMMED, OF_TRIMMED = 3.0, 0.9866  # deviations that count, and what is left of a Gaussian's


@dataclass(frozen=True, eq=False)
class Motions:
    """Everything of a trial before noise is known.

    Attributes:
        paths: (n, 3) [m] positions over the nominal ones, of each segment; the start is still in them.
        flying: indices of segments whose turns are compared with a free rotation.
        path_rests, turn_rests: (n, 3) what no smooth curve follows.
    """

    segments: tuple[Segment, ...]
    impacts: tuple[Impact, ...]
    paths: tuple[np.ndarray, ...]
    flying: tuple[int, ...]
    rotations: tuple[FreeRotation, ...]
    path_rests: tuple[np.ndarray, ...]
    turn_rests: tuple[np.ndarray, ...]
    strays: int  # poses that were left out


def motions_of(
    recordings: Sequence[BodyRecording],
    found: Sequence[Found],
    constants: BodyConstants,
    turns: bool,
    errors: np.ndarray,
) -> Motions:
    """Of one trial; `turns`: flights are compared with free rotations, with columns exact at `errors` (2,) of
    inertia."""
    segments = tuple(s for f in found for s in f.segments)
    paths = tuple(s.position - s.travelled(s.nominal(constants.friction)) for s in segments)
    flying = tuple(k for k, s in enumerate(segments) if turns and not s.slides)
    gyration = recordings[0].body.gyration
    rotations = tuple(
        with_secant(free_rotation(s.time, s.turned, gyration), s, gyration, errors)
        for s in (segments[k] for k in flying)
    )
    return Motions(
        segments, tuple(i for f in found for i in f.impacts), paths, flying, rotations,
        _rests([s.time for s in segments], paths),
        _rests([segments[k].time for k in flying], [r.residual for r in rotations]),
        sum(f.strays for f in found),
    )  # fmt: skip


def _rests(times: Sequence[np.ndarray], values: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """What smooth curves leave of signals (n, 3), scaled to its freedom.

    A curve takes more of coloured noise than of white: as much more as samples count as one.
    """
    raw, freedoms = [], []
    for time, signal in zip(times, values, strict=True):
        order = min(smoothness(time) + 1, len(time) - 3)
        raw.append(signal - smoothed(time, signal, order)[0])
        freedoms.append(order + 1)
    if not raw:
        return ()
    clipped = [np.clip(r, -2.5 * m, 2.5 * m) for r, m in ((r, _level(r)) for r in raw)]
    next_to = sum(np.sum(r[1:] * r[:-1], axis=0) for r in clipped)
    rho = np.clip(next_to / np.maximum(sum(np.sum(r[:-1] ** 2, axis=0) for r in clipped), 1e-30), 0.0, 0.8)
    as_one = np.minimum((1.0 + rho) / (1.0 - rho), MOST_AS_ONE)
    out = []
    for rest, freedom in zip(raw, freedoms, strict=True):
        count = len(rest)
        taken = np.minimum(as_one * freedom, max(freedom, MOST_TAKEN * count))
        out.append(rest * np.sqrt(count / (count - taken)))
    return tuple(out)


def noise_levels(trials: Sequence[Sequence[np.ndarray]], fitted: int) -> list[np.ndarray]:
    """Standard deviation (3,) of each trial's rests: that of all fitted ones, unless its own clearly differs.

    Short motions tell their noise badly, and a tracker is the same in all of them. The first `fitted` trials
    are fitted: what is held out says nothing about their noise.
    """
    every = [rest for rests in trials[:fitted] for rest in rests]
    every = every or [rest for rests in trials for rest in rests]  # turns that only held-out flights have
    if not every:
        return [np.full(3, LEAST) for _ in trials]
    common = _level(np.concatenate(every))
    out = []
    for rests in trials:
        enough = sum(len(rest) for rest in rests) >= ENOUGH
        own = _level(np.concatenate(rests)) if enough else common
        same = (own / common > ALIKE[0]) & (own / common < ALIKE[1])
        out.append(np.where(same, common, own))
    return out


def _level(values: np.ndarray) -> np.ndarray:
    """Standard deviation (3,) of what lies within three of them."""
    middle = np.abs(values - np.median(values, axis=0))
    rough = np.maximum(1.4826 * np.median(middle, axis=0), LEAST)
    inside = middle < TRIMMED * rough
    power = np.sum(np.where(inside, values, 0.0) ** 2, axis=0) / np.maximum(np.sum(inside, axis=0), 1)
    return np.maximum(np.sqrt(power) / OF_TRIMMED, LEAST)


def sigmas(rests: Sequence[np.ndarray], level: np.ndarray) -> tuple[list[np.ndarray], int]:
    """Standard deviations (n, 3) of each motion, and how many poses stand apart; these hardly count."""
    out, outliers = [], 0
    for rest in rests:
        score = np.max(np.abs(rest) / level, axis=1)
        apart = score > APART
        sigma = np.tile(level, (len(rest), 1))
        sigma[apart] *= score[apart, None] ** 2
        outliers += int(np.count_nonzero(apart))
        out.append(sigma)
    return out, outliers
