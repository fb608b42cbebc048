"""From recordings of one system to a diagnosis: where, which, how far, or why not."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are
from samrl_core.common.version import samrl_version
from samrl_core.diagnosis.effects import FAMILIES, Effect
from samrl_core.diagnosis.findings.onset import began_in, find_onsets, say_when_others_began
from samrl_core.diagnosis.findings.signature import couplings, signatures
from samrl_core.diagnosis.findings.tracking import track
from samrl_core.diagnosis.findings.where import heatmap, tile_gaps, timelines
from samrl_core.diagnosis.kinds.kind import Kind, Recording
from samrl_core.diagnosis.kinds.kinds import KINDS, kind_of
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import as_arms
from samrl_core.diagnosis.result import (
    Curve,
    Diagnosis,
    FamilyWords,
    Heatmap,
    InputFile,
    LeastSize,
    NamedEffect,
    NextExperiment,
    TileGaps,
    Timeline,
    WhereItem,
)
from samrl_core.diagnosis.selection.description import WrongDescription
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.selection import Selection, select
from samrl_core.diagnosis.selection.settings import SelectionSettings
from samrl_core.diagnosis.verdict import rules
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.judge import Judge
from samrl_core.diagnosis.verdict.least_sizes import least_sizes
from samrl_core.diagnosis.verdict.missed_motion import moves_off

Progress = Callable[[str], None]
NAMING = ("effect", "ambiguous")  # verdicts that name effects
OF_DESCRIPTION = {"joint_order", "unit_error", "torque_saturation"}  # families that its errors are named by


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
        raise InputError(f"unknown families {unknown} in the library; {known_are(unknown[0], sorted(known))}")
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
    watch = _Stopwatch()
    progress("residuals")
    case = _prepare(fit, held_out, settings, notes, progress)
    if not case.trials[0].channels:
        return case.unjudged(), HowFar(None, ())
    allowed = OF_DESCRIPTION & set(settings.library or OF_DESCRIPTION)
    wrong = case.kind.misdescription(case.trials) if settings.doubt_description else None
    if wrong is not None and wrong.family in allowed:
        return _as_described(case, wrong)
    likelihood, held = Likelihood(case.trials), Likelihood(case.held_trials)
    watch.done("residuals")
    rules_of_kind = replace(settings.selection, chance=settings.selection.chance or case.kind.chance)
    selection = select(likelihood, held, case.effects, rules_of_kind, progress)
    watch.done("which")
    if settings.share_held_out and rules.only_held_out(selection, settings.verdict):
        try:
            halves = [case.kind.halves(r) for r in case.held_out]
        except InputError as error:  # of recordings that nobody asked to be halved
            remark = f"only the held-out recordings show a gap, and they cannot be halved: {error}"
            case = replace(case, notes=(*case.notes, remark))
        else:
            remark = (
                "only the held-out recordings show a gap: their first halves were fitted too,"
                " their second halves stay held out"
            )
            return diagnose(
                [*case.fit, *(first for first, _ in halves)], [last for _, last in halves],
                replace(settings, share_held_out=False), [*case.notes, remark], progress,
            )  # fmt: skip
    return _conclude(case, selection, likelihood, held, watch)


class _Stopwatch:
    """Time [s] that each stage took."""

    def __init__(self) -> None:
        self.timings: dict[str, float] = {}
        self._clock = time.monotonic()

    def done(self, stage: str) -> None:
        """The stage ends, the next begins."""
        now = time.monotonic()
        self.timings[stage], self._clock = now - self._clock, now


@dataclass(frozen=True, eq=False)
class _Case:
    """Recordings of one system, and what may be said of it."""

    kind: Kind[Any]
    fit: Sequence[Recording]
    held_out: Sequence[Recording]
    trials: Sequence[Observed]  # of `fit`
    held_trials: Sequence[Observed]
    effects: tuple[Effect[Any], ...]  # that may be named
    settings: DiagnosisSettings
    notes: tuple[str, ...]  # about the input
    found: tuple[str, ...]  # what only residuals show of it
    progress: Progress

    def unjudged(self) -> Diagnosis:
        """What the report says of any recordings, without a verdict on these."""
        first = self.trials[0]
        untestable = {e.family: reason for e in self.effects if (reason := e.why_unobservable(first))}
        inputs = tuple(
            InputFile(r.source, r.sha256, role, r.duration)
            for role, group in (("fit", self.fit), ("held_out", self.held_out))
            for r in group
        )
        return Diagnosis(
            "not_testable", (self.kind.why_nothing(self.trials),), (), (), (), (), None, None, 0.0,
            untestable | self.kind.elsewhere, inputs, self.settings.seed, samrl_version(),
            self.kind.system(first), notes=(*self.notes, *self.found),
            told={e.family: FamilyWords(e.meaning, e.remedy, e.explained) for e in self.kind.effects},
        )  # fmt: skip


def _prepare(
    fit: Sequence[Recording],
    held_out: Sequence[Recording],
    settings: DiagnosisSettings,
    notes: Sequence[str],
    progress: Progress,
) -> _Case:
    """The recordings as trials, reduced to what all of them carry."""
    kind = kind_of([*fit, *held_out])
    alike, dropped = kind.alike([*fit, *held_out])
    fit, held_out, left_out = kind.usable(alike[: len(fit)], alike[len(fit) :])
    effects = library(settings.library, kind)
    trials, held_trials = kind.trials(fit, held_out)
    told, found = (*notes, *dropped, *left_out), tuple(kind.notes(trials))
    return _Case(kind, fit, held_out, trials, held_trials, effects, settings, told, found, progress)


def _as_described(case: _Case, wrong: WrongDescription) -> tuple[Diagnosis, HowFar]:
    """The diagnosis of recordings with a wrong description: the error, and what is left once it is mended."""
    remark = f"this log fits if {wrong.says}; all that follows is of the log so corrected"
    both = (as_arms(case.trials), as_arms(case.held_trials))
    corrected = [[wrong.corrected(trial.recording) for trial in trials] for trials in both]
    rest, far = diagnose(
        *corrected, replace(case.settings, doubt_description=False), [*case.notes, remark], case.progress
    )
    arm = both[0][0].recording.arm
    named = wrong.named(arm.role, arm.joints)
    reasons = (
        f"this log fits if {wrong.says}: {wrong.before:.0%} of the torque's variance contradict the"
        f" description, {wrong.after:.0%} then",
    )
    could_be = ", ".join(dict.fromkeys(name for group in rest.ambiguity_set for name in group))
    left = {
        "effect": (f"beside it: {', '.join(e.name for e in rest.effects)}",),
        "ambiguous": (f"beside it there is a gap with several possible causes: {could_be}",),
        "none_of_mine": ("beside it there is a gap that no known effect explains",),
    }
    others = rest.effects if rest.verdict == "effect" else ()
    diagnosis = replace(
        rest,
        verdict="effect",
        reasons=(*reasons, *left.get(rest.verdict, ()), *rest.reasons),
        effects=(*named, *(replace(e, role="secondary") for e in others)),
        gap=wrong.gap(both[1]),
        unexplained_fraction=wrong.after / max(wrong.before, 1e-9),
        nearest=None,
        ambiguity_set=(),
        inputs=case.unjudged().inputs,
    )
    return diagnosis, far


def _conclude(
    case: _Case, selection: Selection, likelihood: Likelihood, held: Likelihood, watch: _Stopwatch
) -> tuple[Diagnosis, HowFar]:
    """Everything that follows from the selection."""
    kind, settings = case.kind, case.settings
    evidence = Evidence(likelihood, selection.correlation_time)
    judge = Judge(
        likelihood, held, settings.verdict, settings.simulate, settings.seed, case.progress,
        kind.doubts_of(likelihood, held),
    )  # fmt: skip
    judged = judge.judge_first(selection)
    watch.done("how sure and how far")
    selection, outcome, named, far = judged.selection, judged.outcome, judged.named, judged.far
    chosen = selection.chosen
    rest = evidence.remainder(chosen) if chosen is not None else likelihood.y
    place = _find_place(evidence, chosen, rest, outcome.verdict in NAMING)
    if named and not place.items:
        outcome, place = rules.hidden_in_noise(named[0]), place.without_onsets()
    outcome, ambiguity, experiment = _find_experiment(case, likelihood, selection, named, outcome)
    if outcome.verdict == "no_gap":
        needed = _needed_evidence(selection, outcome, settings.verdict)
        sooner = kind.show_sooner(evidence, selection.pool, needed)
        off = moves_off(far.gap, settings.verdict)
        outcome = replace(outcome, reasons=(*outcome.reasons, *off, *sooner))
    effects = named if outcome.verdict in NAMING else ()
    if effects and chosen is not None:
        outcome = replace(outcome, reasons=(*outcome.reasons, *say_when_others_began(chosen)))
    tracked, untracked = _track_unnamed(case, evidence, chosen, effects)
    diagnosis = replace(
        case.unjudged(),
        verdict=outcome.verdict,
        reasons=outcome.reasons,
        where=place.items if outcome.verdict != "no_gap" else (),
        effects=effects,
        runner_ups=judged.runner_ups,
        nearest=named[0] if named and outcome.verdict == "none_of_mine" else None,
        ambiguity_set=ambiguity,
        next_experiment=experiment,
        gap=far.gap,
        unexplained_fraction=selection.unexplained if chosen is not None else outcome.unexplained,
        alarms=judged.alarms,
        signatures=signatures(likelihood, rest) if outcome.verdict == "none_of_mine" else (),
        couplings=couplings(likelihood, rest),
        heatmap=place.grid,
        tiles=place.tiles,
        timelines=place.timelines(likelihood),
        information={} if chosen is None else kind.information(likelihood, chosen),
        least_sizes=_least_sizes(evidence, selection, outcome, settings.verdict),
        curves=() if chosen is None else _curves(kind, evidence, chosen),
        tracked=tracked,
        notes=(*case.notes, *case.found, *untracked),
        overlays=far.overlays,
        timings=watch.timings,
        settings={
            "library": sorted({e.family for e in case.effects}),
            "threshold": selection.threshold,
            "correlation_time_samples": evidence.correlation_time,
            "gain_of_perfect_model_nat": selection.excess,
            "gain_of_perfect_model_held_out_nat": selection.held_out_excess,
            "held_out_unexplained_fraction": selection.held_out_unexplained,
        },
    )
    if chosen is not None and diagnosis.effects:
        rng = np.random.default_rng([settings.seed, 1])  # draws of its own: the report's stay as they are
        sure = diagnosis.verdict == "effect"
        far = replace(far, correction=kind.correction(evidence, chosen, far, sure, rng))
    watch.done("report")
    return kind.finish(diagnosis, likelihood.trials[0]), far


@dataclass(frozen=True, eq=False)
class _Place:
    """Where recordings stand out, and since when: what findings say of one set."""

    z: np.ndarray  # (N,) whitened residuals
    does: np.ndarray | None  # (N,) of them what the named effects do
    correlation: float  # samples that count as one
    onsets: Sequence[float | None]  # per recording [s]
    grid: Heatmap
    items: tuple[WhereItem, ...]
    tiles: tuple[TileGaps, ...]

    def without_onsets(self) -> _Place:
        """The same of effects that are not there."""
        return replace(self, onsets=[None] * len(self.onsets))

    def timelines(self, likelihood: Likelihood) -> tuple[Timeline, ...]:
        """How much stands out over time."""
        return timelines(likelihood, self.z, self.correlation, self.onsets, self.does)


def _find_place(evidence: Evidence, chosen: Fit | None, rest: np.ndarray, is_named: bool) -> _Place:
    """`rest` (N,) is what the chosen set leaves; `is_named` whether the verdict names it."""
    likelihood, k = evidence.likelihood, evidence.correlation_time
    z = likelihood.whitened()
    does = None if chosen is None else likelihood.y - rest
    onsets: list[float | None] = [None] * len(likelihood.trials)
    # When a law began that is not what happens, nobody can say.
    if chosen is not None and is_named:
        onsets = find_onsets(likelihood, chosen, k)
    began = {} if chosen is None else began_in(chosen, onsets)
    grid, items = heatmap(likelihood, z, k, does, began)
    return _Place(z, does, k, onsets, grid, items, tile_gaps(likelihood, z, k, does))


def _find_experiment(
    case: _Case,
    likelihood: Likelihood,
    selection: Selection,
    named: Sequence[NamedEffect],
    outcome: rules.Decision,
) -> tuple[rules.Decision, tuple[tuple[str, ...], ...], NextExperiment | None]:
    """The verdict, with why nothing splits its ambiguity set where nothing does; that set; what splits it."""
    if outcome.verdict != "ambiguous" or selection.chosen is None or not named:
        return outcome, (), None
    group = tuple(dict.fromkeys([named[0].name, *outcome.tied]))
    experiment, why_none = case.kind.next_experiment(
        likelihood, [selection.chosen, *selection.rivals], group, case.settings.seed
    )
    if why_none:
        outcome = replace(outcome, reasons=(*outcome.reasons, why_none))
    return outcome, (group,), experiment


def _curves(kind: Kind[Any], evidence: Evidence, chosen: Fit) -> tuple[Curve, ...]:
    """Each chosen effect over the data, where its kind shows one."""
    drawn = (kind.curve(evidence, chosen, index) for index in range(len(chosen.hypotheses)))
    return tuple(curve for curve in drawn if curve is not None)


def _track_unnamed(
    case: _Case, evidence: Evidence, chosen: Fit | None, effects: Sequence[NamedEffect]
) -> tuple[tuple[NamedEffect, ...], tuple[str, ...]]:
    """Sizes of the effects whose size is asked for and that the report does not name; remarks on others."""
    shown = {e.name for e in effects}
    unnamed = [name for name in case.settings.track if name not in shown]
    if not unnamed:
        return (), ()
    return track(evidence, chosen, unnamed, np.random.default_rng(case.settings.seed), case.kind.effects)


def _least_sizes(
    evidence: Evidence, selection: Selection, outcome: rules.Decision, settings: rules.VerdictSettings
) -> tuple[LeastSize, ...]:
    """From which sizes on recordings show effects: where nothing was found, and where that costs little."""
    if outcome.verdict != "no_gap" and not evidence.likelihood.exact:
        return ()
    needed = _needed_evidence(selection, outcome, settings)
    return tuple(least_sizes(evidence, selection.pool, needed))


def _needed_evidence(selection: Selection, outcome: rules.Decision, settings: rules.VerdictSettings) -> float:
    """Log evidence [nat] that a name would have needed."""
    if outcome.verdict == "no_gap" and selection.chosen is not None:
        # Held-out recordings do not show what less evidence speaks for.
        return settings.clearly * selection.threshold
    return selection.threshold
