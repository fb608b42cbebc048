"""Torque sensors alone: a log of joint states, as a robot that reports link torques publishes them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis import worlds
from tests.diagnosis.cases import PAYLOAD
from tests.diagnosis.worlds import LIFT


def diagnosed(seed: int, **fields: Any) -> Diagnosis:
    """Fitted on A and B, held out C; nobody recorded what was commanded."""
    a, b, c = (replace(r, command=None, commanded_effort=None) for r in worlds.world(seed, **fields))
    return diagnose([a, b], [c], DiagnosisSettings(simulate=False))[0]


@pytest.mark.thorough
def test_a_sensors_gain_is_named() -> None:
    """It was not testable without a commanded torque, and a link's inertia was the nearest."""
    found = diagnosed(5, sensor_gain={LIFT: 0.08})
    assert found.verdict == "effect", found.reasons
    assert [e.name for e in found.effects] == ["torque_sensor_error@joint:lift"]
    gain = found.effects[0].parameters["g"]
    assert gain.ci95[0] <= 0.08 <= gain.ci95[1] and gain.value == pytest.approx(0.08, rel=0.15)


@pytest.mark.slow
def test_a_payload_is_no_sensors_error() -> None:
    found = diagnosed(6, payload=PAYLOAD)
    assert found.verdict == "effect", found.reasons
    assert [e.name for e in found.effects] == ["payload@arm:tool_arm"]


def test_a_right_sensor_is_not_doubted() -> None:
    found = diagnosed(7)
    assert found.verdict == "no_gap", [e.name for e in found.effects]
