"""The motion of a body that would split an ambiguity set, or the sentence that none does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyRecording, BodyTrack
from samrl_core.diagnosis.findings.discrimination import FILE, discrimination, find_rivals, separation
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial, body_trials, channels_of
from samrl_core.diagnosis.residuals.bodies.find_segments import find_segments
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.twins import AS_MUCH

WAYS = 4  # directions of slides and tosses
TOSS_SPEED, RISE_SPEED, SPIN = 1.5, 2.5, 6.0  # [m/s], [m/s], [rad/s]
SLIDE_SPEEDS = {"slides": 1.0, "quick slides": 3.0}  # [m/s] up a slope the slow ones are over too soon
FLIGHT_S = 0.5
SURE = 0.99  # to split: the first motion of the list that is, is proposed
MOTIONS = {  # gentle ones first
    "slides": "slides to rest at 1 m/s from the start, in four directions of the support",
    "quick slides": "slides to rest at 3 m/s from the start, in four directions of the support",
    "tosses": "tosses of half a second in four directions, turning about two axes",
}
SCALES = frozenset({"clock_offset", "object_geometry"})
OUTSIDE = "a clock that is filmed, or a length of known size beside the path, must"
OTHERWISE = "measure one of them by another instrument, such as a level"


def next_bodies(
    likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
) -> tuple[NextExperiment | None, str]:
    """The motion in which the closest pair differs most; where none splits them, why."""
    trial = likelihood.trials[0]
    assert isinstance(trial, BodyTrial)
    rivals = find_rivals(fits, names)
    pair = " and ".join(names)
    scored = []
    for kind, recordings in _candidates(trial, seed).items():
        found = [find_segments(r).of(k) for k, r in enumerate(recordings)]
        channels = channels_of(recordings, found)
        if channels:
            (made,) = body_trials([recordings], [found], trial.constants, channels, 1)
            scored.append((discrimination(made, rivals), kind))
    best, kind = max(scored, default=(0.0, ""))
    if best < AS_MUCH:
        tried = "; ".join(MOTIONS[k] for _, k in scored)
        scales = {name.partition("@")[0] for name in names} <= SCALES
        remedy = OUTSIDE if scales else OTHERWISE
        return None, f"no recording of this tracker splits {pair} (tried: {tried}); {remedy}"
    enough = {name for score, name in scored if separation(score) > SURE}
    if gentle := [name for name in MOTIONS if name in enough]:
        best, kind = next(each for each in scored if each[1] == gentle[0])
    why = f"{pair} would differ by {best:.0f} of log evidence in {MOTIONS[kind]}"
    content = {"schema": 1, "kind": "bodies", "motion": kind, "record": MOTIONS[kind], "why": why}
    return NextExperiment(FILE, why, separation(best), content), ""


def _candidates(trial: BodyTrial, seed: int) -> dict[str, list[BodyRecording]]:
    """Nominal motions with the tracker's noise and rate."""
    recording, rng = trial.recording, np.random.default_rng(seed)
    step = float(np.median(np.diff(recording.track.time)))
    gravity = np.asarray(recording.gravity)
    out: dict[str, list[BodyRecording]] = {"tosses": []}
    up = -gravity / np.linalg.norm(gravity)
    for way in _ways(up):
        time = np.arange(0.0, FLIGHT_S, step)
        start = TOSS_SPEED * way + RISE_SPEED * up
        path = time[:, None] * start + 0.5 * time[:, None] ** 2 * gravity
        turned = Rotation.from_rotvec(time[:, None] * SPIN * (way + 0.5 * np.cross(up, way)))
        out["tosses"].append(_recorded(recording, time, path, turned, trial.level, rng, "flight"))
    support = recording.support
    friction = trial.constants.friction
    if support is not None and friction > 0.0:
        normal = np.asarray(support.normal)
        pull = gravity - normal * (gravity @ normal)
        for kind, speed in SLIDE_SPEEDS.items():
            out[kind] = []
            for way in _ways(normal):
                path, time = _slide(speed * way, pull, friction * -float(normal @ gravity), step)
                turned = Rotation.from_rotvec(np.zeros((len(time), 3)))
                out[kind].append(_recorded(recording, time, path, turned, trial.level, rng, "contact"))
    return out


def _slide(start: np.ndarray, pull: np.ndarray, brake: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) of a slide until it rests, two seconds at most, and times (n,)."""
    position, velocity, path = np.zeros(3), start, []
    while len(path) * step < 2.0:
        path.append(position.copy())
        speed = float(np.linalg.norm(velocity))
        if speed < brake * step:
            break
        change = pull - brake * velocity / speed
        position = position + step * velocity + 0.5 * step**2 * change
        velocity = velocity + step * change
    return np.array(path), step * np.arange(len(path))


def _ways(up: np.ndarray) -> list[np.ndarray]:
    along = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = along - up * (along @ up)
    first = first / np.linalg.norm(first)
    second = np.cross(up, first)
    angles = 2.0 * np.pi * np.arange(WAYS) / WAYS
    return [np.cos(a) * first + np.sin(a) * second for a in angles]


def _recorded(
    like: BodyRecording, time: np.ndarray, path: np.ndarray, turned: Rotation, noise: np.ndarray,
    rng: np.random.Generator, phase: str,
) -> BodyRecording:  # fmt: skip
    seen = np.array([axis in like.track.axes for axis in "xyz"])
    noisy = (path + noise * rng.standard_normal(path.shape)) * seen
    quats = turned.as_quat() if like.track.turns else like.track.quat_xyzw[:0]
    track = BodyTrack(time, noisy, like.track.axes, quats, like.track.turns)
    return replace(like, name="next", track=track, phase=phase)
