"""Whether what is named is one law: of one size in every recording, and at every speed, position and load.

A wrong law that is fitted to an unknown effect must change its size to follow it: the viscosity that stands
for a quadratic drag grows with speed, the eccentricity that stands for a slipping code disc with time. Each
law is therefore given a size of its own in groups of samples, and the sizes are tested for being equal.

With Z the law's fitted prediction, one column per group, the sizes are s = (Z' S^-1 Z)^-1 Z' S^-1 y. Were the
law exact, Q = (s - m)' Z' S^-1 Z (s - m) about their weighted mean m would be a chi-square with one degree of
freedom less than groups (Cochran 1954). No formula is exact: bearings, greases and springs obey neighbours of
the textbook's law, whose sizes scatter too. The null hypothesis is that they scatter by at most a share
`FORMULA` of m. Free sizes then win at most `FORMULA`^2 of the log likelihood that the law wins by itself, and
Q is at most a noncentral chi-square (a minimum-effect test; Murphy and Myors 1999).

Geometry has no formula: there only recordings are compared, each with its own clocks and unknown transforms.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import stats

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis, hypothesis

FORMULA = 0.2  # relative scatter of a law's size that another formula of the same effect may cause
DESCRIPTION = 0.05  # the same of what a text says, which no motion changes
GEOMETRY = 0.5  # the same of errors of geometry: clocks and cameras move on between recordings
SIGNIFICANCE = 1e-3  # chance at most that a law of that scatter is contradicted, over all quantities
GROUPS = 6  # of samples along a quantity, each with as much of the law's prediction
LEAST_SEEN = 1e-6  # of the largest eigenvalue of the sizes' information: less is none
# Along which sizes are compared: in words, of `Observed.drivers`, whether its sign counts, its unit.
OVER = (
    ("speed", "velocity", False, "rad/s"),
    ("velocity", "velocity", True, "rad/s"),
    ("position", "position", True, "rad"),
    ("time", "time", True, "s"),
    ("commanded effort", "commanded effort", True, "N m"),
)


@dataclass(frozen=True, eq=False)
class Sizes:
    """Sizes of one law in groups of samples, relative to the size that was fitted to all.

    Attributes:
        over: what the groups differ in, in words.
        names: of the groups, in words.
        moment: (K,) Z' S^-1 y [nat].
        information: (K, K) Z' S^-1 Z [nat].
    """

    over: str
    names: tuple[str, ...]
    moment: np.ndarray
    information: np.ndarray

    @property
    def total(self) -> float:
        """Information on one common size."""
        return float(np.sum(self.information))

    @property
    def mean(self) -> float:
        """That size."""
        return float(np.sum(self.moment)) / max(self.total, 1e-300)

    @property
    def values(self) -> np.ndarray:
        """(K,) each group's own."""
        return self._inverse @ self.moment

    @property
    def deviations(self) -> np.ndarray:
        """(K,) standard deviations of those."""
        return np.sqrt(np.maximum(np.diag(self._inverse), 0.0))

    @property
    def _inverse(self) -> np.ndarray:
        return np.linalg.pinv(self.information, LEAST_SEEN, hermitian=True)

    def scatter(self) -> float:
        """Relative scatter of the sizes beyond that of noise: root of what they win over what m wins."""
        q, degrees = self._statistic()
        return float(np.sqrt(max(q - degrees, 0.0) / max(self.mean**2 * self.total, 1e-300)))

    def chance(self, allowed: float) -> float:
        """Chance of sizes that scatter so much if the law's own scatter is at most `allowed`."""
        q, degrees = self._statistic()
        if degrees < 1:
            return 1.0
        if q <= degrees:  # no more than noise: likelier yet where the law may scatter; SciPy overflows there
            return float(stats.chi2.sf(q, degrees))
        return float(stats.ncx2.sf(q, degrees, (allowed * self.mean) ** 2 * self.total + 1e-12))

    def _statistic(self) -> tuple[float, int]:
        """Cochran's Q and its degrees of freedom."""
        if not self.total > 0:
            return 0.0, 0
        q = float(self.moment @ self._inverse @ self.moment) - self.mean**2 * self.total
        rank = int(np.linalg.matrix_rank(self.information, LEAST_SEEN * np.trace(self.information), True))
        return max(q, 0.0), rank - 1

    def extremes(self) -> tuple[int, int]:
        """Groups with the smallest and the largest size, of those that are sure enough to be told."""
        values, sure = self.values, self.deviations
        usable = np.flatnonzero(sure <= max(2.0 * float(np.min(sure)), 0.25 * float(np.ptp(values))))
        ranked = usable[np.argsort(values[usable])]
        return int(ranked[0]), int(ranked[-1])


