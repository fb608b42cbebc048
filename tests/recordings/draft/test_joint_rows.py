"""Tables with a row per joint are samples: whoever reads them as rows of one joint mixes all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.joint_rows import find_joint_column, join_samples
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.made_logs import urdf_of

TIME = np.arange(0.0, 2.5, 0.01)


def tidy(joints: Sequence[str | int], column: str, late: float = 0.0) -> pd.DataFrame:
    """Rows of joints, each `late` [s] after the one before it; joint k swings with k + 1 rad/s."""
    rows = [
        {
            "t": t + k * late,
            column: joint,
            "q_rad": np.sin((k + 1) * t),
            "dq_rad_s": (k + 1) * np.cos((k + 1) * t),
        }
        for t in TIME
        for k, joint in enumerate(joints)
    ]
    return pd.DataFrame(rows)


def written(frame: pd.DataFrame, path: Path) -> Table:
    """The same as a reader finds it."""
    frame.to_csv(path, index=False)
    return read_table(path, CsvOptions(), "log")


@pytest.mark.parametrize(("column", "joints"), [("axis", ["J1", "J2", "J3"]), ("motor_id", [11, 12])])
def test_each_joint_has_columns_of_its_own(tmp_path: Path, column: str, joints: list[str | int]) -> None:
    table = written(tidy(joints, column), tmp_path / "run.csv")
    assert find_joint_column(table) == column
    joined = join_samples(table, column, "log")
    assert list(joined.columns) == ["t", *(f"{q}.{j}" for q in ("q_rad", "dq_rad_s") for j in joints)]
    assert joined.numbers("t", "log") == pytest.approx(TIME)
    assert joined.numbers(f"q_rad.{joints[1]}", "log") == pytest.approx(np.sin(2 * TIME))
    assert not joined.notes


def test_a_column_of_another_name_holds_joints_of_the_model(tmp_path: Path) -> None:
    table = written(tidy(["hip", "knee"], "name"), tmp_path / "run.csv")
    assert find_joint_column(table) == "" and find_joint_column(table, ["knee", "hip", "foot"]) == "name"


def test_motors_that_answer_in_turn_are_one_sample_and_it_is_said(tmp_path: Path) -> None:
    joined = join_samples(written(tidy(["a", "b"], "servo", 0.002), tmp_path / "run.csv"), "servo", "log")
    assert joined.numbers("t", "log") == pytest.approx(TIME)
    (note,) = joined.notes
    assert "'t'" in note and "0.002 later" in note


def test_lost_rows_leave_their_joint_empty(tmp_path: Path) -> None:
    lost = [4, 9, 10, 11, 19, 20, 21]  # b of sample 1, all of 3, then b and c of 6 and a of 7
    frame = tidy(["a", "b", "c"], "axis").drop(lost)
    joined = join_samples(written(frame, tmp_path / "run.csv"), "axis", "log")
    assert joined.numbers("t", "log") == pytest.approx(np.delete(TIME, 3))
    empty = {j: np.flatnonzero(np.isnan(joined.numbers(f"q_rad.{j}", "log"))).tolist() for j in "abc"}
    assert empty == {"a": [6], "b": [1, 5], "c": [5]}
    assert "4 rows" in joined.notes[0]


def test_rows_that_are_whole_samples_stay(tmp_path: Path) -> None:
    frame = tidy(["a", "b"], "axis").sort_values(["axis", "t"])  # runs below each other
    assert find_joint_column(written(frame, tmp_path / "run.csv")) == ""
    with pytest.raises(InputError, match="names 1 joints, must be 2 to 32"):
        join_samples(written(frame[frame["axis"] == "a"], tmp_path / "one.csv"), "axis", "log")
    with pytest.raises(InputError, match="no column 'joint'; it has 't', 'axis'"):
        join_samples(written(frame, tmp_path / "run.csv"), "joint", "log")


@pytest.mark.parametrize("suffix", [".csv", ".jsonl"])
def test_a_folder_is_drafted_and_imported(tmp_path: Path, suffix: str) -> None:
    joints = ["hip", "knee"]
    for run in ("run1", "run2"):
        frame = tidy(joints, "joint_name").drop(index=[5])
        frame["tau_Nm"] = 0.3 * frame["dq_rad_s"]
        path = tmp_path / f"{run}{suffix}"
        frame.to_csv(path, index=False) if suffix == ".csv" else frame.to_json(
            path, orient="records", lines=True
        )
    (tmp_path / "robot.urdf").write_text(urdf_of(joints))
    draft = draft_any([tmp_path], urdf_of(joints), "robot.urdf", Effort.drive)
    assert draft.sources["states"]["joint_column"] == "joint_name" and not draft.questions
    (tmp_path / "m.yaml").write_text(as_yaml(draft))
    for made in import_any(tmp_path / "m.yaml", tmp_path, None).made:
        states = made.recording.states
        assert draft.joints == joints and len(states.time) == len(TIME) - 1
        truth = np.sin(np.outer(np.delete(TIME, 2), [1.0, 2.0]))
        np.testing.assert_allclose(states.position, truth, atol=1e-6)
