"""Tolerances that end: what twice the stated half widths explain is no effect, what they cannot is one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.stated_tolerances import STANDARD_DEVIATION
from samrl_core.diagnosis.effects.sensor.encoder_offset import EFFECT as OFFSET
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.bounded_tolerances import evidence_beyond
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis
from samrl_core.diagnosis.selection.selection import WIDE
from samrl_core.diagnosis.selection.settings import SelectionSettings
from tests.diagnosis.controllers.kinds import VELOCITY_DRIVE
from tests.diagnosis.controllers.machines import Differs, worlds

NEEDED = SelectionSettings().wide_threshold


@pytest.fixture(scope="module")
def pendulum() -> Trial:
    """A velocity drive's pendulum with nothing wrong."""
    (recordings,) = worlds(VELOCITY_DRIVE, [Differs()], 3, 2.0)
    return arm_trials(recordings[:1], [])[0][0]


def offset_of(trial: Trial, error: float) -> tuple[Evidence, Fit]:
    """The fit of an encoder that is off by so much [rad], in the noise that the recording has."""
    form = OFFSET.forms(trial, OFFSET.places(trial)[0])[0]
    rng, residual = np.random.default_rng(0), trial.equations.residual
    for channel, values in residual.items():
        residual[channel] = trial.sigma[channel] * rng.standard_normal(values.shape)
    for (channel, joint), rows in form.columns(trial, {}).items():
        residual[channel][:, joint] += error * rows[0]
    evidence = Evidence(Likelihood([trial]), 2.0)
    h = hypothesis(evidence.likelihood, OFFSET, form, {})
    assert h is not None
    return evidence, evidence.fit([h])


@pytest.mark.parametrize(("error", "beyond"), [(0.0, False), (0.02, False), (0.04, False), (0.06, True)])
def test_an_offset_is_seen_where_no_torque_offset_of_twice_the_width_does_the_same(
    pendulum: Trial, error: float, beyond: bool
) -> None:
    evidence, fit = offset_of(pendulum, error)
    found = evidence_beyond(evidence, fit, WIDE)
    assert found is not None
    assert (found >= NEEDED) is beyond and (beyond or found < 0.0)
    wide = Evidence(Likelihood([pendulum], WIDE), 2.0)
    h = hypothesis(wide.likelihood, OFFSET, fit.hypotheses[0].form, {})
    assert h is not None and wide.fit([h]).log_evidence < NEEDED  # the tails of a Gaussian explain it


def test_standard_deviations_have_no_end(pendulum: Trial) -> None:
    evidence, fit = offset_of(pendulum, 0.06)
    arm = pendulum.recording.arm
    stated = replace(arm.tolerances, stated_as=STANDARD_DEVIATION)
    recording = pendulum.recording
    try:
        pendulum.recording = replace(recording, arm=replace(arm, tolerances=stated))
        assert evidence_beyond(evidence, fit, WIDE) is None
    finally:
        pendulum.recording = recording
