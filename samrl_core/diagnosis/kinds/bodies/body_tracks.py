"""Tracks of free bodies: tossed, dropped, sliding, bouncing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import BODY_EFFECTS
from samrl_core.diagnosis.kinds.bodies.body_suspects import suspicions
from samrl_core.diagnosis.kinds.bodies.next_bodies import next_bodies
from samrl_core.diagnosis.kinds.kind import Kind
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial, body_trials, channels_of
from samrl_core.diagnosis.residuals.bodies.constants import solved
from samrl_core.diagnosis.residuals.bodies.find_segments import Found, find_segments
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit

MOST_TRIALS = 10  # of each role; more recordings of one setting are taken together
LEAST_POSES = 24  # of a recording that is cut
SEVERAL = 3  # recordings from which on whole ones are held out


class BodyTracks(Kind[BodyRecording]):
    """Poses of one body over time, against free flight, sliding and rebounds."""

    effects = BODY_EFFECTS
    elsewhere: ClassVar[dict[str, str]] = {
        "payload": "a free body carries none",
        "depth_noise": "noise is estimated from the track; nothing is stated that it could contradict",
    }
    shown_by = "tracks of free bodies"
    nothing = "no part of the recordings is a flight, or a slide on the stated support"
    half_names = ("every other pose", "the poses between")

    def alike(self, recordings: Sequence[BodyRecording]) -> tuple[list[BodyRecording], list[str]]:
        first = recordings[0]
        for other in recordings[1:]:
            for key, mine, theirs in zip(KEYS, _system_of(first), _system_of(other), strict=True):
                if mine != theirs:
                    raise InputError(
                        f"{key} of {other.name} is {theirs}, of {first.name} {mine}; diagnose one body, track"
                        " and pair of surfaces at a time"
                    )
        return list(recordings), []

    def trials(
        self, fit: Sequence[BodyRecording], held_out: Sequence[BodyRecording]
    ) -> tuple[list[Observed], list[Observed]]:
        motions = {id(r): find_segments(r) for r in (*fit, *held_out)}
        fit, still = _that_move(fit, motions)
        groups = [_bundles(fit), _bundles(_that_move(held_out, motions)[0])]
        found = [[[motions[id(r)].of(k) for k, r in enumerate(b)] for b in group] for group in groups]
        known = [f for bundle in found[0] for f in bundle]
        constants, _ = solved(list(fit), known)
        channels = channels_of(list(fit), known)
        every = body_trials(
            [*groups[0], *groups[1]], [*found[0], *found[1]], constants, channels, len(groups[0])
        )
        made = [every[: len(groups[0])], every[len(groups[0]) :]]
        for trial, there in zip(made[0], found[0], strict=True):
            trial.notes = [note for f in there for note in f.notes]
        if made[0]:
            made[0][0].notes = [*still, *made[0][0].notes]
        return list(made[0]), list(made[1])

    def notes(self, trials: Sequence[Observed]) -> list[str]:
        """What was left out, what was solved for, and poses that are none of the body."""
        made = [t for t in trials if isinstance(t, BodyTrial)]
        out = [note for t in made for note in t.notes][:MOST_TRIALS]
        recordings = [r for t in made for r in t.recordings]
        found = [Found(t.segments, t.impacts, ()) for t in made]
        out += solved(recordings, found)[1]
        for trial in made:
            if trial.outliers:
                total = sum(len(r.track) for r in trial.recordings)
                out.append(
                    f"{trial.name}: {trial.outliers} of {total} poses stand apart from all others and hardly"
                    " count"
                )
        return out

    def system(self, trial: Observed) -> str:
        assert isinstance(trial, BodyTrial)
        return trial.recording.body.name

    def cut(self, recording: BodyRecording) -> tuple[BodyRecording, BodyRecording]:
        return split_body(recording, 2)

    def next_experiment(
        self, likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
    ) -> tuple[NextExperiment | None, str]:
        return next_bodies(likelihood, fits, names, seed)

    def doubts(self, evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
        return suspicions(evidence, chosen, least)


def _that_move(
    recordings: Sequence[BodyRecording], motions: Mapping[int, Found]
) -> tuple[list[BodyRecording], list[str]]:
    """Recordings that hold a motion, all if none does, and what is noted of the others."""
    still = [r for r in recordings if not (motions[id(r)].segments or motions[id(r)].impacts)]
    if len(still) == len(recordings):
        return list(recordings), []
    kept = [r for r in recordings if all(r is not s for s in still)]
    return kept, [note for r in still for note in motions[id(r)].notes]


KEYS = ("body", "measured axes", "measured turns", "friction", "restitution", "rolling", "camera", "phase")


def _system_of(recording: BodyRecording) -> tuple[object, ...]:
    support = recording.support
    of_support = (None, None, None)
    if support is not None:
        of_support = (support.friction, support.restitution, support.rolls)
    track = recording.track
    return (
        recording.body, "".join(sorted(track.axes)), track.turns, *of_support, recording.camera,
        recording.phase,
    )  # fmt: skip


def _bundles(recordings: Sequence[BodyRecording]) -> list[list[BodyRecording]]:
    """Recordings that make one trial each; many short ones of one setting are taken together."""
    count = len(recordings)
    settings = {(r.gravity, r.support) for r in recordings}
    if count <= MOST_TRIALS or len(settings) > 1:
        return [[r] for r in recordings]
    borders = np.linspace(0, count, MOST_TRIALS + 1).round().astype(int)
    return [list(recordings[a:b]) for a, b in zip(borders[:-1], borders[1:], strict=True)]


def split_bodies(
    recordings: Sequence[BodyRecording],
) -> tuple[list[BodyRecording], list[BodyRecording], str]:
    """What is fitted and what is held out where nobody said so, and how that was chosen.

    Raises:
        InputError: too few poses.
    """
    if len(recordings) >= SEVERAL:
        held = list(recordings[1::SEVERAL])
        fit = [r for r in recordings if r not in held]
        return fit, held, f"no recording is held out by the mapping: {len(held)} of {len(recordings)} are"
    pairs = [split_body(r, 3) for r in recordings]
    note = "every third pose is held out: so few recordings hold out noise, not another motion"
    return [p[0] for p in pairs], [p[1] for p in pairs], note


def split_body(recording: BodyRecording, every: int) -> tuple[BodyRecording, BodyRecording]:
    """All poses but each `every`-th, and those: either sees the whole motion.

    Raises:
        InputError: too few poses.
    """
    count = len(recording.track)
    if count < LEAST_POSES:
        raise InputError(
            f"{recording.name} has {count} poses; {LEAST_POSES} are the least to hold any out; record more"
            " motions, or mark whole recordings with `role: held_out`"
        )
    held = np.arange(count) % every == every - 1
    track = recording.track
    return replace(recording, track=track.only(~held)), replace(recording, track=track.only(held))
