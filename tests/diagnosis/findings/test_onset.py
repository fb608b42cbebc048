"""An onset is stated only where "it was there all along" is much less likely."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.findings.onset import began_in, find_onsets
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit, hypothesis
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT

Share = Callable[[np.ndarray], np.ndarray]  # of the effect over time [s]


@cache
def recordings() -> tuple[ArmRecording, ...]:
    """A nominal arm in two chirps, whose motion is even over time; what was asked of it is hidden."""
    return tuple(replace(r, command=None) for r in worlds.world(5, "BB"))


def switched(*shares: Share, size: float = 1.5, power: float = 1.0) -> tuple[Likelihood, Fit, float]:
    """A viscosity at the second joint whose share over time may differ by recording, and its fit."""
    made = []
    for k, recording in enumerate(recordings()):
        v, sent = recording.states.velocity, recording.commanded_effort
        assert v is not None and sent is not None and sent.effort is not None
        effort, time = sent.effort.copy(), sent.time - sent.time[0]
        law = size * np.sign(v[:, LIFT]) * np.abs(v[:, LIFT]) ** power
        effort[:, LIFT] += shares[k % len(shares)](time) * law
        made.append(replace(recording, commanded_effort=JointSignal(sent.time, effort=effort)))
    likelihood = Likelihood(worlds.trials(made))
    effect, trial = FAMILIES["viscous_friction"], likelihood.trials[0]
    assert isinstance(effect, Effect)
    form = effect.forms(trial, Place.find(trial, "joint:lift"))[0]
    there = hypothesis(likelihood, effect, form, form.shapes[0])
    assert there is not None
    fit = Evidence(likelihood, 3.0).fit([there])
    assert fit.log_evidence > 100.0
    return likelihood, fit, 3.0


def from_on(begin: float) -> Share:
    """Nothing, and the whole from a time [s] on."""
    return lambda t: 1.0 * (t >= begin)


def test_what_was_there_from_the_start_has_no_onset() -> None:
    assert find_onsets(*switched(np.ones_like)) == [None, None]


def test_what_is_switched_on_began_then() -> None:
    a, b = find_onsets(*switched(from_on(3.0), from_on(4.0)))
    assert a == pytest.approx(3.0, abs=0.3) and b == pytest.approx(4.0, abs=0.3)


def test_an_onset_is_said_where_the_effect_acts() -> None:
    """What stands out at another joint did not begin with it."""
    likelihood, fit, _ = switched(np.ones_like)
    assert began_in(fit, [None, 3.0]) == {(1, "drive", LIFT): 3.0}
    assert (1, "drive", LIFT) in likelihood.blocks and len(likelihood.blocks) > 4


def test_what_is_switched_on_in_one_recording_was_there_all_along_in_the_other() -> None:
    a, b = find_onsets(*switched(np.ones_like, from_on(4.0)))
    assert a is None and b == pytest.approx(4.0, abs=0.3)


def test_a_size_that_grows_is_no_onset() -> None:
    """Half of it was there before: the law changes, but it did not begin."""
    assert find_onsets(*switched(lambda t: np.where(t < 4.0, 0.5, 1.0))) == [None, None]


def test_a_formula_that_is_weaker_at_the_start_is_no_onset() -> None:
    """Of a grease that is thicker when slow, a viscosity explains little where a recording begins slowly."""
    assert find_onsets(*switched(np.ones_like, power=0.6)) == [None, None]


def test_nothing_begins_within_the_first_part() -> None:
    assert find_onsets(*switched(from_on(0.6))) == [None, None]


def test_an_onset_that_was_searched_with_the_effect_is_the_onset() -> None:
    likelihood, fit, k = switched(from_on(4.0))
    h = fit.hypotheses[0]
    later = hypothesis(likelihood, h.effect, h.form, {**h.shape, ONSET: 4.0})
    assert later is not None
    assert find_onsets(likelihood, Evidence(likelihood, k).fit([later]), k) == [4.0, 4.0]
