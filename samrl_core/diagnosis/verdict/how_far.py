"""How far the gap shrinks on held-out recordings: simulated again if possible, else along the log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import IN_TOLERANCES, HeldOutGap, Overlay
from samrl_core.diagnosis.selection.contenders import MOTION
from samrl_core.diagnosis.selection.gap_metric import bootstrap_shrink, shrink
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit
from samrl_core.diagnosis.selection.on_held_out import held_out_remainder
from samrl_core.diagnosis.selection.resimulation import (
    BLOCK_S,
    UNITS,
    Resimulation,
    gap,
    over_time,
    plant_of,
    resimulable,
    resimulate,
    shrink_interval,
    window_s,
)
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.foretold_motion import ForetoldMotion
from samrl_core.diagnosis.verdict.gap_in_noise import compare_in_noise
from samrl_core.diagnosis.verdict.own_place import explains_its_place

OVERLAYS = 6  # joint and quantity pairs that are plotted
SIZES = (0.5, 0.75, 1.0, 1.3, 1.7)  # of the fitted effect, tried in closed loop
DISAGREE = (0.6, 1.5)  # a closed-loop size outside of it contradicts the regression
CONFIRMED = 0.2  # share of the torque left, below which the regression needs no simulation to agree
VISIBLE_SHRINK = 0.05  # below it closed loop cannot weigh sizes


@dataclass(frozen=True, eq=False)
class HowFar:
    """The gap on held-out data, its pictures, and what contradicted the fit."""

    gap: HeldOutGap | None
    resimulations: tuple[Resimulation, ...]
    overlays: tuple[Overlay, ...] = ()
    alarms: tuple[str, ...] = ()
    correction: Correction | Recalibration | None = None  # of model or calibration, where it was named
    motion: float | None = None  # shrink of position and velocity alone, where it was simulated
    size: float | None = None  # of the fitted first effect, that simulation would have best
    # By index of a further member: 95 % interval of what it takes off the gap that the others leave
    further: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    alone: frozenset[int] = frozenset()  # further members that explain all of what is seen where they act
    foretold: ForetoldMotion | None = None  # where the simulated gap does not shrink for sure


def how_far(
    held_out: Likelihood,
    selection: Selection,
    simulate: bool,
    rng: np.random.Generator,
    progress: Callable[[str], None] = lambda _: None,
    fitted: Likelihood | None = None,
) -> HowFar:
    """Nominal model, named effect and runner-up on recordings that were never fitted."""
    if not held_out.trials or not held_out.blocks:
        return HowFar(None, ())
    sets = {} if fitted is None else _without_further(fitted, selection)
    alone = frozenset(k for k in sets if explains_its_place(held_out, selection, sets[k], k))
    return replace(_compared(held_out, selection, simulate, rng, progress, fitted, sets), alone=alone)


def _compared(
    held_out: Likelihood,
    selection: Selection,
    simulate: bool,
    rng: np.random.Generator,
    progress: Callable[[str], None],
    fitted: Likelihood | None,
    sets: Mapping[int, Fit],
) -> HowFar:
    """The comparison that these recordings allow: of motion, within noise, or along the log."""
    if simulate and all(resimulable(t) for t in held_out.trials):
        found = _simulated(held_out, selection, rng, sets)
        if found is not None:
            return found
    if held_out.exact and fitted is not None:
        gap_found, overlays = compare_in_noise(fitted, held_out, selection, rng)
        return HowFar(gap_found, (), overlays)
    return _along_the_log(held_out, selection, rng, sets)


def _without_further(fitted: Likelihood, selection: Selection) -> dict[int, Fit]:
    """The chosen set without each further member, fitted again; none where it is exact or by chance."""
    chosen = selection.chosen
    if chosen is None or fitted.exact or any(h.effect.by_chance for h in chosen.hypotheses):
        return {}
    evidence = Evidence(fitted, selection.correlation_time)
    members = chosen.hypotheses
    return {k: evidence.fit([h for h in members if h is not members[k]]) for k in range(1, len(members))}


def _simulated(
    held_out: Likelihood, selection: Selection, rng: np.random.Generator, sets: Mapping[int, Fit]
) -> HowFar | None:
    """Re-simulation; None where an effect has no simulation or diverges."""
    chosen = selection.chosen
    trials = [t for t in held_out.trials if resimulable(t)]
    runner_up = _simulated_rival(trials[0], selection)
    made = [over_time(trial, _sets(selection, runner_up, sets)) for trial in trials]
    plants = [name for name in made[0][0][1] if all(name in stages[0][1] for stages in made)]
    if chosen is not None and "with_effect" not in plants:
        return None
    runs = tuple(
        resimulate(trial, [(begin, {name: own[name] for name in plants}) for begin, own in stages])
        for trial, stages in zip(trials, made, strict=True)
    )
    nominal = gap(runs, "nominal")
    if not np.isfinite(nominal):
        return None
    quantities = tuple(q for q in UNITS if q in runs[0].measured)
    with_effect = gap(runs, "with_effect") if "with_effect" in plants else None
    if with_effect is not None and not np.isfinite(with_effect):
        return None
    other = gap(runs, "runner_up") if "runner_up" in plants else None
    other = other if other is not None and np.isfinite(other) else None
    share = None if with_effect is None else shrink(nominal, with_effect)
    windows = [window for t in trials if (window := window_s(t)) is not None]
    way = f"simulation forward over windows of {min(windows):g} s" if windows else "closed-loop re-simulation"
    held = HeldOutGap(
        f"{way}, RMS over joints and channels {IN_TOLERANCES}",
        "1", nominal, with_effect, other,
        runner_up.hypotheses[0].name if runner_up is not None and other is not None else None, share,
        None if with_effect is None else shrink_interval(runs, "with_effect", rng),
        None if share is None or other is None else share - shrink(nominal, other),
        tuple(_channel(runs, q, "with_effect" in plants) for q in quantities),
        tuple(r.trial.recording.name for r in runs),
    )  # fmt: skip
    if chosen is None:
        return HowFar(held, runs, _overlays(runs))
    size, alarms = _size(runs, chosen, plants, share)
    if selection.held_out_unexplained < CONFIRMED and selection.unexplained < CONFIRMED:
        alarms = ()  # the torque of motions that were never fitted says more than a gap of many causes
    motion = shrink(gap(runs, "nominal", MOTION), gap(runs, "with_effect", MOTION))
    further = {
        k: shrink_interval(runs, "with_effect", rng, _without(k))
        for k in sets
        if _without(k) in plants and np.isfinite(gap(runs, _without(k)))
    }
    return HowFar(held, runs, _overlays(runs), alarms, motion=motion, size=size, further=further)


def _simulated_rival(trial: Trial, selection: Selection) -> Fit | None:
    """The first rival of another family that can be simulated."""
    if selection.chosen is None:
        return None
    family = selection.chosen.hypotheses[0].effect.family
    others = (r for r in selection.rivals if r.hypotheses[0].effect.family != family)
    return next((r for r in others if plant_of(trial, r) is not None), None)


def _without(member: int) -> str:
    """Name of the plant that lacks a member of the chosen set."""
    return f"without {member}"


def _sets(selection: Selection, runner_up: Fit | None, sets: Mapping[int, Fit]) -> dict[str, Fit]:
    """Sets by name that are simulated beside the nominal model."""
    chosen = selection.chosen
    if chosen is None:
        return {}
    found = {"with_effect": chosen}
    if runner_up is not None:
        found["runner_up"] = _begun_as(chosen, runner_up)
    found |= {f"size {size}": _scaled(chosen, size) for size in SIZES if size != 1.0}
    return found | {_without(k): fit for k, fit in sets.items()}


def _begun_as(chosen: Fit, rival: Fit) -> Fit:
    """The rival with its first effect begun when that of the chosen set did: it would be that one."""
    mine, first = chosen.hypotheses[0], rival.hypotheses[0]
    if ONSET not in mine.shape or ONSET in first.shape:
        return rival
    begun = replace(first, shape={**first.shape, ONSET: mine.shape[ONSET]})
    return replace(rival, hypotheses=(begun, *rival.hypotheses[1:]))


def _scaled(fit: Fit, size: float) -> Fit:
    """The fit with its effects smaller or larger, all of them alike: one may stand in for another."""

    def changed(mean: np.ndarray, a: np.ndarray) -> np.ndarray:
        return mean + (a - mean) * size if np.any(mean) else a * size

    pairs = zip(fit.hypotheses, fit.amplitudes, strict=True)
    return replace(fit, amplitudes=tuple(changed(h.mean, a) for h, a in pairs))


def _size(
    runs: tuple[Resimulation, ...], chosen: Fit, plants: Sequence[str], share: float | None
) -> tuple[float | None, tuple[str, ...]]:
    """Size that simulation prefers; regression must agree with it where simulation can see it."""
    if np.any(chosen.hypotheses[0].mean) or share is None or share < VISIBLE_SHRINK:
        return None, ()
    errors = {1.0: gap(runs, "with_effect"), 0.0: gap(runs, "nominal")}
    errors |= {s: gap(runs, f"size {s}") for s in SIZES if f"size {s}" in plants}
    usable = {s: e**2 for s, e in errors.items() if np.isfinite(e)}
    sizes = np.array(sorted(usable))
    values = np.array([usable[s] for s in sizes])
    best = float(sizes[int(np.argmin(values))])
    gain = usable[1.0] - float(np.min(values))
    # Only a clear preference counts: the nominal remainder moves the minimum a little.
    if gain > 0.25 * usable[1.0] and not DISAGREE[0] <= best <= DISAGREE[1]:
        return best, (
            f"{chosen.hypotheses[0].name}: simulation wants {best:.2g} times the size that "
            "regression gives; its formula is not what happens",
        )
    return best, ()


def _channel(
    runs: tuple[Resimulation, ...], quantity: str, named: bool
) -> tuple[str, str, float, float | None]:
    after = _rms(runs, "with_effect", quantity) if named else None
    return quantity, UNITS[quantity], _rms(runs, "nominal", quantity), after


def _rms(runs: tuple[Resimulation, ...], plant: str, quantity: str) -> float:
    squares = [(r.measured[quantity] - r.simulated[plant][quantity]) ** 2 for r in runs]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _overlays(runs: tuple[Resimulation, ...]) -> tuple[Overlay, ...]:
    """Signals in which the nominal model errs most."""
    scored = []
    for r, run in enumerate(runs):
        for quantity, values in run.measured.items():
            error = np.mean(
                ((values - run.simulated["nominal"][quantity]) / run.scales[quantity]) ** 2, axis=0
            )
            scored += [(float(e), r, quantity, j) for j, e in enumerate(error)]
    out = []
    for _, r, quantity, j in sorted(scored, reverse=True)[:OVERLAYS]:
        run = runs[r]

        def signal(plant: str, run: Resimulation = run, q: str = quantity, j: int = j) -> np.ndarray | None:
            return run.simulated[plant][q][:, j] if plant in run.simulated else None

        nominal = signal("nominal")
        assert nominal is not None
        out.append(
            Overlay(
                run.trial.recording.name, run.trial.recording.arm.joints[j], quantity, UNITS[quantity],
                run.time, run.measured[quantity][:, j], nominal, signal("with_effect"), signal("runner_up"),
            )
        )  # fmt: skip
    return tuple(out)


def _along_the_log(
    held_out: Likelihood, selection: Selection, rng: np.random.Generator, sets: Mapping[int, Fit]
) -> HowFar:
    """Residuals along held-out recordings before and after; for logs without a closed loop."""
    chosen = selection.chosen
    channel = _where_it_acts(held_out, chosen)
    if chosen is not None and any(h.effect.by_chance for h in chosen.hypotheses):
        chosen = None  # when chance strikes again, nothing that was fitted can say
    rest = None if chosen is None else held_out_remainder(held_out, chosen)
    rival = selection.rivals[0] if chosen is not None and selection.rivals else None
    other = None if rival is None else held_out_remainder(held_out, rival)
    before = _physical(held_out, held_out.y, channel)
    nominal = float(np.sqrt(np.mean(np.concatenate(before) ** 2)))
    after = None if rest is None else _physical(held_out, rest, channel)
    with_effect = None if after is None else float(np.sqrt(np.mean(np.concatenate(after) ** 2)))
    third = None if other is None else _physical(held_out, other, channel)
    runner_up = None if third is None else float(np.sqrt(np.mean(np.concatenate(third) ** 2)))
    share = None if with_effect is None else shrink(nominal, with_effect)
    unit = held_out.trials[0].units[channel]
    held = HeldOutGap(
        f"residual along the log, RMS over joints ({channel})", unit, nominal, with_effect, runner_up,
        None if rival is None else rival.hypotheses[0].name, share,
        None if after is None else _interval(held_out, channel, before, after, rng),
        None if share is None or runner_up is None else share - shrink(nominal, runner_up),
        ((channel, unit, nominal, with_effect),),
        tuple(t.name for t in held_out.trials),
    )  # fmt: skip
    further = {} if rest is None else _further_along(held_out, selection, rest, sets, rng)
    return HowFar(held, (), _log_overlays(held_out, channel, before, after), further=further)


def _further_along(
    held_out: Likelihood,
    selection: Selection,
    rest: np.ndarray,
    sets: Mapping[int, Fit],
    rng: np.random.Generator,
) -> dict[int, tuple[float, float]]:
    """`HowFar.further` along the log, where each member acts; `rest` (N,) is what the whole set leaves."""
    out = {}
    for k, fit in sets.items():
        assert selection.chosen is not None
        channel = _where_it_acts(held_out, selection.chosen, k)
        without = _physical(held_out, held_out_remainder(held_out, fit), channel)
        out[k] = _interval(held_out, channel, without, _physical(held_out, rest, channel), rng)
    return out


def _where_it_acts(held_out: Likelihood, chosen: Fit | None, member: int = 0) -> str:
    """The channel in which a named effect explains most; the last one where nothing is named."""
    channels = held_out.trials[0].channels
    if chosen is None:
        return channels[-1]
    first, amplitudes = chosen.hypotheses[member], chosen.amplitudes[member]
    energy = dict.fromkeys(channels, 0.0)
    for (_, channel, _joint), rows in first.regressors.blocks.items():
        energy[channel] = energy.get(channel, 0.0) + float(np.sum((amplitudes @ rows) ** 2))
    return max(channels, key=lambda c: energy[c])


def _physical(held_out: Likelihood, y: np.ndarray, channel: str) -> list[np.ndarray]:
    """Residuals of a channel in physical units, one (N, J) per recording."""
    out = []
    for r, trial in enumerate(held_out.trials):
        parts = [held_out.uncolored((r, channel, j), y) for j in range(len(trial.places))]
        out.append(np.stack(parts, axis=1) * trial.sigma[channel])
    return out


def _interval(
    held_out: Likelihood,
    channel: str,
    before: list[np.ndarray],
    after: list[np.ndarray],
    rng: np.random.Generator,
) -> tuple[float, float]:
    sums = []
    for trial, b, a in zip(held_out.trials, before, after, strict=True):
        size = max(1, round(BLOCK_S / trial.spacing(channel)))
        for start in range(0, len(b), size):
            sums.append((np.sum(b[start : start + size] ** 2), np.sum(a[start : start + size] ** 2)))
    return bootstrap_shrink(np.array(sums), rng)


def _log_overlays(
    held_out: Likelihood, channel: str, before: list[np.ndarray], after: list[np.ndarray] | None
) -> tuple[Overlay, ...]:
    """Measured residual against zero (nominal) and against what the effect predicts."""
    out = []
    for r, trial in enumerate(held_out.trials):
        worst = np.argsort(-np.mean(before[r] ** 2, axis=0))[:3]
        for j in worst:
            predicted = None if after is None else before[r][:, j] - after[r][:, j]
            out.append(
                Overlay(
                    trial.name, trial.places[j].partition(":")[2], "residual", trial.units[channel],
                    trial.elapsed(channel), before[r][:, j], np.zeros(len(before[r])),
                    predicted,
                )
            )  # fmt: skip
    return tuple(out)
