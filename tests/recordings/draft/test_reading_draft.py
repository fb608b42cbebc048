"""Drafts of depth logs: what names and numbers prove, what is asked, and that the draft is a mapping."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_ros.cli.main import run
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.readings.reading_draft import draft_readings
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables
from samrl_ros.recordings.reading_file import read_reading_file


def log(path: Path, **columns: np.ndarray) -> Path:
    names = ",".join(columns)
    np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header=names, comments="")
    return path


def drafted(path: Path) -> Draft | None:
    return draft_readings(read_logged_tables([path]))


def distances(factor: float = 1.0) -> np.ndarray:
    return factor * np.repeat([0.4, 0.7, 1.0, 1.3], 30)


@pytest.mark.parametrize(
    "factor, unit, names",
    [(1.0, "m", ("depth_measured", "depth_true")), (1000.0, "mm", ("depth_mm", "distance_mm"))],
)
def test_a_depth_log_is_drafted_and_imported(
    tmp_path: Path, factor: float, unit: str, names: tuple[str, str]
) -> None:
    true = distances(factor)
    path = log(tmp_path / "run.csv", **dict(zip(names, (1.01 * true, true), strict=True)))
    draft = drafted(path)
    assert draft is not None and not draft.questions
    assert draft.readings["unit"] == unit
    assert run(["bag", "draft", str(path), "--out", str(tmp_path / "mapping.yaml")]) == 0
    assert run(["bag", "import", str(tmp_path / "mapping.yaml"), "--out", str(tmp_path / "bags")]) == 0
    read = read_reading_file(tmp_path / "bags" / "run.readings.npz")
    np.testing.assert_allclose(read.reading, 1.01 * distances())
    np.testing.assert_allclose(read.reference, distances())


def test_units_of_a_depth_and_its_reference_are_their_own(tmp_path: Path) -> None:
    true = distances()
    path = log(tmp_path / "run.csv", depth_mm=1010.0 * true, laser_distance_m=true)
    draft = drafted(path)
    assert draft is not None and not draft.questions
    assert draft.readings["reading"] == "0.001 * reading" and draft.readings["unit"] == "m"
    asked = drafted(log(tmp_path / "other.csv", depth_raw=1010.0 * true, distance=true))
    assert asked is not None and any("in which units are the two" in q for q in asked.questions)


def test_two_depths_are_asked_for(tmp_path: Path) -> None:
    true = distances()
    path = log(tmp_path / "run.csv", depth_left=1.01 * true, depth_right=0.99 * true, distance=true)
    draft = drafted(path)
    assert draft is not None
    (question,) = draft.questions
    assert "'depth_right' against 'distance'" in question


def test_what_is_no_depth_against_a_distance_is_left_to_others(tmp_path: Path) -> None:
    true, noise = distances(), np.random.default_rng(0).standard_normal(120)
    for columns in (
        {"q1": true, "q1_ref": true},  # a joint and its set point
        {"depth": true, "temperature": true},  # no truth
        {"depth": true, "distance": noise},  # of something else
    ):
        assert drafted(log(tmp_path / "run.csv", **columns)) is None


def test_millimetres_that_might_be_centimetres_are_asked_for(tmp_path: Path) -> None:
    true = distances(1000.0)
    draft = drafted(log(tmp_path / "run.csv", depth=1.01 * true, distance=true))
    assert draft is not None and len(draft.questions) == 1 and " cm" in draft.questions[0]


def test_a_short_table_of_distances_is_depth_and_says_what_it_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Means at six distances in a table with words of its own, as depth cameras are tested on a wall."""
    path = tmp_path / "wall.csv"
    rows = ["Ground Truth (cm),Measured (cm),Std Dev (cm),Abs Error (cm)"]
    rows += [f"{d},{1.009 * d:.2f},{2e-6 * d * d:.4f},{0.009 * d:.2f}" for d in (50, 100, 150, 200, 250, 300)]
    path.write_text("\n".join(rows))
    draft = drafted(path)
    assert draft is not None and draft.readings["unit"] == "cm" and not draft.questions
    assert draft.sources["log"]["columns"] == {"reading": "Measured (cm)", "reference": "Ground Truth (cm)"}
    assert run(["diagnose", str(path), "--out", str(tmp_path / "report")]) == 3
    said = capsys.readouterr().err
    assert "6 readings" in said and "not their mean" in said


def test_of_a_sensors_zones_the_middle_one_is_judged_and_zeros_are_none(tmp_path: Path) -> None:
    """A VL53L5CX has 64: they were joints of a machine, and zeros stand where no target was seen."""
    true = distances(1000.0)
    zones = {f"zone_{k}": true + k for k in range(16)}
    zones["zone_8"][::7] = 0.0
    path = log(tmp_path / "run.csv", timestamp_ms=67.0 * np.arange(len(true)), gt_distance_mm=true, **zones)
    draft = drafted(path)
    assert draft is not None and draft.readings["unit"] == "mm"
    assert draft.sources["log"]["columns"]["reading"] == {"column": "zone_8", "empty": 0.0}
    assert draft.sources["log"]["missing"] == "drop_row"
    assert draft.questions and all("in the middle" in question for question in draft.questions)


def test_of_two_sensors_beside_one_tape_it_is_asked_which(tmp_path: Path) -> None:
    """`ToF` was `to` and `f`, and the ultrasonic sensor beside it was the reading, for sure."""
    true, rng = distances(100.0), np.random.default_rng(0)
    columns = {"Actual (cm)": true, "Ultrasonic (cm)": true + rng.normal(size=len(true)), "ToF (cm)": true}
    path = log(tmp_path / "run.csv", **columns)
    draft = drafted(path)
    assert draft is not None and draft.readings["unit"] == "cm"
    (question,) = draft.questions
    assert "Ultrasonic (cm)" in question and "ToF (cm)" in question
