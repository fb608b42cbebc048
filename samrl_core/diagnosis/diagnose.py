"""From recordings of one system to a diagnosis: where, which, how far, or why not."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from typing import Any

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import FAMILIES, Effect
from samrl_core.diagnosis.findings.onset import find_onsets
from samrl_core.diagnosis.findings.signature import couplings, signatures
from samrl_core.diagnosis.findings.tracking import track
from samrl_core.diagnosis.findings.where import heatmap, tile_gaps, timelines
from samrl_core.diagnosis.kinds.kind import Kind, Recording
from samrl_core.diagnosis.kinds.kinds import KINDS, kind_of
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import as_arms
from samrl_core.diagnosis.result import Diagnosis, InputFile
from samrl_core.diagnosis.selection import verdict as rules
from samrl_core.diagnosis.selection.description import Misdescription
from samrl_core.diagnosis.selection.how_far import HowFar
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.judge import judge_sets
from samrl_core.diagnosis.selection.selection import Selection, SelectionSettings, select

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


def library(families: Collection[str] | None, kind: Kind[Any] | None = None) -> tuple[Effect[Any], ...]:
    """Effects of the given families that a kind of recordings may show; an arm's joints unless stated.

    Raises:
        InputError: a family that is unknown, or none at all.
    """
    kind = kind or KINDS[ArmRecording]
    if families is None:
        return kind.effects
    known = {e.family for e in kind.effects}
    if unknown := sorted(set(families) - set(FAMILIES)):
        raise InputError(f"unknown families {unknown} in the library; known are {sorted(known)}")
    chosen = tuple(e for e in kind.effects if e.family in families)
    if not chosen:
        raise InputError(
            f"the library allows no effect that {kind.shown_by} can show; name at least one of"
            f" {sorted(known)}"
        )
    return chosen


def diagnose(
    fit: Sequence[Recording],
    held_out: Sequence[Recording],
    settings: DiagnosisSettings | None = None,
    notes: Sequence[str] = (),
    progress: Progress = lambda _: None,
) -> tuple[Diagnosis, HowFar]:
    """Diagnose recordings of one system: an arm's joints, a camera's poses.

    Args:
        fit: recordings that are fitted.
        held_out: recordings that are only ever compared with; may be empty, then nothing is said of shrink.
        settings: library, seed, thresholds.
        notes: remarks about the input that the report should carry.
        progress: called with each stage's name.

    Raises:
        InputError: nothing to fit, different systems, or an empty library.
    """
    settings = settings or DiagnosisSettings()
    if not fit:
        raise InputError("no recording to fit; give at least one that is not held out")
    kind = kind_of([*fit, *held_out])
    alike, dropped = kind.alike([*fit, *held_out])
    fit, held_out, left_out = kind.usable(alike[: len(fit)], alike[len(fit) :])
    notes = [*notes, *dropped, *left_out]
    effects = library(settings.library, kind)
    clock, timings = time.monotonic(), {}

    def done(stage: str) -> None:
        nonlocal clock
        now = time.monotonic()
        timings[stage], clock = now - clock, now

    progress("residuals")
    trials, held_trials = kind.trials(fit, held_out)
    notes = [*notes, *kind.notes(trials)]
    first = trials[0]
    untestable = {e.family: reason for e in effects if (reason := e.why_unobservable(first))}
    untestable |= kind.elsewhere
    inputs = tuple(
        InputFile(r.source, r.sha256, role, r.duration)
        for role, group in (("fit", fit), ("held_out", held_out))
        for r in group
    )
    empty = Diagnosis(
        "not_testable", (kind.why_nothing(trials),), (), (), (), (), None,
        None, 0.0, untestable, inputs, settings.seed, _version(), kind.system(first),
        notes=tuple(notes),
    )  # fmt: skip
    if not first.channels:
        return empty, HowFar(None, ())
    allowed = {"joint_order", "unit_error"} & set(settings.library or ("joint_order", "unit_error"))
    wrong = kind.misdescription(trials) if settings.doubt_description else None
    if wrong is not None and wrong.family in allowed:
        return _as_described(wrong, empty, trials, held_trials, fit, held_out, settings, notes, progress)
    likelihood, held = Likelihood(trials), Likelihood(held_trials)
    done("residuals")
    rules_of_kind = replace(settings.selection, chance=settings.selection.chance or kind.chance)
    selection = select(likelihood, held, effects, rules_of_kind, progress)
    done("which")
    if settings.share_held_out and rules.only_held_out(selection, settings.verdict):
        try:
            halves = [kind.halves(r) for r in held_out]
        except InputError as error:  # of recordings that nobody asked to be halved
            remark = f"only the held-out recordings show a gap, and they cannot be halved: {error}"
            empty = replace(empty, notes=(*empty.notes, remark))
        else:
            remark = (
                "only the held-out recordings show a gap: their first halves were fitted too,"
                " their second halves stay held out"
            )
            return diagnose(
                [*fit, *(first for first, _ in halves)], [last for _, last in halves],
                replace(settings, share_held_out=False), [*notes, remark], progress,
            )  # fmt: skip
    return _conclude(kind, empty, selection, likelihood, held, effects, settings, timings, progress, done)


def _as_described(
    wrong: Misdescription,
    empty: Diagnosis,
    trials: Sequence[Observed],
    held_trials: Sequence[Observed],
    fit: Sequence[Any],
    held_out: Sequence[Any],
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
    arm = as_arms(trials)[0].recording.arm
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
        gap=wrong.gap(as_arms(held_trials)),
        unexplained_fraction=wrong.after / max(wrong.before, 1e-9),
        nearest=None,
        ambiguity_set=(),
        inputs=empty.inputs,
    )
    return diagnosis, far


def _conclude(
    kind: Kind[Any],
    empty: Diagnosis,
    selection: Selection,
    likelihood: Likelihood,
    held: Likelihood,
    effects: Sequence[Effect[Any]],
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
        likelihood, held, selection, settings.verdict, settings.simulate, settings.seed, progress,
        kind.doubts,
    )  # fmt: skip
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
    # When a law began that is not what happens, nobody can say.
    if chosen is not None and outcome.verdict in ("effect", "ambiguous"):
        onsets = find_onsets(likelihood, chosen, k)
        items = tuple(
            replace(i, onset=onsets[r])
            for i in items
            for r, trial in enumerate(likelihood.trials)
            if trial.name == i.recording
        )
    shown = {e.name for e in named} if outcome.verdict in ("effect", "ambiguous") else set()
    unnamed = [name for name in settings.track if name not in shown]
    rest = evidence.remainder(chosen) if chosen is not None else likelihood.y
    ambiguity: tuple[tuple[str, ...], ...] = ()
    experiment = None
    if outcome.verdict == "ambiguous" and chosen is not None and named:
        group = tuple(dict.fromkeys([named[0].name, *outcome.tied]))
        ambiguity = (group,)
        experiment, why_none = kind.next_experiment(likelihood, [chosen, *rivals], group, settings.seed)
        outcome = replace(outcome, reasons=(*outcome.reasons, why_none)) if why_none else outcome
    curves = (
        () if chosen is None else (kind.curve(evidence, chosen, i) for i in range(len(chosen.hypotheses)))
    )
    signs = signatures(likelihood, rest) if outcome.verdict == "none_of_mine" else ()
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
        tiles=tile_gaps(likelihood, z, k, does),
        information={} if chosen is None else kind.information(likelihood, chosen),
        least_sizes=tuple(kind.least_sizes(evidence, effects, selection.threshold)),
        timelines=timelines(likelihood, z, k, onsets, does),
        curves=tuple(c for c in curves if c is not None),
        tracked=track(evidence, chosen, unnamed, np.random.default_rng(settings.seed), kind.effects)
        if unnamed
        else (),
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
        sure = diagnosis.verdict == "effect"
        far = replace(far, correction=kind.correction(evidence, chosen, far, sure, rng))
    done("report")
    return kind.finish(diagnosis, likelihood.trials[0]), far


def _version() -> str:
    try:
        return metadata.version("samrl")
    except metadata.PackageNotFoundError:
        return "unknown"
