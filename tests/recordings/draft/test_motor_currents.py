"""Currents are efforts once a torque constant is known: it is asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.motor_input import TORQUE_CONSTANT
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from tests.recordings.logs.columns import TIME, TURNED, WAVE, write


def robot(path: Path, unit: str = "_A", offset: float = 0.0) -> Path:
    """Two joints with commands and currents."""
    columns = {"time_s": TIME}
    for k in (1, 2):
        columns |= {
            f"q{k}_rad": k * WAVE,
            f"q{k}_cmd_rad": 1.01 * k * WAVE,
            f"current_{k}{unit}": k * TURNED + offset,
        }
    return write(path, **columns)


def asked(draft: Draft) -> str:
    return "\n".join(guess.question for guess in draft.guesses if guess.asks == TORQUE_CONSTANT)


def test_currents_beside_a_command_are_asked_for(tmp_path: Path) -> None:
    """It said `sure: no efforts were found`."""
    draft = draft_any([robot(tmp_path / "a.csv")], None, None)
    assert "torque constant times gear ratio" in asked(draft) and "one sign" not in asked(draft)
    assert all(guess.question for guess in draft.guesses if "no efforts" in guess.reason)
    effort = draft.channels["commanded_effort"]["effort"]
    assert effort == {"formula": ["1.0 * current_a_1", "1.0 * current_a_2"], "unit": "N m"}
    assert not any("current" in each for each in draft.unused)
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    mapping = parse_mapping(yaml.safe_dump(content), tmp_path / "m.yaml")
    recording = import_recording(mapping.recordings[0], mapping, tmp_path).recording
    assert recording.commanded_effort is not None and recording.commanded_effort.effort is not None
    np.testing.assert_allclose(recording.commanded_effort.effort[:, 1], 2.0 * TURNED, atol=1e-5)


def test_milliamperes_and_one_sign(tmp_path: Path) -> None:
    draft = draft_any([robot(tmp_path / "a.csv", "_mA", 5.0)], None, None)
    assert draft.channels["commanded_effort"]["effort"]["formula"][0].startswith("1.0 * 0.001 * ")
    assert "one sign alone" in asked(draft)


def test_currents_that_are_not_to_be_used(tmp_path: Path) -> None:
    draft = draft_any([robot(tmp_path / "a.csv")], None, None, Effort.none)
    assert not draft.questions and "commanded_effort" not in draft.channels
    (guess,) = draft.of("channels.states.effort")
    assert "current_{}_A is left out" in guess.reason


@pytest.mark.parametrize("more", [{}, {"q_axis_current": 0.9 * TURNED, "d_axis_current": 0.1 * WAVE}])
def test_a_vesc_motors_current_drives_it(more: dict[str, np.ndarray], tmp_path: Path) -> None:
    """Neither `current_motor` nor `current_in` was used, but the duty cycle."""
    log = write(
        tmp_path / "a.csv",
        ms_today=1e3 * TIME,
        input_voltage=36.0 + 0.1 * WAVE,
        current_motor=TURNED,
        current_in=0.2 * TURNED * np.abs(WAVE),
        **more,
        duty_cycle=0.1 * WAVE,
        encoder_position=60.0 + 40.0 * WAVE,
    )
    draft = draft_any([log], None, None)
    (formula,) = draft.channels["commanded_effort"]["effort"]["formula"]
    assert draft.sources["states"]["columns"][formula] == "current_motor"
    assert draft.controller["type"] == "current_motor"
    assert any("torque constant [N m/A]" in question for question in draft.questions)
    assert "a.csv: current_in: of the supply, not of the motor" in draft.unused
