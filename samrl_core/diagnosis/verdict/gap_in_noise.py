"""The gap on held-out recordings whose channels are of several units: root mean square in units of noise.

What nobody stated (a camera that was solved for) is taken as the fitted recordings give it with and without
the effect, so that nothing is fitted to what is held out.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.tolerances import unknown_columns
from samrl_core.diagnosis.result import HeldOutGap, Overlay
from samrl_core.diagnosis.selection.gap_metric import bootstrap_shrink, shrink
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.on_held_out import held_out_remainder
from samrl_core.diagnosis.selection.selection import Selection

OVERLAYS = 6
BLOCKS = 20  # of each recording, that the bootstrap draws


def compare_in_noise(
    fitted: Likelihood, held_out: Likelihood, selection: Selection, rng: np.random.Generator
) -> tuple[HeldOutGap, tuple[Overlay, ...]]:
    """Held-out residuals with the nominal model, with the named effect and with the runner-up."""
    evidence = Evidence(fitted, selection.correlation_time)

    def left(fit: Fit | None) -> np.ndarray:
        rest = fitted.y if fit is None else evidence.remainder(fit)
        sizes = fitted.tolerance_sizes(rest, selection.correlation_time)
        known = held_out.of_tolerances(np.where(unknown_columns(fitted.trials[0]), sizes, 0.0))
        return (held_out.y if fit is None else held_out_remainder(held_out, fit)) - known

    before = left(None)
    chosen = selection.chosen
    rival = selection.rivals[0] if chosen is not None and selection.rivals else None
    after = None if chosen is None else left(chosen)
    other = None if rival is None else left(rival)
    nominal = _rms(before)
    share = None if after is None else shrink(nominal, _rms(after))
    gap = HeldOutGap(
        "residual, RMS over channels in units of noise", "1", nominal,
        None if after is None else _rms(after), None if other is None else _rms(other),
        None if rival is None else rival.hypotheses[0].name, share,
        None if after is None else _interval(held_out, before, after, rng),
        None if share is None or other is None else share - shrink(nominal, _rms(other)),
        tuple(
            _channel(held_out, c, before, after)
            for c in held_out.trials[0].channels
            if any(b[1] == c for b in held_out.blocks)
        ),
        tuple(t.name for t in held_out.trials),
    )  # fmt: skip
    return gap, _overlays(held_out, before, after)


def _rms(y: np.ndarray) -> float:
    return float(np.sqrt(np.mean(y**2)))


def _channel(
    held_out: Likelihood, channel: str, before: np.ndarray, after: np.ndarray | None
) -> tuple[str, str, float, float | None]:
    """Root mean square of one channel in its own unit, weighed by its noise."""
    parts = [(b, part) for b, part in held_out.blocks.items() if b[1] == channel]
    typical = float(
        np.median(np.concatenate([held_out.trials[b[0]].sigma[channel][:, b[2]] for b, _ in parts]))
    )

    def level(y: np.ndarray) -> float:
        return typical * _rms(np.concatenate([y[part] for _, part in parts]))

    return channel, held_out.trials[0].units[channel], level(before), None if after is None else level(after)


def _interval(
    held_out: Likelihood, before: np.ndarray, after: np.ndarray, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of the shrink over stretches of time, all channels of a stretch together."""
    sums: dict[tuple[int, int], np.ndarray] = {}
    for (r, _, _), part in held_out.blocks.items():
        for k, piece in enumerate(np.array_split(np.arange(part.start, part.stop), BLOCKS)):
            pair = np.array([np.sum(before[piece] ** 2), np.sum(after[piece] ** 2)])
            sums[r, k] = sums.get((r, k), np.zeros(2)) + pair
    return bootstrap_shrink(np.array(list(sums.values())), rng)


def _overlays(held_out: Likelihood, before: np.ndarray, after: np.ndarray | None) -> tuple[Overlay, ...]:
    """Residuals in which the nominal model errs most, against what the effect predicts."""
    ranked = sorted(held_out.blocks, key=lambda b: -_rms(before[held_out.blocks[b]]))
    out = []
    for r, channel, row in ranked[:OVERLAYS]:
        trial, part = held_out.trials[r], held_out.blocks[r, channel, row]
        sigma = trial.sigma[channel][:, row]
        seen = before[part] * sigma
        predicted = None if after is None else (before[part] - after[part]) * sigma
        place = trial.places[row].partition(":")[2] or trial.places[row]
        out.append(
            Overlay(
                trial.name, place, channel, trial.units[channel], trial.elapsed(channel), seen,
                np.zeros(len(seen)), predicted, tiles=trial.tiles_of(channel),
            )
        )  # fmt: skip
    return tuple(out)
