"""From a track to the motions that a model can say something about: flights, slides, and impacts between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.diagnosis.residuals.bodies.phase_search import (
    CONTACT,
    FLIGHT,
    NEITHER,
    MotionPhase,
    find_phases,
    out_of_hand,
    rough_noise,
    under_one_law,
)
from samrl_core.diagnosis.residuals.bodies.segment import Segment, rotations, smoothed, smoothness
from samrl_core.diagnosis.residuals.bodies.stray_poses import held_poses, stray_poses

LEAST_SAMPLES = 7
LEAST_S = {"flight": 0.06, "slide": 0.12}
SLOWEST = 0.04  # [m/s] of a slide: below it friction has no direction
SURELY = 5.0  # standard deviations of the speed, likewise
LEAST_WAY_M, FAR = 0.005, 12.0  # [m], standard deviations that a slide leads at least
WINDOW_S = 0.06  # to either side, over which a speed is told
JUMP = 0.3  # [m/s] of velocity within a motion: something was hit
LEVEL = 0.02  # of gravity along the support, below which nothing speeds up by itself
SEEN = 0.98  # of the normal that must lie within measured axes
CLEAR_M = 0.006  # [m] by which the lowest point of a body in flight is off its support
FLAT_RAD = 0.04  # by which a side that slides may lean
TIPPING_S = 0.25  # [s] that no body tips for, where its lowest point is not known
RIPPLE = 1e-4  # [m] by which a slide by itself strays from a smooth path
APART_S = 0.05  # between two flights, at most, for one impact


@dataclass(frozen=True)
class Impact:
    """A rebound from the support: speeds along its normal [m/s] and their standard deviations per metre of
    noise."""

    recording: int
    time: float  # [s]
    before: float
    after: float
    before_spread: float  # [1/s]
    after_spread: float


@dataclass(frozen=True, eq=False)
class Found:
    """Motions and impacts of one recording, and what was left out."""

    segments: tuple[Segment, ...]
    impacts: tuple[Impact, ...]
    notes: tuple[str, ...]
    strays: int = 0  # poses that are none of the body

    def of(self, recording: int) -> Found:
        """The same, of the recording with that index among those of its trial."""
        return replace(
            self,
            segments=tuple(replace(s, recording=recording) for s in self.segments),
            impacts=tuple(replace(i, recording=recording) for i in self.impacts),
        )


def find_segments(recording: BodyRecording) -> Found:
    """Everything of one recording, as of a trial that holds it alone."""
    held = held_poses(recording.track)
    recording = replace(recording, track=recording.track.only(~held))
    stray = stray_poses(
        recording.track.time, recording.track.position[:, [a in recording.track.axes for a in "xyz"]]
    )
    recording = replace(recording, track=recording.track.only(~stray))
    track, time = recording.track, recording.track.time
    turned = rotations(track.quat_xyzw, len(track))
    center = track.position + turned @ np.asarray(recording.body.center)
    seen = np.array([axis in track.axes for axis in "xyz"])
    center[:, ~seen] = 0.0
    phases = _phases(recording, center, seen)
    segments: list[Segment] = []
    known = _clearance(recording, turned, seen)
    off = known if len(known) else np.zeros(len(track))
    for phase in phases:
        if phase.kind == FLIGHT:
            if not _is_free(recording, known[phase.begin : phase.end], time[phase.begin : phase.end]):
                continue
            parts = [np.arange(phase.begin, phase.end)]
        elif phase.kind == CONTACT and _may_slide(recording):
            rows = np.arange(phase.begin, phase.end)
            parts = _slides(
                recording, time, center, rows[_is_flat(recording, time[rows], turned[rows], off[rows])]
            )
        else:
            continue
        for part in parts:
            for rows in _without_jumps(time, center, part):
                made = _segment(recording, phase.kind, rows, center, turned)
                if made is not None:
                    segments.append(made)
    impacts = _impacts(recording, center, seen, phases)
    used = sum(len(s) for s in segments)
    notes = []
    if held.any():
        notes.append(
            f"{recording.name}: {held.sum()} poses are the one before, to the last digit, while the body"
            " moves on: lost frames, left out"
        )
    if not segments:
        notes.append(_why_nothing(recording, center, seen))
    elif used < len(track):
        notes.append(
            f"{recording.name}: {used} of {len(track)} poses are free flight or sliding; impacts, rest and"
            " what is neither are left out"
        )
    return Found(tuple(segments), impacts, tuple(notes), int(np.count_nonzero(stray)))


def _why_nothing(recording: BodyRecording, center: np.ndarray, seen: np.ndarray) -> str:
    """What the whole track looks like, for whoever mixed up a unit, an axis or a rate."""
    time = recording.track.time
    text = f"{recording.name}: no part of it is a flight or a slide"
    if len(time) < LEAST_SAMPLES:
        return f"{text}: it has {len(time)} poses, {LEAST_SAMPLES} are the least"
    curve = 2.0 * np.polyfit(time - time[0], center, 2)[0]
    shown = ", ".join(f"{axis} {c:.3g}" for axis, c, s in zip("xyz", curve, seen, strict=True) if s)
    return (
        f"{text}; as one parabola it accelerates by {shown} m/s^2, stated gravity is"
        f" {tuple(round(g, 3) for g in recording.gravity)}: look for the unit, the rate, the axes; or state"
        " `phase`"
    )


def _phases(recording: BodyRecording, center: np.ndarray, seen: np.ndarray) -> list[MotionPhase]:
    count = len(center)
    if recording.phase != "auto":
        return [MotionPhase(recording.phase, 0, count)]
    gravity = np.asarray(recording.gravity)
    up = _up(recording)
    if np.linalg.norm(up[seen]) < SEEN:
        return [MotionPhase(CONTACT if recording.support is not None else FLIGHT, 0, count)]
    time, height, pull = recording.track.time, center @ up, abs(float(gravity @ up))
    found = find_phases(time, height, pull)
    # What touches a piece of another kind may have been hit within the sample.
    inside = [
        MotionPhase(p.kind, p.begin + (p.begin > 0), p.end - (p.end < count))
        for p in found
        if p.end - p.begin > 2
    ]
    by_hand = [p for p in found if p.kind == NEITHER and time[p.end - 1] - time[p.begin] > APART_S]
    out = []
    for p in inside:
        hands = (
            any(0 <= p.begin - h.end <= 1 for h in by_hand),
            any(0 <= h.begin - p.end <= 1 for h in by_hand),
        )
        flies = p.kind == FLIGHT and any(hands)
        out.append(out_of_hand(time, height, pull, p, hands) if flies else p)
    return out


def _may_slide(recording: BodyRecording) -> bool:
    """Whether contact is sliding, or stated to be rolling: a ball that was not thrown to slide rolls."""
    support = recording.support
    if support is None:
        return False
    return recording.body.shape != "sphere" or support.rolls or recording.phase == "contact"


def _clearance(recording: BodyRecording, turned: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Height (N,) [m] of the body's lowest point over the lowest that it ever had; empty if not known."""
    body, up = recording.body, _up(recording)
    round_or_turned = body.shape in ("point", "sphere") or recording.track.turns == "xyz"
    if not round_or_turned or np.linalg.norm(up[seen]) < SEEN:
        return np.zeros(0)
    lowest = recording.track.position @ up - body.reach(np.swapaxes(turned, 1, 2) @ up)
    return lowest - float(np.quantile(lowest, 0.05))  # a stray pose or a soft impact may be lower


