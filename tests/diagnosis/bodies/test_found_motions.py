"""Where flights and slides begin and end: a hand, a stroke and a stop belong to neither."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.bodies.phase_search import NEITHER, find_phases
from tests.diagnosis.bodies.body_worlds import G


def test_a_hand_is_one_piece_whatever_it_looked_like() -> None:
    """A bit of it that looked like a flight split a hand in two, both too short for a hand."""
    time = np.arange(0.0, 1.2, 1.0 / 180.0)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        lasts, speed = rng.uniform(0.3, 0.5), rng.uniform(2.0, 3.0)
        part, free = np.clip(time / lasts, 0.0, 1.0), np.clip(time - lasts, 0.0, None)
        height = 0.4 * speed * lasts * (part**3 - 0.5 * part**4) + speed * free - G / 2 * free**2
        height += 5e-4 * rng.normal(size=len(time))
        kinds = [p.kind for p in find_phases(time, height, G)]
        assert NEITHER in kinds and not any(a == b == NEITHER for a, b in zip(kinds, kinds[1:], strict=False))
