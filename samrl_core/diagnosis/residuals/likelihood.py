"""Gaussian likelihood of the stacked residuals: noise on the diagonal, tolerances as a low-rank part.

Sigma = D^2 + U U^T, with D the noise and U the tolerance regressors times their standard deviations. All
inner products are taken in Sigma^-1, which costs one thin projection per regressor.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.tolerances import recording_columns, tolerance_columns

Block = tuple[int, str, int]  # recording, channel, row


@dataclass(frozen=True, eq=False)
class Regressors:
    """Columns in units of the noise, by block, and their projection on the tolerances."""

    blocks: dict[Block, np.ndarray]  # (p, n)
    projected: np.ndarray  # (rank, p)

    @property
    def empty(self) -> bool:
        """Nothing is observed of it."""
        return not self.blocks


class Likelihood:
    """Of one or more recordings of one system.

    Attributes:
        y: (N,) residuals in units of their noise.
        blocks: slices of `y`.
    """

    def __init__(self, trials: Sequence[Observed], widened: float = 1.0) -> None:
        """Stack the residuals and factor the tolerances, `widened` times as stated."""
        self.trials = tuple(trials)
        self._widened = widened
        self.blocks: dict[Block, slice] = {}
        parts, start = [], 0
        for r, trial in enumerate(self.trials):
            for channel in trial.channels:
                ratio = trial.residual[channel] / trial.sigma[channel]
                for j, column in enumerate(ratio.T if len(ratio) else ()):
                    self.blocks[r, channel, j] = slice(start, start + len(column))
                    parts.append(self._whitened(r, channel, j, column))
                    start += len(column)
        self.y = np.concatenate(parts) if parts else np.zeros(0)
        self._basis, self._strength, self._directions = self._factor()
        self._y_projected = self._basis.T @ self.y

    def _factor(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Orthonormal basis (N, k) of U / D, its squared singular values (k,), right singular vectors."""
        lists = [tolerance_columns(trial, self._widened) for trial in self.trials]
        count = len(lists[0]) if lists else 0
        own = [recording_columns(trial) for trial in self.trials]
        starts = count + np.concatenate([[0], np.cumsum([len(items) for items in own])]).astype(int)
        total = int(starts[-1])
        # A link loads the joints before it, friction its own joint, and a recording's columns that recording:
        # block by block most columns are zero, and whatever is not passes its filter at once.
        parts: dict[Block, tuple[list[int], list[np.ndarray]]] = {}
        for r, trial in enumerate(self.trials):
            for k, (columns, std) in [*enumerate(lists[r]), *enumerate(own[r], int(starts[r]))]:
                for (channel, j), rows in columns.items():
                    scaled = std * rows[0] / trial.sigma[channel][:, j]
                    if scaled.any():
                        which, seen = parts.setdefault((r, channel, j), ([], []))
                        which.append(k)
                        seen.append(scaled)
        gram = np.zeros((total, total))
        blocks = {}
        for block, (which, seen) in parts.items():
            u = self._whitened(*block, np.stack(seen))  # (columns here, samples)
            gram[np.ix_(which, which)] += u @ u.T
            blocks[block] = which, u
        values, vectors = np.linalg.eigh(gram)
        kept = values > 1e-9 * max(values.max(initial=0.0), 1e-300)
        values, vectors = values[kept], vectors[:, kept]
        basis = np.zeros((len(self.y), len(values)))
        for block, (which, u) in blocks.items():
            basis[self.blocks[block]] = u.T @ (vectors[which] / np.sqrt(values))
        return basis, values, vectors

    @property
    def exact(self) -> bool:
        """Whether effects are geometry rather than formulas (`Observed.exact`)."""
        return bool(self.trials) and all(t.exact for t in self.trials)

    def regressors(self, columns: Sequence[Columns]) -> Regressors:
        """Columns of an effect, one mapping per recording, in units of the noise."""
        blocks: dict[Block, np.ndarray] = {}
        projected: np.ndarray | None = None
        for r, (trial, mapping) in enumerate(zip(self.trials, columns, strict=True)):
            for (channel, j), rows in mapping.items():
                scaled = self._whitened(r, channel, j, rows / trial.sigma[channel][:, j])
                blocks[r, channel, j] = scaled
                part = self._basis[self.blocks[r, channel, j]].T @ scaled.T
                projected = part if projected is None else projected + part
        return Regressors(blocks, np.zeros((len(self._strength), 0)) if projected is None else projected)

    def _whitened(self, r: int, channel: str, j: int, rows: np.ndarray) -> np.ndarray:
        """Rows (..., n) in units of the noise, white within the band."""
        color = self.trials[r].color.get(channel)
        return rows if color is None else color.whitened(rows, j)

    def uncolored(self, block: Block, y: np.ndarray) -> np.ndarray:
        """Part (n,) of residuals (N,) in units of the noise as they were before the noise was made white."""
        r, channel, j = block
        color = self.trials[r].color.get(channel)
        return y[self.blocks[block]] if color is None else color.colored(y[self.blocks[block]], j)

    def shrink(self, correlation: float) -> np.ndarray:
        """Weight (k,) that tolerances take off a projection, when `correlation` samples count as one."""
        return self._strength / (correlation + self._strength)

    def plain_gram(self, a: Regressors, b: Regressors) -> np.ndarray:
        """A^T D^-2 B, (p, q), without tolerances."""
        out = np.zeros((a.projected.shape[1], b.projected.shape[1]))
        for block, rows in a.blocks.items():
            if block in b.blocks:
                out += rows @ b.blocks[block].T
        return out

    def plain_moment(self, a: Regressors) -> np.ndarray:
        """A^T D^-2 y, (p,), without tolerances."""
        out = np.zeros(a.projected.shape[1])
        for block, rows in a.blocks.items():
            out += rows @ self.y[self.blocks[block]]
        return out

    def combined(self, a: Regressors, amplitudes: np.ndarray) -> Regressors:
        """The prediction of fitted amplitudes as one regressor."""
        blocks = {block: (amplitudes @ rows)[None] for block, rows in a.blocks.items()}
        return Regressors(blocks, (a.projected @ amplitudes)[:, None])

    def prediction(self, a: Regressors, amplitudes: np.ndarray) -> np.ndarray:
        """The same stacked (N,)."""
        return -self.minus(a, amplitudes, np.zeros_like(self.y))

    def tempered_gram(self, a: Regressors, b: Regressors, correlation: float) -> np.ndarray:
        """A^T Sigma^-1 B (p, q), with `correlation` samples counted as one."""
        shrink = self.shrink(correlation)
        return (self.plain_gram(a, b) - a.projected.T @ (shrink[:, None] * b.projected)) / correlation

    @property
    def y_projected(self) -> np.ndarray:
        """Residuals on the tolerances' basis (k,)."""
        return self._y_projected

    def deficit(self, y: np.ndarray, correlation: float, only: Collection[Block] | None = None) -> float:
        """Log likelihood [nat] that a perfect explanation of residuals (N,) would win back.

        Two parts: energy outside of the tolerances beyond one per sample, block by block so that quiet
        blocks hide nothing, over the samples' correlation; and energy within them beyond one per tolerance.
        `only` restricts it to some blocks.
        """
        if only is not None:
            masked = np.zeros_like(y)
            for block in only:
                masked[self.blocks[block]] = y[self.blocks[block]]
            y = masked
        projected = self._basis.T @ y
        outside = (y - self._basis @ projected) ** 2
        parts = list(self.blocks.values()) if only is None else [self.blocks[block] for block in only]
        sizes = [b.stop - b.start for b in parts]
        unsure = 1.0 + max((t.unsure for t in self.trials), default=0.0)
        noise = sum(
            max(0.0, float(np.sum(outside[b])) - unsure * n) for b, n in zip(parts, sizes, strict=True)
        )
        if self.trials and all(t.short for t in self.trials):
            # The positive part of a chi-square's deviation from its n degrees has the mean sqrt(n / pi), and
            # more by the root of how many samples count as one.
            noise = max(0.0, noise - sum(np.sqrt(n * correlation / np.pi) for n in sizes))
        inside = projected**2 / (correlation + self._strength) - 1.0
        strong = self._strength > correlation  # the others say nothing about tolerances
        return 0.5 * noise / correlation + 0.5 * max(0.0, float(np.sum(inside[strong])))

    def whitened(self, y: np.ndarray | None = None) -> np.ndarray:
        """Sigma^-1/2 y (N,): what tolerances do not explain, in standard deviations."""
        y = self.y if y is None else y
        root = 1.0 - np.sqrt(1.0 - self.shrink(1.0))
        return y - self._basis @ (root * (self._basis.T @ y))

    def tolerated(self, y: np.ndarray, correlation: float) -> np.ndarray:
        """The part (N,) of residuals that tolerances most probably cause."""
        return self._basis @ (self.shrink(correlation) * (self._basis.T @ y))

    def by_group(
        self, x: np.ndarray, group: np.ndarray, count: int, y: np.ndarray, correlation: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """What residuals say of a prediction that has a size of its own in each group of samples.

        Args:
            x: (N,) prediction of size one.
            group: (N,) group of each sample, below `count`.
            count: G, groups.
            y: (N,) residuals.
            correlation: samples that count as one.

        Returns:
            Z' S^-1 y (G,) and Z' S^-1 Z (G, G) [nat]; a column of Z is `x` within its group, zero elsewhere.
        """
        power, moment = np.bincount(group, x**2, count), np.bincount(group, x * y, count)
        seen = np.flatnonzero(x)
        inside = np.zeros((count, self._basis.shape[1]))
        for k in np.unique(group[seen]):
            rows = seen[group[seen] == k]
            inside[k] = x[rows] @ self._basis[rows]
        weighed = inside * self.shrink(correlation)
        return (
            (moment - weighed @ (self._basis.T @ y)) / correlation,
            (np.diag(power) - weighed @ inside.T) / correlation,
        )

    def tolerance_sizes(self, y: np.ndarray, correlation: float) -> np.ndarray:
        """What each tolerance most probably is (columns,), in standard deviations, given residuals (N,)."""
        return self.find_tolerance_sizes(self._basis.T @ y, correlation)

    def find_tolerance_sizes(self, projected: np.ndarray, correlation: float) -> np.ndarray:
        """The same (columns, ...) of what has a projection (k, ...) on the tolerances' basis."""
        weight = np.sqrt(self._strength) / (correlation + self._strength)
        return (self._directions * weight) @ projected

    def tolerance_covariance(self, correlation: float) -> np.ndarray:
        """Covariance (columns, columns) of the tolerances' sizes given the data, all else held [1]."""
        unknown = np.eye(len(self._directions))
        return unknown - (self._directions * self.shrink(correlation)) @ self._directions.T

    def tolerance_gram(self) -> np.ndarray:
        """U^T U (columns, columns) of what tolerances make per standard deviation, in units of the noise."""
        return (self._directions * self._strength) @ self._directions.T

    def tolerance_moment(self, projected: np.ndarray) -> np.ndarray:
        """U^T x (columns, ...) of what has a projection (k, ...) on the tolerances' basis."""
        return (self._directions * np.sqrt(self._strength)) @ projected

    def of_tolerances(self, sizes: np.ndarray) -> np.ndarray:
        """Residuals (N,) that tolerances of such sizes (columns,) make in these recordings."""
        return self._basis @ (np.sqrt(self._strength) * (self._directions.T @ sizes))

    def minus(self, a: Regressors, amplitudes: np.ndarray, y: np.ndarray | None = None) -> np.ndarray:
        """Residuals (N,) after taking an effect out."""
        out = (self.y if y is None else y).copy()
        for block, rows in a.blocks.items():
            out[self.blocks[block]] -= amplitudes @ rows
        return out

    def correlation_time(self, y: np.ndarray) -> float:
        """How many samples count as one: integrated autocorrelation of the whitened residual, at least 1."""
        z = self.whitened(y)
        total, weight = 0.0, 0.0
        for part in self.blocks.values():
            x = z[part] - np.mean(z[part])
            power = float(x @ x)
            if power < 1e-12 or len(x) < 20:
                continue
            spectrum = np.fft.rfft(x, 2 * len(x))
            rho = np.fft.irfft(np.abs(spectrum) ** 2)[: len(x) // 4] / power
            below = np.flatnonzero(rho < 0.05)
            last = int(below[0]) if len(below) else len(rho)
            total += power * (1.0 + 2.0 * float(np.sum(rho[1:last])))
            weight += power
        return max(1.0, total / weight) if weight else 1.0
