"""Benchmarks of system identification call a machine's input `u` and its output `y`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping

TIME = np.arange(500) / 250.0
ANGLES = 40.0 * np.sin(np.outer(TIME, [1.0, 1.7, 2.3]) + [0.1, 0.7, 1.9])  # [deg]
TORQUES = np.cos(np.outer(TIME, [1.3, 0.9, 2.1]))


def test_output_is_position_and_input_is_effort_with_questions(tmp_path: Path) -> None:
    """As the benchmark of a KUKA KR300: arrays of (J, N). It was refused."""
    arrays = {"time": TIME[:, None], "y": ANGLES.T, "u": TORQUES.T, "y_ref": (ANGLES + 0.1).T}
    savemat(tmp_path / "run.mat", arrays)
    draft = draft_any([tmp_path / "run.mat"], None, None)
    assert draft.channels["states"]["position"] == {"formula": ["y[0]", "y[1]", "y[2]"], "unit": "deg"}
    assert draft.channels["command"]["position"]["formula"] == ["y_ref[0]", "y_ref[1]", "y_ref[2]"]
    assert draft.channels["commanded_effort"]["effort"]["formula"] == ["u[0]", "u[1]", "u[2]"]
    asked = "\n".join(draft.questions)
    assert "is run.mat: y the measured position?" in asked and "what is run.mat: u?" in asked


def test_a_number_y_beside_named_positions_is_no_output(tmp_path: Path) -> None:
    arrays = {"time": TIME[:, None], "q": np.deg2rad(ANGLES), "y": ANGLES + 3.0, "u": TORQUES}
    savemat(tmp_path / "run.mat", arrays)
    draft = draft_any([tmp_path / "run.mat"], None, None)
    assert draft.channels["states"]["position"]["formula"] == ["q[0]", "q[1]", "q[2]"]


def test_an_output_without_an_input_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "run.mat", {"time": TIME[:, None], "y": ANGLES, "w": TORQUES})
    with pytest.raises(InputError, match="no measured position was found"):
        draft_any([tmp_path / "run.mat"], None, None)


@pytest.mark.parametrize("names", [("_train", "_train2", "_test"), ("Est", "Est2", "Val")])
def test_recordings_side_by_side_in_one_file(names: tuple[str, str, str], tmp_path: Path) -> None:
    """As nonlinearbenchmark.org publishes a robot: only the first was drafted, and nothing held out."""
    arrays = {}
    for number, name in enumerate(names):
        rows = slice(0, 500 - 60 * number)
        arrays |= {
            f"time{name}": TIME[None, rows],
            f"y{name}": ANGLES.T[:, rows],
            f"u{name}": TORQUES.T[:, rows],
        }
    np.savez(tmp_path / "robot.npz", **arrays)
    draft = draft_any([tmp_path / "robot.npz"], None, None)
    assert [each["role"] for each in draft.recordings] == ["fit", "fit", "held_out"]
    content = yaml.safe_load(as_yaml(draft))
    del content["questions"]
    mapping = parse_mapping(yaml.safe_dump(content), tmp_path / "mapping.yaml")
    made = [import_recording(each, mapping, tmp_path).recording.states for each in mapping.recordings]
    assert [len(states.time) for states in made] == [500, 440, 380]
    np.testing.assert_allclose(made[2].position, np.deg2rad(ANGLES[:380]), atol=1e-9)


def test_names_that_end_like_a_share_are_no_recordings(tmp_path: Path) -> None:
    """An estimate beside a value is of the same recording."""
    arrays = {"time": TIME, "q": np.deg2rad(ANGLES), "q_est": np.deg2rad(ANGLES) + 0.01}
    np.savez(tmp_path / "run.npz", **arrays)
    draft = draft_any([tmp_path / "run.npz"], None, None)
    assert len(draft.recordings) == 1 and "sources" not in draft.recordings[0]
