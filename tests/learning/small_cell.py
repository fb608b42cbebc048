"""The default cell with a camera of few pixels, and steps drawn at random."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import look_at
from samrl_core.learning.residual.replay import ReplayStep

SIZE = 16  # [px]
SMALL = replace(cell_named(), intrinsics=Intrinsics.from_fov(SIZE, SIZE, math.radians(42.0)))


def random_step(rng: np.random.Generator, episode: int, step: int) -> ReplayStep:
    """A step that means nothing."""
    depth = rng.uniform(0.3, 0.6, (SIZE, SIZE)).astype(np.float32)
    depth[rng.random((SIZE, SIZE)) < 0.1] = np.nan
    return ReplayStep(
        episode,
        step,
        rng.integers(0, 256, (SIZE, SIZE, 3), dtype=np.uint8),
        depth,
        look_at(np.array([0.8, 0.1, 0.3]) + rng.uniform(-0.05, 0.05, 3), np.array([0.5, 0.0, 0.05])),
        np.array([0.5, 0.0, 0.1]) + rng.uniform(-0.05, 0.05, 3),
        rng.uniform(-0.01, 0.01, 3),
        rng.uniform(-0.002, 0.002, 3),
        rng.uniform(-0.01, 0.01, 3),
    )
