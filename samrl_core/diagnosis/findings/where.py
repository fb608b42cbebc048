"""Where the gap lies: whitened residuals by place, channel, phase and window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from scipy import stats

from samrl_core.diagnosis.residuals.likelihood import Block, Likelihood
from samrl_core.diagnosis.result import PHASES, Heatmap, TileGaps, Timeline, WhereItem

WINDOW_S = 0.25
FALSE_DISCOVERY = 0.01
LEAST_SHARE = 0.01  # of the excess that an item must have to be listed


def heatmap(
    likelihood: Likelihood,
    z: np.ndarray,
    correlation: float,
    effects: np.ndarray | None = None,
    began: Mapping[Block, float] = MappingProxyType({}),
) -> tuple[Heatmap, tuple[WhereItem, ...]]:
    """Excess by joint, channel and phase, and its significant cells, strongest first.

    `effects` (N,) is what named effects do: a gap with the shape of a tolerance is cheap sample by sample,
    and shows where it lies only by its own prediction. `began` is when the first of them did, where it acts
    [s].
    """
    z = _standing_out(z, effects)
    trials = likelihood.trials
    places, channels = trials[0].places, trials[0].channels
    columns = [(c, p) for c in channels for p in PHASES]
    total = np.zeros((len(places), len(columns)))
    count = np.zeros_like(total)
    per: dict[tuple[int, str, int, int], float] = {}
    for (r, channel, j), part in likelihood.blocks.items():
        square, phase = z[part] ** 2, trials[r].phases(channel)[:, j]
        for p in range(len(PHASES)):
            chosen = phase == p
            column = channels.index(channel) * len(PHASES) + p
            total[j, column] += np.sum(square[chosen])
            count[j, column] += np.count_nonzero(chosen)
            per[r, channel, j, p] = float(np.sum(np.maximum(square[chosen] - 1.0, 0.0)))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
    enough = count / correlation >= 2
    freedom = np.maximum(count / correlation, 1.0)
    p_values = np.where(enough, stats.chi2.sf(freedom * np.nan_to_num(mean), freedom), 1.0)
    limit = _benjamini_hochberg(p_values[enough], FALSE_DISCOVERY)
    significant = enough & (p_values <= limit)
    excess = np.where(significant, np.maximum(total - count, 0.0), 0.0)
    everything = float(np.sum(excess))
    items = []
    if everything > 0:
        for j, column in sorted(
            np.argwhere(excess > LEAST_SHARE * everything).tolist(), key=lambda a: -excess[a[0], a[1]]
        )[:12]:
            channel, phase = columns[column]
            r = max(range(len(trials)), key=lambda r: per.get((r, channel, j, PHASES.index(phase)), 0.0))
            t0, t1 = _span(likelihood, z, r, channel, j, PHASES.index(phase))
            items.append(
                WhereItem(
                    places[j], channel, phase, t0, t1, float(excess[j, column] / everything), trials[r].name,
                    began.get((r, channel, j)),
                )
            )  # fmt: skip
    values = np.where(count > 0, np.sqrt(np.nan_to_num(mean)), np.nan)
    below = values[enough & ~significant]
    # Just above the largest that is not significant, so that it is not counted itself.
    threshold = float(np.nextafter(np.max(below), np.inf)) if below.size else 1.0
    return Heatmap(places, tuple(columns), values, threshold), tuple(items)


def tile_gaps(
    likelihood: Likelihood, z: np.ndarray, correlation: float, effects: np.ndarray | None = None
) -> tuple[TileGaps, ...]:
    """Tiles of each channel that stand out, over all frames of all recordings; none of what is no image.

    `z` and `effects` (N,) as for `heatmap`.
    """
    square = _standing_out(z, effects) ** 2
    total: dict[tuple[str, int], list[float]] = {}  # energy and samples of a channel's tile
    side = 0
    for (r, channel, _), part in likelihood.blocks.items():
        tiles = likelihood.trials[r].tiles_of(channel)
        if tiles is None:
            continue
        side = max(side, likelihood.trials[r].tiles_along_side)
        for tile in np.unique(tiles):
            there = square[part][tiles == tile]
            energy = total.setdefault((channel, int(tile)), [0.0, 0.0])
            energy[0] += float(np.sum(there))
            energy[1] += len(there)
    keys = [key for key, (_, n) in total.items() if n / correlation >= 2]
    energy, count = np.array([total[key] for key in keys]).reshape(-1, 2).T
    p_values = stats.chi2.sf(energy / correlation, count / correlation)
    limit = _benjamini_hochberg(p_values, FALSE_DISCOVERY)
    out = []
    for channel in dict.fromkeys(c for c, _ in keys):
        of_channel = sorted((tile, p) for (c, tile), p in zip(keys, p_values, strict=True) if c == channel)
        stand_out = tuple(tile for tile, p in of_channel if p <= limit)
        out.append(TileGaps(channel, side, tuple(tile for tile, _ in of_channel), stand_out))
    return tuple(out)


def timelines(
    likelihood: Likelihood,
    z: np.ndarray,
    correlation: float,
    onsets: Sequence[float | None],
    effects: np.ndarray | None = None,
) -> tuple[Timeline, ...]:
    """The heatmap's measure in windows: each joint by the channel that stands out most, for each recording.

    Above a line's threshold a window is significant by itself (Bonferroni over windows and joints).
    """
    z = _standing_out(z, effects)
    out = []
    for r, trial in enumerate(likelihood.trials):
        channel = trial.channels[0]
        elapsed = trial.elapsed(channel)
        size = max(1, round(WINDOW_S / trial.spacing(channel)))
        windows = len(elapsed) // size
        if windows < 1:
            continue

        def per_window(samples: np.ndarray, size: int = size, windows: int = windows) -> np.ndarray:
            return samples[: windows * size].reshape(windows, size).mean(axis=1)

        energy = {}
        for j, place in enumerate(trial.places):
            parts = [
                part
                for (rr, _, jj), part in likelihood.blocks.items()
                if (rr, jj) == (r, j) and part.stop - part.start == len(elapsed)
            ]
            energy[place] = np.sqrt(np.max([per_window(z[part] ** 2) for part in parts], axis=0))
        freedom = max(size / correlation, 1.0)
        chance = FALSE_DISCOVERY / (windows * len(trial.places))
        threshold = float(np.sqrt(stats.chi2.isf(chance, freedom) / freedom))
        time = per_window(elapsed)
        out.append(Timeline(trial.name, time, energy, threshold, onsets[r]))
    return tuple(out)


def _standing_out(z: np.ndarray, effects: np.ndarray | None) -> np.ndarray:
    """Whitened residuals (N,) with what named effects do beside them."""
    return z if effects is None else np.sign(z) * np.hypot(z, effects)


def _span(
    likelihood: Likelihood, z: np.ndarray, r: int, channel: str, j: int, phase: int
) -> tuple[float, float]:
    """First and last time at which a cell's windows stand out."""
    trial = likelihood.trials[r]
    square = z[likelihood.blocks[r, channel, j]] ** 2
    chosen = trial.phases(channel)[:, j] == phase
    high = (
        chosen & (square > max(4.0, 0.25 * float(np.quantile(square[chosen], 0.9))))
        if chosen.any()
        else chosen
    )
    index = np.flatnonzero(high if high.any() else chosen)
    elapsed = trial.elapsed(channel)
    if not len(index):
        return 0.0, float(elapsed[-1])
    return float(elapsed[index[0]]), float(elapsed[index[-1]])


def _benjamini_hochberg(p_values: np.ndarray, rate: float) -> float:
    """Largest p-value that is significant at a false-discovery rate; -1 if none is."""
    ordered = np.sort(p_values)
    passed = np.flatnonzero(ordered <= rate * np.arange(1, len(ordered) + 1) / max(len(ordered), 1))
    return float(ordered[passed[-1]]) if len(passed) else -1.0
