"""Torques on another topic or in another file than the positions, as iiwa_stack and many scripts log them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.any_importer import import_logs_by
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.writing import as_yaml

TIME = np.arange(0.0, 10.0, 0.01)
Q = np.column_stack([np.sin(TIME), np.cos(0.7 * TIME)])


def write(path: Path, names: str, time: np.ndarray, values: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack([time, values]), delimiter=",", header=f"time,{names}", comments="")
    return path


def logs(folder: Path, late: float = 0.0) -> list[Path]:
    """Positions at 100 Hz, torques at 40 Hz that are three times the position."""
    other = np.arange(0.5, 9.0, 0.025) + late
    torque = 3.0 * np.column_stack([np.sin(other), np.cos(0.7 * other)])
    return [
        write(folder / "position.csv", "q1_rad,q2_rad", TIME, Q),
        write(folder / "torque.csv", "tau1_Nm,tau2_Nm", other, torque),
    ]


@pytest.mark.parametrize("effort", [Effort.link, Effort.drive])
def test_they_are_taken_where_they_are(tmp_path: Path, effort: Effort) -> None:
    draft = draft_mapping(logs(tmp_path), None, None, effort)
    assert not draft.questions
    (tmp_path / "mapping.yaml").write_text(as_yaml(draft))
    (made,) = import_logs_by(tmp_path / "mapping.yaml", tmp_path, (), (), None).made
    recording = made.recording
    if effort is Effort.drive:
        signal = recording.commanded_effort
        assert signal is not None and len(signal.time) == 340
        assert np.allclose(signal.effort[:, 0], 3.0 * np.sin(signal.time), atol=1e-3)
        return
    states = recording.states  # cut to where the torque is known, taken by straight lines between its samples
    assert (states.time[0], states.time[-1]) == (pytest.approx(0.5), pytest.approx(8.97))
    assert np.allclose(states.effort, 3.0 * states.position, atol=1e-3)
    assert any("another source" in note for note in made.notes)


def test_what_they_are_is_asked(tmp_path: Path) -> None:
    draft = draft_mapping(logs(tmp_path), None, None)
    assert any("what is torque.csv: tau{}_Nm?" in question for question in draft.questions)


def test_sources_without_a_moment_in_common_are_refused(tmp_path: Path) -> None:
    draft = draft_mapping(logs(tmp_path, late=100.0), None, None, Effort.link)
    (tmp_path / "mapping.yaml").write_text(as_yaml(draft))
    with pytest.raises(InputError, match="0 moments in common"):
        import_logs_by(tmp_path / "mapping.yaml", tmp_path, (), (), None)


def test_a_source_that_is_not_there_is_named(tmp_path: Path) -> None:
    draft = draft_mapping(logs(tmp_path), None, None, Effort.link)
    text = as_yaml(draft).replace("source: effort", "source: torques")
    (tmp_path / "mapping.yaml").write_text(text)
    with pytest.raises(InputError, match="effort.source is 'torques'; sources are"):
        import_logs_by(tmp_path / "mapping.yaml", tmp_path, (), (), None)


def test_a_force_beside_one_joint_without_a_label_is_asked_for(tmp_path: Path) -> None:
    paths = [
        write(tmp_path / "pendulum.csv", "angle_rad", TIME, Q[:, :1]),
        write(tmp_path / "pusher.csv", "force_Nm", TIME, Q[:, 1:]),
    ]
    draft = draft_mapping(paths, None, None, Effort.drive)
    assert any("what drives this joint?" in question for question in draft.questions)
