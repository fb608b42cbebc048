"""Motors of which speeds alone were logged: the position is their integral."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping

TIME = np.arange(0.0, 8.0, 0.01)
WANTED = 60.0 + 30.0 * np.sin(TIME)  # [rpm]
TURNED = TIME + 0.5 * (1.0 - np.cos(TIME))  # [rev] by them


def _draft(path: Path, header: str, speeds: np.ndarray) -> Draft:
    rows = zip(1000.0 * TIME, speeds, np.roll(speeds, 5), strict=True)
    path.write_text("\n".join([header, *(",".join(f"{x:.3f}" for x in row) for row in rows)]))
    return draft_any([path], None, None)


def test_speeds_alone_are_integrated(tmp_path: Path) -> None:
    draft = _draft(tmp_path / "step.csv", "timestamp_ms,setpoint_rpm,actual_rpm", WANTED)
    assert not draft.questions
    mapping = parse_mapping(yaml.safe_dump(draft.as_mapping()), tmp_path / "mapping.yaml")
    recording = import_recording(mapping.recordings[0], mapping, tmp_path).recording
    assert recording.command is not None and recording.command.position is not None
    np.testing.assert_allclose(recording.command.position[:, 0], 2.0 * np.pi * TURNED, atol=1e-3)
    assert recording.states.velocity is not None
    np.testing.assert_allclose(recording.states.velocity[5:, 0], np.pi / 30.0 * WANTED[:-5], atol=1e-3)


def test_a_speed_without_a_unit_asks_for_it(tmp_path: Path) -> None:
    draft = _draft(tmp_path / "step.csv", "timestamp_ms,target_speed,speed", WANTED)
    assert any("and not rad/s, deg/s or rpm" in question for question in draft.questions)


@pytest.mark.parametrize("header", ["timestamp_ms,setpoint_rpm,output_rpm", "timestamp_ms,power,light"])
def test_what_is_no_measured_speed_is_none(header: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no measured position was found among step.csv: "):
        _draft(tmp_path / "step.csv", header, WANTED)


def test_a_column_alone_is_compared_with_nothing(tmp_path: Path) -> None:
    (tmp_path / "stamps.csv").write_text("\n".join(f"{1470744587.966 + k:.6f}" for k in range(60)))
    with pytest.raises(InputError, match="is one column, .* a second clock's stamps, the true distance"):
        draft_any([tmp_path / "stamps.csv"], None, None)
