"""Where flights and slides begin and end: a hand, a stroke and a stop belong to neither."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.body_recording import BodyModel, BodyRecording, BodyTrack, Support
from samrl_core.diagnosis.residuals.bodies.find_segments import find_segments
from samrl_core.diagnosis.residuals.bodies.phase_search import NEITHER, find_phases
from tests.diagnosis.bodies.body_worlds import G

INCLINE = np.radians(4.0)
ROLLING = G * np.sin(INCLINE) / 1.5  # [m/s^2] of a solid cylinder
NOISE = 7e-4  # [m]
STEADY_S = 0.4  # before it is struck


def struck(seed: int, rate: float, speed: float, stop: float = np.inf) -> BodyRecording:
    """A cylinder that stands on a slope (x leads down), is struck up it and may be stopped dead."""
    time = np.arange(0.0, 2.6, 1.0 / rate)
    free = np.clip(time - STEADY_S, 0.0, stop)
    noise = NOISE * np.random.default_rng(seed).normal(size=len(time))
    x = 1.5 - speed * free + 0.5 * ROLLING * free**2 + noise
    position = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    return BodyRecording(
        "run", "made by a test", "0" * 64, BodyTrack(time, position, "x", np.zeros((0, 4)), ""),
        BodyModel("cylinder", "cylinder", (0.02, 0.1)), Support(friction=0.0, rolls=True),
        (G * np.sin(INCLINE), 0.0, -G * np.cos(INCLINE)),
    )  # fmt: skip


@pytest.mark.parametrize("rate", [30.0, 100.0])
@pytest.mark.parametrize("speed", [0.3, 0.9])
def test_a_slide_begins_where_nothing_strikes_it_any_more(rate: float, speed: float) -> None:
    """Speeds over some frames called standing rows a slide, on a slope for good: it had no cause."""
    for seed in range(4):
        for segment in find_segments(struck(seed, rate, speed)).segments:
            assert segment.time[0] > STEADY_S - 1e-9
            law = np.linalg.pinv(np.vander(segment.time - segment.time[0], 3))[0]
            off = 2.0 * float(law @ segment.position[:, 0]) - ROLLING
            assert abs(off) < 4.0 * 2.0 * NOISE * float(np.linalg.norm(law))


def test_a_slide_ends_where_something_stops_it() -> None:
    for seed in range(4):
        first, *more = find_segments(struck(seed, 30.0, 0.9, stop=0.8)).segments
        assert not more and first.time[-1] <= STEADY_S + 0.8 + 1e-9 and len(first) > 15


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
