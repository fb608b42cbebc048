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
from samrl_core.diagnosis.result import Curve, Diagnosis, InputFile
from samrl_core.diagnosis.selection import verdict as rules
from samrl_core.diagnosis.selection.curves import curve_of
from samrl_core.diagnosis.selection.description import Misdescription, misdescription
from samrl_core.diagnosis.selection.how_far import HowFar
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit
from samrl_core.diagnosis.selection.joint_units import with_joint_units
from samrl_core.diagnosis.selection.judge import judge_sets
from samrl_core.diagnosis.selection.next_experiment import next_experiment
from samrl_core.diagnosis.selection.posterior import correction_of
from samrl_core.diagnosis.selection.resimulation import simulable
from samrl_core.diagnosis.selection.selection import Selection, SelectionSettings, select
from samrl_core.diagnosis.selection.signature import couplings, signatures
from samrl_core.diagnosis.selection.tracking import track
from samrl_core.diagnosis.selection.where import heatmap, onset, timelines
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

Progress = Callable[[str], None]


@dataclass(frozen=True)
class DiagnosisSettings:
    """What may be used, and how strict to be."""

    library: Collection[str] | None = None  # families that may be named; None: all
    seed: int = 0
    selection: SelectionSettings = field(default_factory=SelectionSettings)
    verdict: rules.VerdictSettings = field(default_factory=rules.VerdictSettings)
    simulate: bool = True  # held-out recordings in closed loop
    track: tuple[str, ...] = ()  # `family@place` whose size is told, named or not
    doubt_description: bool = True  # look for joints in another order and torques in another unit first
    share_held_out: bool = True  # fit the first half of what is held out, where only that shows a gap


def library(families: Collection[str] | None) -> tuple[Effect, ...]:
    """Effects of the given families.

    Raises:
        InputError: a family that is unknown, or none at all.
    """
    if families is None:
        return EFFECTS
    known = {e.family for e in EFFECTS}
    if unknown := sorted(set(families) - known - set(NOT_BY_JOINTS) - {"joint_order", "unit_error"}):
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
    allowed = {"joint_order", "unit_error"} & set(settings.library or ("joint_order", "unit_error"))
    wrong = misdescription(trials) if settings.doubt_description else None
    if wrong is not None and wrong.family in allowed:
        return _as_described(wrong, empty, trials, held_trials, fit, held_out, settings, notes, progress)
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


def _as_described(
    wrong: Misdescription,
    empty: Diagnosis,
    trials: Sequence[Trial],
    held_trials: Sequence[Trial],
    fit: Sequence[ArmRecording],
    held_out: Sequence[ArmRecording],
    settings: DiagnosisSettings,
    notes: Sequence[str],
    progress: Progress,
) -> tuple[Diagnosis, HowFar]:
    """The diagnosis of recordings with a wrong description: the error, and what is left once it is mended."""
    remark = f"this log fits if {wrong.says}; all that follows is of the log so corrected"
    rest, far = diagnose(
        [wrong.corrected(r) for r in fit], [wrong.corrected(r) for r in held_out],
        replace(settings, doubt_description=False), [*notes, remark], progress,
    )  # fmt: skip
    arm = trials[0].recording.arm
    first = wrong.named(arm.role, arm.joints)
    reasons = (
        f"this log fits if {wrong.says}: {wrong.before:.0%} of the torque's variance contradict the"
        f" description, {wrong.after:.0%} then",
    )
    left = {
        "effect": (f"beside it: {', '.join(e.name for e in rest.effects)}",),
        "ambiguous": ("beside it there is a gap with several possible causes",),
        "none_of_mine": ("beside it there is a gap that no known effect explains",),
    }
    others = rest.effects if rest.verdict == "effect" else ()
    diagnosis = replace(
        rest,
        verdict="effect",
        reasons=(*reasons, *left.get(rest.verdict, ()), *rest.reasons),
        effects=(first, *(replace(e, role="secondary") for e in others)),
        gap=wrong.gap(held_trials),
        unexplained_fraction=wrong.after / max(wrong.before, 1e-9),
        nearest=None,
        ambiguity_set=(),
        inputs=empty.inputs,
    )
    return diagnosis, far


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
    evidence = Evidence(likelihood, selection.correlation_time)
    k = selection.correlation_time
    z = likelihood.whitened()
    judged = judge_sets(
        likelihood, held, selection, settings.verdict, settings.simulate, settings.seed, progress
    )
    done("how sure and how far")
    selection, outcome, far = judged.selection, judged.outcome, judged.far
    named, runner_ups, alarms = judged.named, judged.runner_ups, judged.alarms
    chosen = selection.chosen
    rivals = selection.rivals if chosen is not None else ()
    does = None if chosen is None else likelihood.y - evidence.remainder(chosen)
    grid, items = heatmap(likelihood, z, k, does)
    if named and not items:
        outcome = rules.hidden_in_noise(named[0])
    onsets: list[float | None] = [None] * len(likelihood.trials)
    if chosen is not None:
        prediction = likelihood.prediction(chosen.hypotheses[0].regressors, chosen.amplitudes[0])
        begun = chosen.hypotheses[0].shape.get(ONSET)
        onsets = [begun or onset(likelihood, prediction, r, k) for r in range(len(likelihood.trials))]
        items = tuple(
            replace(i, onset=onsets[r])
            for i in items
            for r, trial in enumerate(likelihood.trials)
            if trial.recording.name == i.recording
        )
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
        tracked=track(evidence, chosen, unnamed, np.random.default_rng(settings.seed)) if unnamed else (),
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
        closed = tuple(r for r in far.resimulations if simulable(r.trial))  # an export replays the law
        correction = correction_of(evidence, chosen, closed, far.gap, rng)
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


def _version() -> str:
    try:
        return metadata.version("samrl")
    except metadata.PackageNotFoundError:
        return "unknown"