def invariance_alarms(whole: Likelihood, fit: Fit, correlation: float) -> list[str]:
    """Laws of a fit whose size changes too much from group to group, with where it is least and most.

    Args:
        whole: of all recordings, fitted and held out.
        fit: what was fitted.
        correlation: samples that count as one.
    """
    alarms = []
    for index, h in enumerate(fit.hypotheses):
        allowed = GEOMETRY if whole.exact else DESCRIPTION if h.effect.of_description else FORMULA
        tested = list(sizes(whole, fit, index, correlation))
        chances = [len(tested) * s.chance(allowed) for s in tested]
        if not tested or min(chances) >= SIGNIFICANCE:
            continue
        # Where several quantities deny it, the one along which the size changes most says most.
        worst = max((s for s, p in zip(tested, chances, strict=True) if p < SIGNIFICANCE), key=Sizes.scatter)
        low, high = worst.extremes()
        values = worst.values
        alarms.append(
            f"{h.name} would have {values[low]:.2f} times its fitted size {worst.names[low]}"
            f" but {values[high]:.2f} {worst.names[high]}: its formula is not what happens"
        )
    return alarms


def sizes(whole: Likelihood, fit: Fit, index: int, correlation: float) -> Iterator[Sizes]:
    """Sizes of one effect of a fit by recording, and along the quantities of its motion, the others held."""
    if whole.exact:
        yield from _by_recording_alone(whole, fit, index, correlation)
        return
    mine, rest = _split(whole, fit, index)
    if not np.any(mine):
        return
    for over, names, group in _groups(whole, fit.hypotheses[index], mine):
        yield Sizes(over, names, *whole.by_group(mine, group, len(names), rest, correlation))


def _by_recording_alone(whole: Likelihood, fit: Fit, index: int, correlation: float) -> Iterator[Sizes]:
    """Sizes in recordings whose tolerances are their own."""
    names, moments, information = [], [], []
    for trial in whole.trials:
        alone = Likelihood([trial])
        mine, rest = _split(alone, fit, index)
        weighed = (mine - alone.tolerated(mine, correlation)) / correlation
        names.append(f"in {trial.name}")
        moments.append(float(weighed @ rest))
        information.append(float(weighed @ mine))
    if len(names) > 1:
        yield Sizes("recording", tuple(names), np.array(moments), np.diag(information))


def _split(likelihood: Likelihood, fit: Fit, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Prediction (N,) of one effect of a fit, zero where it is not seen, and residuals without the others."""
    mine, rest = np.zeros(len(likelihood.y)), likelihood.y
    for i, (h, amplitudes) in enumerate(zip(fit.hypotheses, fit.amplitudes, strict=True)):
        there = hypothesis(likelihood, h.effect, h.form, h.shape)
        if there is None:
            continue
        if i == index:
            mine = likelihood.prediction(there.regressors, amplitudes)
        else:
            rest = likelihood.minus(there.regressors, amplitudes, rest)
    return mine, rest


def _groups(
    whole: Likelihood, h: Hypothesis, prediction: np.ndarray
) -> Iterator[tuple[str, tuple[str, ...], np.ndarray]]:
    """What groups differ in, their names, and the group (N,) of each sample."""
    recording = np.zeros(len(whole.y), dtype=int)
    for (r, _, _), part in whole.blocks.items():
        recording[part] = r
    if len(whole.trials) > 1:
        yield "recording", tuple(f"in {t.name}" for t in whole.trials), recording
    weight = np.abs(prediction)
    for over, driver, signed, unit in OVER:
        values = _values(whole, h, driver, weight)
        if values is None:
            continue
        values = values if signed else np.abs(values)
        order = np.argsort(values, kind="stable")
        passed = np.cumsum(weight[order])
        group = np.empty(len(values), dtype=int)
        group[order] = np.minimum((passed / passed[-1] * GROUPS).astype(int), GROUPS - 1)
        spans = (_span(over, values[(group == k) & (weight > 0)], unit) for k in range(GROUPS))
        yield over, tuple(spans), group


def _values(whole: Likelihood, h: Hypothesis, driver: str, weight: np.ndarray) -> np.ndarray | None:
    """A quantity (N,) of the effect's own joint, or each residual's own; zero without weight."""
    out = np.zeros(len(whole.y))
    joints = h.form.place.joints
    for (r, channel, row), part in whole.blocks.items():
        if not np.any(weight[part]):
            continue
        found = whole.trials[r].drivers(channel, joints[0] if len(joints) == 1 else row).get(driver)
        if found is None:
            return None
        out[part] = found
    return out


def _span(over: str, values: np.ndarray, unit: str) -> str:
    """Where a group lies, without its outermost samples; one sample may fill several groups."""
    if not len(values):
        return f"at no {over}"
    low, high = np.quantile(values, [0.05, 0.95])
    return f"at a {over} of {low:.3g} to {high:.3g} {unit}"
