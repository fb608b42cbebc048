"""A further effect that was switched on within the recordings, and a simulation that knows when."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit, Hypothesis
from samrl_core.diagnosis.selection.resimulation import over_time, resimulate
from samrl_core.diagnosis.selection.selection import _grow
from samrl_core.diagnosis.selection.settings import SelectionSettings
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis.selection.bench import Bench, recorded

BEGAN = 0.75  # of a recording


@pytest.mark.parametrize(
    ("changes", "before", "begins"),
    [(0.0, 0.0, 0.0), (BEGAN, 0.0, BEGAN), (0.15, 0.3, 0.0)],
    ids=["there all along", "later", "weaker at first"],
)
def test_a_further_effect_may_begin_within_the_recordings(
    changes: float, before: float, begins: float
) -> None:
    """An arm's elbow became viscous after 5.4 s; over all 12 s that explained an eighth of what was left.

    A hobby arm's sag was a little less at first, and no beginning of it.
    """
    bench = Bench(1.0, 0.0)
    seen, unseen = (bench.white(trial) for trial in (bench.fitted, bench.unseen))
    base = bench.white(bench.unseen)
    onset = changes * bench.fitted.duration
    for trial, first, second in ((bench.fitted, bench.columns[0], seen), (bench.unseen, base, unseen)):
        share = np.where(trial.elapsed("dynamics") >= onset, 1.0, before)
        bench.set_residual(trial, first + second * share)
    bench.evidence = Evidence(Likelihood([bench.fitted]), 2.0)
    first = bench.made("first", bench.columns[0], base)
    second = bench.made("second", seen, unseen)
    alone = bench.evidence.fit([first])
    pool = [_elsewhere(first, "joint:b"), second]
    grown = _grow(
        bench.evidence, Likelihood([bench.unseen]), pool, alone, [alone], SelectionSettings(), lambda _: None
    )
    assert grown.chosen is not None
    assert [h.effect.family for h in grown.chosen.hypotheses] == ["first", "second"]
    began = begins * bench.fitted.duration
    assert grown.chosen.hypotheses[1].shape.get(ONSET, 0.0) == pytest.approx(began, abs=0.05)


def _elsewhere(h: Hypothesis, place: str) -> Hypothesis:
    """The same effect at another place."""
    made = SimpleNamespace(**{**vars(h.form), "place": SimpleNamespace(name=place)})
    return replace(h, form=cast("Any", made))


def _acting(field: str, value: float, shape: dict[str, float]) -> Hypothesis:
    """An effect that changes one field of a plant."""
    form = SimpleNamespace(plant_fields=lambda *_: {field: np.array([value])})
    return cast("Hypothesis", _Member(form, shape))


class _Member(SimpleNamespace):
    """What a simulation reads of a hypothesis."""

    def __init__(self, form: SimpleNamespace, shape: dict[str, float]) -> None:
        super().__init__(form=form, shape=shape)


def test_members_of_a_set_act_from_when_they_began() -> None:
    """An effect that began beside another was simulated from the start, and the other way round."""
    trial = arm_trials(recorded()[:1], [])[0][0]
    onset = 0.5 * trial.duration
    always, later = _acting("viscous", 0.4, {}), _acting("coulomb", 0.3, {ONSET: onset})
    ones = (np.ones(1), np.ones(1))
    fits = {
        "both": Fit((always, later), ones, np.eye(2), 1.0),
        "one": Fit((always,), ones[:1], np.eye(1), 1.0),
    }
    stages = over_time(trial, fits)
    assert [begin for begin, _ in stages] == [0.0, onset]
    run = resimulate(trial, stages)
    before = run.time < onset - 0.01
    both, one, nominal = (run.simulated[name]["velocity"] for name in ("both", "one", "nominal"))
    assert np.array_equal(both[before], one[before])
    assert np.abs(one[before] - nominal[before]).max() > 1e-4  # what was there all along acts before it
    assert np.abs(both[~before] - one[~before]).max() > 1e-4
    from_start = resimulate(trial, [(0.0, {"nominal": PlantParameters(), "one": stages[0][1]["one"]})])
    assert np.array_equal(from_start.simulated["one"]["velocity"], one)  # nothing of it begins
