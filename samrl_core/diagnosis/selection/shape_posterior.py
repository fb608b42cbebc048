"""The posterior of one effect's shapes with its amplitudes: what intervals and samples are drawn from.

Shapes are searched, and amplitudes solved at each of them. Along each shape the likelihood is followed from
its optimum until it has fallen for good, with the amplitudes solved anew at every step: an order that is off
by a little moves the phase by much, and over a short travel a long wave fits as well as a short one, with
another size. Evidence would not do: it also weighs how large amplitudes were expected to be, and where the
likelihood is flat that alone would say which shape it is.

Between the steps the root of the fall is linear in the shape's logarithm, exact where it is a Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.diagnosis.effects.form import Shape
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis

FIRST_STEP = 0.02  # of a shape's logarithm; each further one is twice as long
LONGEST = 2.6  # a factor of 13 either way
FALLEN = 4.5  # [nat] three standard deviations
NEAR_THE_END = 0.1  # of what is possible, in the shape's logarithm
NARROWEST = 0.002  # standard deviation of a shape's logarithm
POINTS = 400  # of the density that shapes are drawn from


@dataclass(frozen=True, eq=False)
class Profile:
    """The likelihood along one shape, the others held.

    Attributes:
        name: of the shape.
        changes: (K,) of its logarithm, ascending, zero among them.
        falls: (K,) [nat] of the likelihood from its optimum, amplitudes solved anew.
        amplitudes: (K, p) of the member.
        covariances: (K, p, p) of those.
    """

    name: str
    changes: np.ndarray
    falls: np.ndarray
    amplitudes: np.ndarray
    covariances: np.ndarray

    def fall(self, change: np.ndarray) -> np.ndarray:
        """Fall [nat] at changes of the logarithm."""
        roots = np.sign(self.changes) * np.sqrt(self.falls)
        return np.interp(change, self.changes, roots) ** 2

    def sample(self, rng: np.random.Generator) -> float:
        """A change of the logarithm, as probable as the likelihood says."""
        grid = np.linspace(self.changes[0], self.changes[-1], POINTS)
        passed = np.cumsum(np.exp(-self.fall(grid)))
        return float(np.interp(rng.uniform(0.0, passed[-1]), passed, grid))

    def follow(self, change: float) -> np.ndarray:
        """By how much the amplitudes (p,) follow a change of the logarithm."""
        here = self.amplitudes[int(np.flatnonzero(self.changes == 0.0)[0])]
        there = [np.interp(change, self.changes, column) for column in self.amplitudes.T]
        return np.array(there) - here


@dataclass(frozen=True, eq=False)
class ShapePosterior:
    """Of one member of a fitted set."""

    fit: Fit
    index: int
    profiles: tuple[Profile, ...]

    def vary(self, rng: np.random.Generator, formula: float) -> tuple[Shape, np.ndarray, np.ndarray]:
        """One sample's shapes, by how much amplitudes (p,) follow, and the root (p, p) of their covariance.

        Another formula of the effect would move shapes by a share `formula`.
        """
        h = self.fit.hypotheses[self.index]
        *_, covariance = list(self.fit.parts())[self.index]
        shape, follow, most = dict(h.shape), np.zeros(len(covariance)), 0.0
        for profile in self.profiles:
            change = profile.sample(rng)
            follow = follow + profile.follow(change)
            if (fallen := float(profile.fall(np.array(change)))) > most:
                most = fallen
                covariance = profile.covariances[int(np.argmin(np.abs(profile.changes - change)))]
            beyond = formula * min(1.0, h.form.step / 0.35) * rng.standard_normal()
            shape[profile.name] = float(h.shape[profile.name] * np.exp(change + beyond))
        return shape, follow, root_of(covariance)

    def sample(self, rng: np.random.Generator, formula: float) -> tuple[Shape, np.ndarray]:
        """Shapes and amplitudes (p,) of one sample; another formula moves both by a share `formula`."""
        shape, follow, root = self.vary(rng, formula)
        mean = self.fit.amplitudes[self.index]
        amplitudes = mean + follow + root @ rng.standard_normal(len(mean))
        return shape, amplitudes * (1.0 + formula * rng.standard_normal())


def root_of(covariance: np.ndarray) -> np.ndarray:
    """Lower root (p, p) of a covariance that may be singular."""
    floor = 1e-12 * np.diag(np.diag(covariance)) + 1e-300 * np.eye(len(covariance))
    return np.linalg.cholesky(covariance + floor)


def shape_posterior(evidence: Evidence, fit: Fit, index: int) -> ShapePosterior:
    """Posterior of one member of a set at its optimum."""
    h = fit.hypotheses[index]
    names = [name for name in h.form.refine if name in h.shape]
    return ShapePosterior(fit, index, tuple(_profile(evidence, fit, index, name) for name in names))


def _profile(evidence: Evidence, fit: Fit, index: int, name: str) -> Profile:
    h = fit.hypotheses[index]
    best, scale = _likelihood(fit), min(1.0, h.form.step / 0.35)
    found = [(0.0, 0.0, fit)]
    for sign in (-1.0, 1.0):
        reached, step, end = 0.0, FIRST_STEP * scale, np.inf
        while step <= LONGEST * scale:
            shape = {**h.shape, name: h.shape[name] * float(np.exp(sign * step))}
            moved = _at(evidence, fit, index, shape)
            if moved is None:
                end = step
            else:
                fall = max(best - _likelihood(moved), 0.0)
                found.append((sign * step, fall, moved))
                if fall > FALLEN:
                    break
                reached = step
            if np.isinf(end):
                step *= 2.0
            elif reached > 0.0 and end - reached > NEAR_THE_END * end:
                step = 0.5 * (reached + end)  # a step of twice the length may have jumped over much
            else:
                break
    found.sort(key=lambda item: item[0])
    changes, falls = (np.array([item[k] for item in found]) for k in range(2))
    # No formula pins a shape to the last digit.
    falls = np.minimum(falls, 0.5 * (changes / NARROWEST) ** 2)
    members = [list(f.parts())[index] for *_, f in found]
    return Profile(
        name, changes, falls, np.stack([a for _, a, _ in members]), np.stack([c for *_, c in members])
    )


def _likelihood(fit: Fit) -> float:
    """Log likelihood [nat] against no effect at the most probable amplitudes: no volume of theirs in it."""
    spread = np.concatenate([h.spread for h in fit.hypotheses])
    _, volume = np.linalg.slogdet(fit.covariance / np.outer(spread, spread))
    return fit.log_evidence - 0.5 * float(volume)


def _at(evidence: Evidence, fit: Fit, index: int, shape: Shape) -> Fit | None:
    """The set with one member's shape moved; None where nothing is seen of it or it is impossible."""
    start = fit.hypotheses[index]
    moved = hypothesis(evidence.likelihood, start.effect, start.form, shape)
    if moved is None:
        return None
    others = list(fit.hypotheses)
    others[index] = replace(moved, tried=start.tried)
    found = evidence.fit(others)
    return found if np.isfinite(found.log_evidence) else None
