"""A drive's recording, twice, whose residual is a sum of two known columns."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood, Regressors
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Hypothesis, hypothesis
from samrl_core.diagnosis.verdict.judge import Judge
from samrl_core.diagnosis.verdict.rules import VerdictSettings
from tests.diagnosis.controllers.kinds import VELOCITY_DRIVE
from tests.diagnosis.controllers.machines import Differs, worlds

SIZE = 400.0  # of an effect, in deviations of the noise over all samples


def stand_in(family: str, shape: dict[str, float] | None = None, form: str = "") -> Hypothesis:
    """A family of one amplitude; its hidden shape `s` is searched between 1 and 10."""
    effect = SimpleNamespace(
        family=family, parameters=(), renamed_shapes=(), contains=(), prior_cost=0.0, by_chance=False,
        at_every_joint=False,
    )  # fmt: skip
    made = SimpleNamespace(
        name=form,
        place=SimpleNamespace(name="joint:a"),
        refine={"s": (1.0, 10.0)},
        may_vanish=(),
        prior=lambda *_: (np.zeros(1), np.ones(1)),
        cost=lambda *_: 0.0,
        is_admissible=lambda *_: True,
    )
    nothing = np.zeros(0)
    empty = Regressors({}, np.zeros((0, 0)))
    return Hypothesis(
        cast(Any, effect), cast(Any, made), shape or {}, empty, nothing, nothing, nothing, nothing
    )


@cache
def recorded() -> list[ArmRecording]:
    """Three recordings of 2 s of a drive that is as it is described; simulated once, trials are made anew."""
    (recordings,) = worlds(VELOCITY_DRIVE, [Differs()], 3, 2.0)
    return recordings


class Bench:
    """A drive's recording, twice, whose residual is a sum of two known columns that are alike to a third."""

    def __init__(self, first: float, second: float) -> None:
        """Sizes of both, relative to `SIZE`."""
        self.fitted, self.unseen = arm_trials(recorded()[:2], [])[0]
        self.rng = np.random.default_rng(1)
        one, other = self.white(self.fitted), self.white(self.fitted)
        self.columns = (one, one + 0.25 * other)
        self.set_residual(self.fitted, first * self.columns[0] + second * self.columns[1])
        self.evidence = Evidence(Likelihood([self.fitted]), 2.0)
        self.first = self.made("first", self.columns[0])
        self.second = self.made("second", self.columns[1])

    def made(self, family: str, column: np.ndarray, unseen: np.ndarray | None = None) -> Hypothesis:
        """A family whose column (N,) is this one, and another in the recording that is not fitted."""
        bare = stand_in(family)
        there = {id(self.fitted): column, id(self.unseen): column if unseen is None else unseen}
        bare.form.__dict__["columns"] = lambda trial, shape: {("dynamics", 0): there[id(trial)][None]}
        made = hypothesis(self.evidence.likelihood, bare.effect, bare.form, {})
        assert made is not None
        return made

    def held_out(self, like_first: float, second: float) -> Likelihood:
        """The other recording: what it holds of the first column, and the size of the second there."""
        base = self.white(self.unseen)
        self.set_residual(self.unseen, like_first * base)
        self.first = self.made("first", self.columns[0], base)
        self.second = self.made("second", self.columns[1], second * base)
        return Likelihood([self.unseen])

    def white(self, trial: Trial) -> np.ndarray:
        """A column (N,) of white noise, `SIZE` deviations of the noise long."""
        sigma = trial.sigma["dynamics"][:, 0]
        column = self.rng.normal(size=len(sigma)) * sigma
        return SIZE * column / np.linalg.norm(column / sigma)

    def set_residual(self, trial: Trial, residual: np.ndarray) -> None:
        """Let a recording hold this residual (N,) [N m] and nothing else."""
        trial.equations.residual["dynamics"][:, 0] = residual


def judge_without_recordings() -> Judge:
    """A judge whose verdicts a test states: it has no likelihood to read."""
    empty = cast("Likelihood", None)
    return Judge(empty, empty, VerdictSettings(), False, 0, lambda _: None)
