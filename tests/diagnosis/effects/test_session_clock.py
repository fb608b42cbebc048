"""What goes on from recording to recording counts from the first start, in regressors and in simulation."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.diagnosis.effects import find_family
from samrl_core.diagnosis.recordings import block
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Fit, hypothesis
from samrl_core.diagnosis.verdict.how_far import how_far
from tests.diagnosis import worlds
from tests.diagnosis.cases import find_form
from tests.diagnosis.worlds import BEND, LIFT

BORDER_S = 2.0
DRIFT, WARMING = "torque_sensor_error", "thermal_friction"


@cache
def parts() -> tuple[Trial, Trial]:
    """Both parts of one recording, one after the other; a part keeps the recording's own time axis."""
    (whole,) = worlds.record(worlds.plant(), "A", duration_s=4.0)
    first, second = worlds.trials([block(whole, 0.0, BORDER_S), block(whole, BORDER_S, np.inf)])
    return first, second


def test_a_drift_goes_on_in_the_next_part_of_a_recording() -> None:
    form = find_form(find_family(DRIFT), parts()[0], "joint:bend", "drift")
    drift = [form.columns(trial, {})["link", BEND][1] for trial in parts()]
    step = float(np.median(np.diff(drift[0])))
    lost = 0.5  # [s] to the filters' edges and the part's last sample
    assert drift[0][-1] < drift[1][0] < drift[0][-1] + lost + step
    assert drift[1][-1] == pytest.approx(2.0 * BORDER_S, abs=lost)


def test_a_term_that_a_form_lacks_is_not_said_to_be_zero() -> None:
    """A gain of 0 with an interval of no width was reported where only a drift had been fitted."""
    form = find_form(find_family(DRIFT), parts()[0], "joint:bend", "drift")
    assert set(form.parameters(parts()[0], {}, np.array([0.3, 0.05]))) == {"b", "d"}


def test_a_later_recording_is_simulated_from_where_the_drift_has_come() -> None:
    second = parts()[1]
    form = find_form(find_family(DRIFT), second, "joint:bend", "drift")
    amplitudes = np.array([0.3, 0.05])
    fields = form.plant_fields(second, {}, amplitudes)
    assert fields is not None
    (real,) = worlds.trials(worlds.record(worlds.plant(**fields), "A", duration_s=2.0))
    (nominal,) = worlds.trials(worlds.record(worlds.plant(), "A", duration_s=2.0))
    assert real.motion.tau is not None and nominal.motion.tau is not None
    seen = (real.motion.tau - nominal.motion.tau)[:, BEND]
    since = second.motion.start_s + real.motion.session
    assert seen == pytest.approx(0.3 + 0.05 * since, abs=1e-3)


@pytest.mark.parametrize(("form", "ran"), [("session", BORDER_S), ("each recording", 0.0)])
def test_a_drive_is_as_warm_as_it_has_become(form: str, ran: float) -> None:
    second = parts()[1]
    found = find_form(find_family(WARMING), second, "joint:lift", form)
    shape = {"T": 3.0, "v": 0.005}
    fields = found.plant_fields(second, shape, np.array([0.4, 0.6]))
    assert fields is not None
    assert np.asarray(fields["thermal_offset"])[LIFT] == pytest.approx(ran, abs=0.01)


def test_each_held_out_recording_is_simulated_as_far_as_the_drift_has_come_there() -> None:
    """Of two that are held out the second one began later: one plant is not that of both."""
    trials = worlds.trials(worlds.record(worlds.plant(), "AAA", duration_s=2.0))
    form = find_form(find_family(DRIFT), trials[0], "joint:bend", "drift")
    likelihood = Likelihood(trials[:1])
    drift = hypothesis(likelihood, find_family(DRIFT), form, {})
    assert drift is not None
    fit = Fit((drift,), (np.array([0.3, 0.05]),), np.eye(2), 100.0)
    selection: Any = SimpleNamespace(
        chosen=fit, rivals=(), unexplained=0.0, held_out_unexplained=0.0, correlation_time=2.0
    )
    found = how_far(Likelihood(trials[1:]), selection, True, np.random.default_rng(0))
    biases = []
    for run in found.resimulations:
        efforts = [run.simulated[plant]["effort"] for plant in ("with_effect", "nominal")]
        biases.append((efforts[0] - efforts[1])[0, BEND])
    assert biases == pytest.approx([0.4, 0.5], abs=1e-3)
