"""The numbers by which effects are selected."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class SelectionSettings:
    """When an effect is believed. Values come from `samrl_core.blind_test.scores.calibrate`."""

    threshold: float = 12.0  # log evidence that a first effect needs at least against nothing [nat]
    chance: float = 0.0  # of a false name where all is within tolerance; 0: `threshold` decides
    null_simulations: int = 0  # as many without an effect, whose evidence may raise the threshold
    cache: Path | None = None  # folder that caches their log evidence
    wide_threshold: float = 9.0  # that it needs if tolerances were stated `WIDE` times too narrow
    second_threshold: float = 16.0  # that each further effect needs on top
    held_out_share: float = 0.05  # of the remaining held-out excess that a further effect must remove
    local_share: float = 0.4  # of what is left where it acts, likewise, on fitted recordings
    onset_remainder: float = 0.05  # share left by the best effect from which on it may have been switched on
    throughout_share: float = 0.8  # of what a further effect wins by beginning, won at most without that
    same_share: float = 0.12  # of all there was, where the first effects act on the same channels and joints
    simulate: bool = True  # candidates within reach of the best are weighed by the simulated motion too
    local_remainder: float = 0.2  # less left than this share of what there was: the first effect's formula