def _is_free(recording: BodyRecording, clearance: np.ndarray, time: np.ndarray) -> bool:
    """Whether a flight is one: what tips over an edge falls likewise, but never leaves the table."""
    if recording.phase != "auto" or recording.body.shape in ("point", "sphere"):
        return True
    if not len(clearance):
        return float(time[-1] - time[0]) > TIPPING_S
    return float(np.median(clearance)) > CLEAR_M + 5.0 * rough_noise(time, clearance)


def _is_flat(
    recording: BodyRecording, time: np.ndarray, turned: np.ndarray, clearance: np.ndarray
) -> np.ndarray:
    """Mask (n,) of contact in which a body keeps the side on which it ends; tumbling is no sliding."""
    if recording.track.turns != "xyz" or recording.body.shape in ("point", "sphere") or not len(turned):
        return np.ones(len(turned), dtype=bool)
    below = np.swapaxes(turned, 1, 2) @ _up(recording)
    side = np.median(below[-max(1, len(below) // 5) :], axis=0)
    leaning = np.arccos(np.clip(below @ side / max(float(np.linalg.norm(side)), 1e-9), -1.0, 1.0))
    return (leaning < FLAT_RAD + 3.0 * rough_noise(time, below)) & (clearance < 2.0 * CLEAR_M)


def _up(recording: BodyRecording) -> np.ndarray:
    if recording.support is not None:
        return np.asarray(recording.support.normal)
    gravity = np.asarray(recording.gravity)
    return -gravity / np.linalg.norm(gravity)


def _segment(
    recording: BodyRecording, kind: str, rows: np.ndarray, center: np.ndarray, turned: np.ndarray
) -> Segment | None:
    name = "flight" if kind == FLIGHT else "slide"
    time = recording.track.time[rows]
    if len(rows) < LEAST_SAMPLES or time[-1] - time[0] < LEAST_S[name]:
        return None
    _, velocity = smoothed(time, center[rows], smoothness(time))
    normal, direction, share = np.zeros(3), np.zeros_like(velocity), 1.0
    if kind == CONTACT:
        assert recording.support is not None
        normal = np.asarray(recording.support.normal)
        along = velocity - np.outer(velocity @ normal, normal)
        direction = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        share = 1.0 / (1.0 + recording.body.rolling) if recording.support.rolls else 1.0
    return Segment(
        name, 0, time, center[rows], velocity, turned[rows], normal,
        np.asarray(recording.gravity, dtype=float), direction, share,
    )  # fmt: skip


def _slides(
    recording: BodyRecording, time: np.ndarray, center: np.ndarray, rows: np.ndarray
) -> list[np.ndarray]:
    """Stretches of contact in which the body moves along the support."""
    assert recording.support is not None
    if len(rows) < LEAST_SAMPLES:
        return []
    normal = np.asarray(recording.support.normal)
    gravity = np.asarray(recording.gravity)
    along = center[rows] - np.outer(center[rows] @ normal, normal)
    noise = rough_noise(time[rows], along)
    speed, spread = _speeds(time[rows], along, noise)
    moving = speed > np.maximum(SLOWEST, SURELY * spread)
    level = np.linalg.norm(gravity - normal * (gravity @ normal)) < LEVEL * np.linalg.norm(gravity)
    out = []
    apart = np.flatnonzero(np.diff(rows) > 1) + 1  # what is not flat lies between
    for run in (r for part in np.split(np.arange(len(rows)), apart) for r in _runs_within(moving, part)):
        if level and run[0] > 0:
            # It was set in motion by something: what follows the greatest speed is its own.
            run = run[int(np.argmax(speed[run])) :]
        run = _by_itself(time[rows], along, noise, run)
        # A stray pose moves, too, but comes back.
        ends = [np.median(along[part], axis=0) for part in (run[:3], run[-3:])]
        if float(np.linalg.norm(ends[1] - ends[0])) > max(LEAST_WAY_M, FAR * noise):
            out.append(rows[run])
    return out


def _by_itself(time: np.ndarray, along: np.ndarray, noise: float, run: np.ndarray) -> np.ndarray:
    """Rows of a run without what was struck, or stopped, at an end beyond which the track goes on."""
    noise = float(np.hypot(noise, RIPPLE))
    # As far as the frames reach that tell a speed, to both sides.
    most = len(_near(time, time[run[0]], time[run[0]] + 2 * WINDOW_S, 5))
    if run[0] > 0:
        run = run[under_one_law(time[run], along[run], noise, most, LEAST_SAMPLES) :]
    if run[-1] < len(time) - 1:
        back = run[::-1]
        run = back[under_one_law(-time[back], along[back], noise, most, LEAST_SAMPLES) :][::-1]
    return run


def _speeds(time: np.ndarray, values: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Speed (n,) of positions (n, 3) by local parabolas, and its standard deviation."""
    speed, spread = np.empty(len(time)), np.empty(len(time))
    for k in range(len(time)):
        near = _near(time, time[k] - WINDOW_S, time[k] + WINDOW_S, 5)
        rate, deviation = _slope(time[near] - time[k], values[near])
        speed[k], spread[k] = np.linalg.norm(rate), noise * deviation
    return speed, spread


def _near(time: np.ndarray, low: float, high: float, least: int) -> np.ndarray:
    first, last = np.searchsorted(time, (low, high))
    while last - first < min(least, len(time)):
        first, last = max(0, first - 1), min(len(time), last + 1)
    return np.arange(first, last)


def _slope(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float]:
    """Slope (k,) at t = 0 of parabolas through values (n, k), and its deviation per deviation of a value."""
    basis = np.stack([np.ones_like(t), t, t**2], axis=1)
    inverse = np.linalg.pinv(basis)
    return inverse[1] @ values, float(np.linalg.norm(inverse[1]))


def _without_jumps(time: np.ndarray, center: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
    """Rows cut where the velocity jumps: a wall, an edge, a hand."""
    count = len(rows)
    if count < 2 * LEAST_SAMPLES:
        return [rows]
    t, values = time[rows], center[rows]
    noise = rough_noise(t, values)
    score = np.zeros(count)
    for k in range(5, count - 4):
        left = _near(t, t[k - 1] - 2 * WINDOW_S, t[k - 1] + 1e-9, 5)
        right = _near(t, t[k] - 1e-9, t[k] + 2 * WINDOW_S, 5)
        left, right = left[left < k], right[right >= k]
        middle = 0.5 * (t[k - 1] + t[k])
        a, da = _slope(t[left] - middle, values[left])
        b, db = _slope(t[right] - middle, values[right])
        jump = float(np.linalg.norm(b - a))
        score[k] = jump / (JUMP + 9.0 * noise * float(np.hypot(da, db)))
    out, begin = [], 0
    while score.max() > 1.0:
        k = int(np.argmax(score))
        out.append(k)
        reach = max(2, int(np.searchsorted(t, t[k] + 2 * WINDOW_S) - k))
        score[max(0, k - reach) : k + reach] = 0.0
    parts = []
    for k in [*sorted(out), count]:
        parts.append(rows[begin : k - (k < count)])
        begin = k + 1
    return parts


def _runs_within(mask: np.ndarray, part: np.ndarray) -> list[np.ndarray]:
    return [part[run] for run in _runs(mask[part])] if len(part) else []


def _runs(mask: np.ndarray) -> list[np.ndarray]:
    index = np.flatnonzero(mask)
    return [r for r in np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(r)]


def _impacts(
    recording: BodyRecording, center: np.ndarray, seen: np.ndarray, phases: list[MotionPhase]
) -> tuple[Impact, ...]:
    """Rebounds of what is round or a point: of a box it depends on which corner hits."""
    support = recording.support
    if support is None or recording.body.shape not in ("point", "sphere") or recording.phase != "auto":
        return ()
    normal, time = np.asarray(support.normal), recording.track.time
    if np.linalg.norm(normal[seen]) < SEEN:
        return ()
    height, out = center @ normal, []
    flights = [p for p in phases if p.kind == FLIGHT and p.end - p.begin >= 5]
    for a, b in zip(flights[:-1], flights[1:], strict=True):
        if time[b.begin] - time[a.end - 1] > APART_S + 3.0 * float(np.median(np.diff(time))):
            continue
        middle = 0.5 * (time[a.end - 1] + time[b.begin])
        fits = []
        for phase in (a, b):
            t = time[phase.begin : phase.end] - middle
            near = np.abs(t) < 0.25
            basis = np.stack([np.ones_like(t), t, t**2], axis=1)[near]
            fits.append((np.linalg.pinv(basis), height[phase.begin : phase.end][near]))
        (p0, v0, c0), (p1, v1, c1) = (inverse @ y for inverse, y in fits)
        roots = np.roots([c1 - c0, v1 - v0, p1 - p0]) if abs(v1 - v0) > 1e-9 else np.zeros(0)
        real = [float(r.real) for r in roots if abs(r.imag) < 1e-9]
        hit = min(real, key=abs, default=0.0)
        if abs(hit) > APART_S:
            hit = 0.0
        rates = [inverse[1] + 2.0 * hit * inverse[2] for inverse, _ in fits]
        before, after = (float(rate @ y) for rate, (_, y) in zip(rates, fits, strict=True))
        if before < -0.1 and after > 0.05:
            spreads = [float(np.linalg.norm(rate)) for rate in rates]
            out.append(Impact(0, middle + hit, before, after, *spreads))
    return tuple(out)
