"""From recordings of one arm to a diagnosis: where, which, how far, or why not."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import EFFECTS, NOT_BY_JOINTS, Effect
from samrl_core.diagnosis.recordings import split
from samrl_core.diagnosis.recordings.in_common import in_common
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import Curve, Diagnosis, InputFile, NamedEffect
from samrl_core.diagnosis.selection import verdict as rules
from samrl_core.diagnosis.selection.confidence import (
    estimates,
    invariance_alarms,
    probabilities,
    undone_alarms,
)
from samrl_core.diagnosis.selection.curves import curve_of
from samrl_core.diagnosis.selection.how_far import HowFar, how_far
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit, on_bound
from samrl_core.diagnosis.selection.joint_units import with_joint_units
from samrl_core.diagnosis.selection.next_experiment import next_experiment
from samrl_core.diagnosis.selection.posterior import correction_of
from samrl_core.diagnosis.selection.selection import Selection, SelectionSettings, select
from samrl_core.diagnosis.selection.signature import couplings, signatures
from samrl_core.diagnosis.selection.tracking import track
from samrl_core.diagnosis.selection.where import heatmap, onset, timelines
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

Progress = Callable[[str], None]
RUNNER_UPS = 5


@dataclass(frozen=True)
class DiagnosisSettings:
    """What may be used, and how strict to be."""

    library: Collection[str] | None = None  # families that may be named; None: all
    seed: int = 0
    selection: SelectionSettings = field(default_factory=SelectionSettings)
    verdict: rules.VerdictSettings = field(default_factory=rules.VerdictSettings)
    simulate: bool = True  # held-out recordings in closed loop
    track: tuple[str, ...] = ()  # `family@place` whose size is told, named or not
    share_held_out: bool = True  # fit the first half of what is held out, where only that shows a gap


def library(families: Collection[str] | None) -> tuple[Effect, ...]:
    """Effects of the given families.

    Raises:
        InputError: a family that is unknown, or none at all.
    """
    if families is None:
        return EFFECTS
    known = {e.family for e in EFFECTS}
    if unknown := sorted(set(families) - known - set(NOT_BY_JOINTS)):
        raise InputError(f"unknown families {unknown} in the library; known are {sorted(known)}")
    chosen = tuple(e for e in EFFECTS if e.family in families)
    if not chosen:
        raise InputError("the library allows no effect that joint channels can show; name at least one")
    return chosen


def diagnose(
    fit: Sequence[ArmRecording],
    held_out: Sequence[ArmRecording],
    settings: DiagnosisSettings | None = None,
    notes: Sequence[str] = (),
    progress: Progress = lambda _: None,
) -> tuple[Diagnosis, HowFar]:
    """Diagnose recordings of one arm.

    Args:
        fit: recordings that are fitted.
        held_out: recordings that are only ever compared with; may be empty, then nothing is said of shrink.
        settings: library, seed, thresholds.
        notes: remarks about the input that the report should carry.
        progress: called with each stage's name.

    Raises:
        InputError: nothing to fit, different arms, or an empty library.
    """
    settings = settings or DiagnosisSettings()
    if not fit:
        raise InputError("no recording to fit; give at least one that is not held out")
    _check_same_arm([*fit, *held_out])
    alike, dropped = in_common([*fit, *held_out])
    fit, held_out, notes = alike[: len(fit)], alike[len(fit) :], [*notes, *dropped]
    effects = library(settings.library)
    clock, timings = time.monotonic(), {}

    def done(stage: str) -> None:
        nonlocal clock
        now = time.monotonic()
        timings[stage], clock = now - clock, now

    progress("residuals")
    trials, held_trials = _trials(fit, held_out)
    first = trials[0]
    untestable = {e.family: reason for e in effects if (reason := e.why_unobservable(first))}
    untestable |= NOT_BY_JOINTS
    inputs = tuple(
        InputFile(r.source, r.sha256, role, r.duration)
        for role, group in (("fit", fit), ("held_out", held_out))
        for r in group
    )
    empty = Diagnosis(
        "not_testable", ("no channel of the recordings can be compared with a model",), (), (), (), (), None,
        None, 0.0, untestable, inputs, settings.seed, _version(), first.recording.arm.role,
        notes=tuple(notes),
    )  # fmt: skip
    if not first.channels:
        return empty, HowFar(None, ())
    likelihood, held = Likelihood(trials), Likelihood(held_trials)
    done("residuals")
    selection = select(likelihood, held, effects, settings.selection, progress)
    done("which")
    if settings.share_held_out and rules.only_held_out(selection, settings.verdict):
        halves = [_halves(r) for r in held_out]
        remark = (
            "only the held-out recordings show a gap: their first halves were fitted too,"
            " their second halves stay held out"
        )
        return diagnose(
            [*fit, *(first for first, _ in halves)], [last for _, last in halves],
            replace(settings, share_held_out=False), [*notes, remark], progress,
        )  # fmt: skip
    return _conclude(empty, selection, likelihood, held, effects, settings, timings, progress, done)


def _conclude(
    empty: Diagnosis,
    selection: Selection,
    likelihood: Likelihood,
    held: Likelihood,
    effects: Sequence[Effect],
    settings: DiagnosisSettings,
    timings: dict[str, float],
    progress: Progress,
    done: Callable[[str], None],
) -> tuple[Diagnosis, HowFar]:
    """Everything that follows from the selection."""
    rng = np.random.default_rng(settings.seed)
    evidence = Evidence(likelihood, selection.correlation_time)
    k = selection.correlation_time
    z = likelihood.whitened()
    chosen = selection.chosen
    does = None if chosen is None else likelihood.y - evidence.remainder(chosen)
    grid, items = heatmap(likelihood, z, k, does)
    named: tuple[NamedEffect, ...] = ()
    runner_ups: tuple[NamedEffect, ...] = ()
    alarms: list[str] = []
    onsets: list[float | None] = [None] * len(likelihood.trials)
    rivals = selection.rivals if chosen is not None else ()
    if chosen is not None:
        progress("how sure")
        p = probabilities([chosen, *rivals], selection.remaining)
        named = tuple(
            _named(evidence, chosen, i, float(p[0]), "primary" if i == 0 else "secondary", rng)
            for i in range(len(chosen.hypotheses))
        )
        runner_ups = tuple(
            _named(evidence, f, 0, float(q), "runner_up", rng)
            for f, q in zip(rivals[:RUNNER_UPS], p[1:], strict=False)
        )
        alarms += invariance_alarms(likelihood, held, evidence, chosen)
        alarms += undone_alarms(evidence, chosen)
        for h in chosen.hypotheses:
            alarms += [f"{h.name}: {name} ended on the bound of its search" for name in on_bound(h)]
        prediction = likelihood.prediction(chosen.hypotheses[0].regressors, chosen.amplitudes[0])
        begun = chosen.hypotheses[0].shape.get(ONSET)
        onsets = [begun or onset(likelihood, prediction, r, k) for r in range(len(likelihood.trials))]
        items = tuple(
            replace(i, onset=onsets[r])
            for i in items
            for r, trial in enumerate(likelihood.trials)
            if trial.recording.name == i.recording
        )
        done("how sure")
    progress("how far")
    far = how_far(held, selection, settings.simulate, rng, progress)
    alarms += list(far.alarms)
    done("how far")
    outcome = rules.decide(selection, named, runner_ups, alarms, far, settings.verdict)
    shown = {e.name for e in named} if outcome.verdict in ("effect", "ambiguous") else set()
    unnamed = [name for name in settings.track if name not in shown]
    rest = evidence.remainder(chosen) if chosen is not None else likelihood.y
    ambiguity: tuple[tuple[str, ...], ...] = ()
    experiment = None
    if outcome.verdict == "ambiguous" and chosen is not None and named:
        group = tuple(dict.fromkeys([named[0].name, *outcome.tied]))
        ambiguity = (group,)
        experiment = next_experiment(likelihood, [chosen, *rivals], group, settings.seed)
    signs = signatures(likelihood, rest, evidence) if outcome.verdict == "none_of_mine" else ()
    diagnosis = replace(
        empty,
        verdict=outcome.verdict,
        reasons=outcome.reasons,
        where=items if outcome.verdict != "no_gap" else (),
        effects=named if outcome.verdict in ("effect", "ambiguous") else (),
        runner_ups=runner_ups,
        nearest=named[0] if named and outcome.verdict == "none_of_mine" else None,
        ambiguity_set=ambiguity,
        next_experiment=experiment,
        gap=far.gap,
        unexplained_fraction=selection.unexplained if chosen is not None else outcome.unexplained,
        alarms=tuple(alarms),
        signatures=signs,
        couplings=couplings(likelihood, rest),
        heatmap=grid,
        timelines=timelines(likelihood, z, k, onsets, does),
        curves=_curves(evidence, chosen),
        tracked=track(evidence, chosen, unnamed, rng) if unnamed else (),
        overlays=far.overlays,
        timings=timings,
        settings={
            "library": sorted({e.family for e in effects}),
            "threshold": selection.threshold,
            "correlation_time_samples": k,
            "gain_of_perfect_model_nat": selection.excess,
            "gain_of_perfect_model_held_out_nat": selection.held_out_excess,
            "held_out_unexplained_fraction": selection.held_out_unexplained,
        },
    )
    if chosen is not None and diagnosis.effects:
        rng = np.random.default_rng([settings.seed, 1])  # draws of its own: the report's stay as they are
        correction = correction_of(evidence, chosen, far.resimulations, far.gap, rng)
        far = replace(far, correction=correction)
    done("report")
    return with_joint_units(diagnosis, likelihood.trials[0].recording.arm), far


def _halves(recording: ArmRecording) -> tuple[ArmRecording, ArmRecording]:
    first, last = split(recording, 0.5)
    return replace(first, name=f"{recording.name}, first half"), replace(
        last, name=f"{recording.name}, second half"
    )


def _curves(evidence: Evidence, chosen: Fit | None) -> tuple[Curve, ...]:
    if chosen is None:
        return ()
    return tuple(c for h in chosen.hypotheses if (c := curve_of(evidence, chosen, h)) is not None)


def _trials(fit: Sequence[ArmRecording], held_out: Sequence[ArmRecording]) -> tuple[list[Trial], list[Trial]]:
    start, out = 0.0, []
    for recording in [*fit, *held_out]:
        rigid = RigidArm(recording.arm) if recording.arm.urdf is not None else None
        out.append(Trial(recording, rigid, start))
        start += recording.duration
    common = set.intersection(*(set(t.channels) for t in out[: len(fit)]))
    for trial, recording in zip(out, [*fit, *held_out], strict=True):
        if set(trial.channels) != common and not set(trial.channels) >= common:
            raise InputError(
                f"{recording.name} allows {trial.channels}, the others {sorted(common)}; "
                "record the same topics in all of them"
            )
    return out[: len(fit)], out[len(fit) :]


def _check_same_arm(recordings: Sequence[ArmRecording]) -> None:
    first = recordings[0].arm
    for other in recordings[1:]:
        if other.arm.joints != first.joints:
            raise InputError(
                f"{other.name} has joints {other.arm.joints}, {recordings[0].name} has {first.joints}; "
                "diagnose one arm at a time"
            )


def _named(
    evidence: Evidence, fit: Fit, index: int, probability: float, role: str, rng: np.random.Generator
) -> NamedEffect:
    h = fit.hypotheses[index]
    return NamedEffect(
        h.effect.family, h.place, probability, estimates(evidence, fit, index, rng), fit.log_evidence,
        h.form.name, role,
    )  # fmt: skip


def _version() -> str:
    try:
        return metadata.version("samrl")
    except metadata.PackageNotFoundError:
        return "unknown"
