"""All candidates side by side: the normal equations of the joint linear fit, without the whole matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.blind_test.baselines.candidates import Candidate, picked, whitened_columns
from samrl_core.blind_test.baselines.samples import EquationSamples

NOISE = 0.004  # of the effort limit: residual that counts as nominal (default tolerance of a torque offset)
CORRELATED = 50  # samples (1 s) that count as one; ASSUMPTION, measured on a real Panda: up to .8 at 0.2 s
RIDGE = (
    CORRELATED * NOISE**2
)  # with parameters in units of their ranges: a Gaussian prior as wide as the range


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Gram matrix (P, P), right side (P,) and energy of the target; parameters in units of their ranges."""

    gram: np.ndarray
    right: np.ndarray
    energy: float
    owner: np.ndarray  # (P,) index of the candidate

    def solve(self, active: np.ndarray) -> np.ndarray:
        """(P,) coefficients, zero where not active (P,) bool."""
        theta = np.zeros(len(self.right))
        if active.any():
            gram = self.gram[np.ix_(active, active)]
            gram = gram + RIDGE * np.eye(len(gram))
            theta[active] = np.linalg.solve(gram, self.right[active])
        return theta

    def loss(self, theta: np.ndarray) -> float:
        """Sum of squares of what is left."""
        return float(self.energy - 2 * self.right @ theta + theta @ self.gram @ theta)


def normal_equations(
    s: EquationSamples, library: Sequence[Candidate], residual: np.ndarray, rows: np.ndarray
) -> NormalEquations:
    """Of the samples where `rows` (N,) is true; `residual` (N, 3, J) as from `whitened`."""
    blocks = [whitened_columns(s, c)[rows] * c.ranges for c in library]
    owner = np.concatenate([np.full(b.shape[2], k) for k, b in enumerate(blocks)])
    starts = np.cumsum([0, *[b.shape[2] for b in blocks]])
    gram, right = np.zeros((len(owner), len(owner))), np.zeros(len(owner))
    at_row: dict[tuple[int, int], list[tuple[int, np.ndarray]]] = {}
    for k, (c, block) in enumerate(zip(library, blocks, strict=True)):
        right[starts[k] : starts[k + 1]] = np.einsum("nbk,nb->k", block, picked(residual, c)[rows])
        for b, row in enumerate(c.rows):
            at_row.setdefault(row, []).append((k, block[:, b]))
    for parts in at_row.values():  # only what acts on the same residual of the same joint meets
        index = np.concatenate([np.arange(starts[k], starts[k + 1]) for k, _ in parts])
        stacked = np.concatenate([columns for _, columns in parts], axis=1)
        gram[np.ix_(index, index)] += stacked.T @ stacked
    return NormalEquations(gram, right, float(np.sum(residual[rows] ** 2)), owner)
