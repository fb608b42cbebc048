"""What the servo worlds are asked to do: slow sweeps, a multisine, and moves with rests."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.servo_worlds.drives import FASTEST_HZ
from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism

LETTERS = ("A", "B", "C")  # slow, multisine, task-like; C is held out


def motion(letter: str, mechanism: Mechanism, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Positions (N, n) that begin at rest at zero."""
    return np.stack([_axis(letter, reach, time, rng) for reach in mechanism.reach], axis=1)


def _axis(letter: str, reach: float, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    rise = np.clip(time / 1.5, 0.0, 1.0)
    smooth = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    if letter == "C":
        return _moves(reach, time, rng)
    if letter == "A":
        hertz = np.array([0.06, 0.11, 0.19]) * rng.uniform(0.85, 1.15, size=3)
        sizes = np.array([1.0, 0.6, 0.35])
    else:
        hertz = np.array([0.13, 0.31, 0.53, 0.83, FASTEST_HZ]) * rng.uniform(0.9, 1.0, size=5)
        sizes = np.array([1.0, 0.7, 0.45, 0.25, 0.15])
    phases = rng.uniform(-math.pi, math.pi, size=len(hertz))
    waves = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in zip(sizes, hertz, phases, strict=True))
    wave = np.asarray(waves)
    return 0.8 * reach * smooth * wave / float(np.abs(wave).max())


def _moves(reach: float, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Fifth-order moves from point to point, with rests."""
    out, at, t = np.zeros(len(time)), 0.0, 0.3
    while t < time[-1]:
        there = float(rng.uniform(-0.9, 0.9)) * reach
        long = max(0.5, 2.5 * abs(there - at) / reach * rng.uniform(0.5, 0.9))
        s = np.clip((time - t) / long, 0.0, 1.0)
        out += (there - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        at, t = there, t + long + float(rng.uniform(0.1, 0.6))
    return out
