"""Recordings of poses: a target seen by a camera, either of them moved by arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import ClassVar

import numpy as np

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import POSE_EFFECTS
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.kinds.kind import Kind
from samrl_core.diagnosis.kinds.poses.next_views import next_views
from samrl_core.diagnosis.kinds.poses.pose_corrections import recalibration
from samrl_core.diagnosis.recordings.held_out import GAP_S, SHARE
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.poses.even_stamps import with_even_stamps
from samrl_core.diagnosis.residuals.poses.image_pattern import find_image_pattern
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from samrl_core.diagnosis.residuals.poses.seen_size import find_opening
from samrl_core.diagnosis.residuals.poses.slip import find_slip
from samrl_core.diagnosis.residuals.poses.solve import agreeing_views, check_stated, solved
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Doubts

LEAST_TO_SPLIT = 16  # poses of which some are held out
MOST_NAMED = 12  # moments that a note lists
LEAST_AT_REST = 24  # likewise where every fourth is: of fewer, too few would be left to compare


class Poses(Kind[PoseRecording]):
    """Poses of a target in a camera against the chain of stated transforms and moving flanges."""

    effects = POSE_EFFECTS
    elsewhere: ClassVar[dict[str, str]] = {
        "intrinsics": "a detected pose does not tell its pixels; needs images or depth",
        "lens_distortion": "a detected pose does not tell its pixels; needs images",
    }
    shown_by = "recorded poses"
    nothing = "no pose of the recordings can be compared with the stated chain"

    def alike(self, recordings: Sequence[PoseRecording]) -> tuple[list[PoseRecording], list[str]]:
        first = recordings[0]
        for other in recordings[1:]:
            if _chain_of(other) != _chain_of(first):
                raise InputError(
                    f"{other.name} is of {_chain_of(other)}, {first.name} of {_chain_of(first)}; diagnose one"
                    " camera, target and pair of arms at a time"
                )
        even = [with_even_stamps(r) for r in recordings]
        return [r for r, _ in even], [note for _, note in even if note]

    def trials(
        self, fit: Sequence[PoseRecording], held_out: Sequence[PoseRecording]
    ) -> tuple[list[Observed], list[Observed]]:
        constants, _ = solved(fit)
        made = [PoseTrial(r, constants) for r in fit]
        most = max(made, key=lambda trial: len(trial.recording.seen))
        few = [len(r.seen) < min(LEAST_TO_SPLIT, len(most.recording.seen)) for r in held_out]
        made += [
            PoseTrial(r, constants, like=most.noise, few=short)
            for r, short in zip(held_out, few, strict=True)
        ]
        if not constants.free:
            check_stated(fit[0], made[0].at_target(made[0].twist), made[0].seen_position)
        return list(made[: len(fit)]), list(made[len(fit) :])

    def notes(self, trials: Sequence[Observed]) -> list[str]:
        """What was solved for, and detections that are no poses of the target."""
        made = [t for t in trials if isinstance(t, PoseTrial)]
        out = solved([t.recording for t in made])[1] if made else []
        for trial in made:
            turned = trial.chain.time[~agreeing_views(trial.chain)]
            if len(turned) and trial.constants.free:  # else nothing was solved for without them
                named = ", ".join(f"{stamp:g}" for stamp in turned[:MOST_NAMED])
                out.append(
                    f"{trial.name}: {len(turned)} of {len(trial.chain.time)} poses turn otherwise"
                    f" than the arm (at {named} s, or rows from 0 on), and what nobody stated is solved for"
                    " without them: a board seen from another corner, a tag that flips, a target that was"
                    " moved?"
                )
            if trial.moved is not None:
                begin, end = trial.moved
                out.append(
                    f"{trial.name}: the {end - begin} seen poses from {trial.chain.time[begin]:g} to"
                    f" {trial.chain.time[end - 1]:g} s (or rows) stand elsewhere than"
                    " all others: the target was pushed, or the camera slipped. They hardly"
                    " count here; diagnose them by themselves, as `rows` in a mapping cuts them"
                )
            elif trial.outliers:
                out.append(
                    f"{trial.name}: {trial.outliers} of {len(trial.chain.time)} seen poses stand apart from"
                    " all others and hardly count"
                )
        return out

    def system(self, trial: Observed) -> str:
        assert isinstance(trial, PoseTrial)
        return trial.recording.camera

    def cut(self, recording: PoseRecording) -> tuple[PoseRecording, PoseRecording]:
        return split_poses(recording, 0.5, 0.0)

    def doubts(self, evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
        if chosen is not None:
            return []
        made = [t for t in evidence.likelihood.trials if isinstance(t, PoseTrial)]
        return [opening for trial in made if (opening := find_opening(trial.recording))]

    def doubts_of(self, fitted: Likelihood, held_out: Likelihood) -> Doubts:
        """Those of the fitted recordings, and what lasts in all: a slip where they were cut is in no part."""
        made = [t for t in (*fitted.trials, *held_out.trials) if isinstance(t, PoseTrial)]
        whole = cache(lambda: _uncut(made))
        slips = cache(lambda: [slip for trial in whole() if (slip := find_slip(trial))])
        bent = cache(lambda: [bend for trial in whole() if (bend := find_image_pattern(trial))])

        def doubts(evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
            # Another transform from one view on leaves no effect's size what it is; a place in the image
            # follows from many a motion, so that what an effect explains is not asked for it.
            return self.doubts(evidence, chosen, least) or slips() or ([] if chosen is not None else bent())

        return doubts

    def next_experiment(
        self, likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
    ) -> tuple[NextExperiment | None, str]:
        return next_views(likelihood, fits, names, seed)

    def correction(
        self, evidence: Evidence, chosen: Fit, far: HowFar, sure: bool, rng: np.random.Generator
    ) -> Recalibration | None:
        if not sure:
            return None
        return recalibration(chosen, [t for t in evidence.likelihood.trials if isinstance(t, PoseTrial)])


def _uncut(trials: Sequence[PoseTrial]) -> list[PoseTrial]:
    """Trials of whole recordings, of which the given ones are parts."""
    files: dict[tuple[str, str], list[PoseTrial]] = {}
    for trial in trials:
        files.setdefault((trial.recording.source, trial.recording.sha256), []).append(trial)
    return [trial for parts in files.values() for trial in _joined(parts)]


def _joined(parts: Sequence[PoseTrial]) -> Sequence[PoseTrial]:
    """The parts of one recording as one, at the constants of the first; as they are where moments repeat."""
    tracks = [trial.recording.seen for trial in parts]
    time = np.concatenate([t.time for t in tracks])
    order = np.argsort(time)
    if len(parts) == 1 or np.any(np.diff(time[order]) <= 0):
        return parts
    rows = (np.concatenate([getattr(t, n) for t in tracks])[order] for n in ("position", "quat_xyzw"))
    seen = type(tracks[0])(time[order], *rows)
    return [PoseTrial(replace(parts[0].recording, seen=seen), parts[0].constants)]


def _chain_of(recording: PoseRecording) -> tuple[object, ...]:
    return (
        recording.camera,
        recording.target,
        tuple((arm.role, arm.joints) for arm in recording.arms),
        recording.camera_arm is None,
        tuple(
            p is None
            for p in (recording.camera_in_flange, recording.base_in_base, recording.target_in_flange)
        ),
    )


def split_poses(
    recording: PoseRecording, held_out_share: float = SHARE, gap_s: float = GAP_S
) -> tuple[PoseRecording, PoseRecording]:
    """First part to fit, last part to hold out; pairs at rest alternate, three to fit and one to hold out.

    Raises:
        InputError: too few poses to hold any out.
    """
    seen = recording.seen
    if len(seen) < LEAST_TO_SPLIT:
        raise InputError(
            f"{recording.name} has {len(seen)} seen poses; at least {LEAST_TO_SPLIT} are needed to hold any"
            " out"
        )
    if not recording.timed:
        kept = [k for k in range(len(seen)) if k % 4 != 3]
        rest = [k for k in range(len(seen)) if k % 4 == 3]
        if held_out_share >= 0.5:
            kept, rest = list(range(0, len(seen), 2)), list(range(1, len(seen), 2))
        parts = [type(seen)(seen.time[k], seen.position[k], seen.quat_xyzw[k]) for k in (kept, rest)]
        return replace(recording, seen=parts[0]), replace(recording, seen=parts[1])
    begin, end = float(seen.time[0]), float(seen.time[-1])
    border = end - held_out_share * (end - begin)
    gap_s = min(gap_s, 0.1 * (border - begin))
    return (
        replace(recording, seen=seen.between(begin, border - gap_s)),
        replace(recording, seen=seen.between(border, float("inf"))),
    )
