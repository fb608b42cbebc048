"""Where a search of shapes begins: at borders of what is possible, and far from the grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.diagnosis.effects.friction.stribeck_friction import EFFECT as STRIBECK
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood, Regressors
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis, hypothesis
from samrl_core.diagnosis.selection.search import REFINED, best_singles
from tests.diagnosis.controllers.kinds import VELOCITY_DRIVE
from tests.diagnosis.controllers.machines import Differs, worlds

FALL = {"v": 0.01, "vs": 0.6, "d": 1.0}


@pytest.mark.parametrize(("level", "possible"), [(0.2, True), (-0.4, False)])
def test_a_level_that_may_not_be_negative_is_zero_at_best(level: float, possible: bool) -> None:
    (recordings,) = worlds(VELOCITY_DRIVE, [Differs()], 3, 2.0)
    trial = arm_trials(recordings[:1], [])[0][0]
    (place,) = STRIBECK.places(trial)
    form, size = STRIBECK.forms(trial, place)[0], 0.02 * float(trial.scale[0])
    for (channel, joint), rows in form.columns(trial, FALL).items():
        trial.equations.residual[channel][:, joint] = np.array([level * size, size]) @ rows
    evidence = Evidence(Likelihood([trial]), 2.0)
    h = hypothesis(evidence.likelihood, STRIBECK, form, FALL)
    assert h is not None
    found = evidence.fit([h], at_borders=True)
    assert bool(np.isfinite(evidence.fit([h]).log_evidence)) is possible
    assert found.amplitudes[0][1] > 0.5 * size and np.isfinite(found.log_evidence)
    if possible:
        assert found.amplitudes[0][0] > 0.1 * size
        return
    assert found.amplitudes[0][0] == pytest.approx(0.0, abs=1e-9 * size)
    # The drop is the one that a law without a level has, and no other level above zero explains as much.
    alone = evidence.fit([replace(h, spread=np.array([1e-9, 1.0]) * h.spread)])
    assert found.amplitudes[0][1] == pytest.approx(alone.amplitudes[0][1], rel=1e-6)
    raised = evidence.fit([replace(h, mean=np.array([0.1 * size, 0.0]), spread=alone.hypotheses[0].spread)])
    assert raised.log_evidence < alone.log_evidence


def stand_in(family: str) -> Hypothesis:
    effect = SimpleNamespace(family=family, parameters=(), renamed_shapes=())
    form = SimpleNamespace(name="", place=SimpleNamespace(name="joint:a"), refine={})
    nothing = np.zeros(0)
    regressors = Regressors({}, np.zeros((0, 0)))
    return Hypothesis(cast(Any, effect), cast(Any, form), {}, regressors, nothing, nothing, nothing, nothing)


class FarFromTheGrid:
    """Evidence of families in the order of their names; the last one's shapes are far from the grid."""

    def fit(self, hypotheses: Sequence[Hypothesis], at_borders: bool = False) -> Fit:
        """What a family is worth on the grid."""
        (h,) = hypotheses
        worth = 1000.0 if h.shape else 100.0 - int(h.effect.family)
        return Fit((h,), (np.zeros(0),), np.zeros((0, 0)), worth)

    def refine(self, fit: Fit, index: int, evaluations: int = 30, at_borders: bool = False) -> Fit:
        """What it is worth once its shapes are searched."""
        h = fit.hypotheses[index]
        last = int(h.effect.family) == 2 * REFINED
        return self.fit([replace(h, shape={"found": 1.0})]) if last else fit


def test_every_family_has_its_shapes_searched_however_it_stands_on_the_grid() -> None:
    pool = [stand_in(str(k)) for k in range(2 * REFINED + 1)]
    found = best_singles(cast(Evidence, FarFromTheGrid()), pool)
    assert [f.hypotheses[0].effect.family for f in found[:2]] == [str(2 * REFINED), "0"]
