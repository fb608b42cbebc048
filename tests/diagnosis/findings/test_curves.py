"""A fit is drawn as a line where it is a function of what it is plotted against, else sample by sample."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.findings.curves import curve_of
from samrl_core.diagnosis.report.figures import curve_figure
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import Curve
from samrl_core.diagnosis.selection.hypothesis import Evidence, hypothesis
from tests.diagnosis import worlds


def curve(family: str, place: str, **real: Any) -> Curve:
    likelihood = Likelihood(worlds.trials(worlds.world(3, "AB", **real)))
    effect, trial = FAMILIES[family], likelihood.trials[0]
    assert isinstance(effect, Effect)
    form = effect.forms(trial, Place.find(trial, place))[0]
    h = hypothesis(likelihood, effect, form, form.shapes[0])
    assert h is not None
    evidence = Evidence(likelihood)
    found = curve_of(evidence, evidence.fit([h]), h)
    assert found is not None
    return found


def test_friction_is_a_line_over_the_speed() -> None:
    found = curve("coulomb_friction", "joint:lift", coulomb=np.array([0.0, 3.0, 0.0]))
    assert found.is_line and curve_figure(found).data[1].mode == "lines"
    fast = np.abs(found.fit_x) > 0.2
    assert found.fit_y[fast] == pytest.approx(3.0 * np.sign(found.fit_x[fast]), abs=0.6)


def test_a_load_is_drawn_sample_by_sample() -> None:
    """The torque of a weight behind two joints depends on both: over one of them its mean is jagged."""
    delta = np.zeros((3, 10))
    delta[2, :4] = 1.0, 0.3, 0.0, 0.0  # [kg], [kg m]
    found = curve("payload", "arm:tool_arm", inertial_delta=delta)
    assert not found.is_line and curve_figure(found).data[1].mode == "markers"
    assert 400 < len(found.fit_x) <= 1600
    assert set(found.fit_x) <= set(found.x)
