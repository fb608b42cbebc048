"""Corrected calibrations: near the truth by their own covariance, without a gap, read by the cell."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.cell.calibration.calibrate import calibrated_cell
from samrl_core.cell.calibration.cell_correction import read_correction, twist_names
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.export.recalibration import Recalibration, write_recalibration
from samrl_core.diagnosis.kinds.poses.poses import split_poses
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.result import Diagnosis
from samrl_ros.cli.main import run
from samrl_ros.recordings.pose_file import write_pose_file
from tests.diagnosis.poses.pose_worlds import CAMERA, SMALL, PoseWorld, record, record_two_arms


def found(recording: PoseRecording) -> tuple[Diagnosis, Recalibration | None]:
    fit, held_out = split_poses(recording)
    diagnosis, far = diagnose([fit], [held_out])
    assert far.correction is None or isinstance(far.correction, Recalibration)
    return diagnosis, far.correction


@pytest.mark.parametrize("at_rest", [False, True])
def test_the_corrected_camera_leaves_no_gap(at_rest: bool) -> None:
    recording = record(PoseWorld(camera_error=SMALL, at_rest=at_rest))
    _, corrected = found(recording)
    assert corrected is not None
    (transform,) = corrected.transforms
    assert transform.name == "camera_in_flange"
    again, nothing = found(replace(recording, camera_in_flange=transform.found))
    assert again.verdict == "no_gap" and nothing is None


def test_the_truth_lies_within_the_covariance() -> None:
    """Squared Mahalanobis distances of six numbers, over worlds; they would average 6."""
    distances = []
    for seed in range(1, 6):
        _, corrected = found(record(PoseWorld(camera_error=SMALL, at_rest=True), seed))
        assert corrected is not None
        (transform,) = corrected.transforms
        error = rigid.log(np.linalg.inv(transform.found.matrix())[None] @ (CAMERA @ SMALL)[None])[0]
        error[:3] = CAMERA[:3, :3] @ error[:3]
        distances.append(error @ np.linalg.solve(transform.covariance, error))
    print(distances)
    assert np.mean(distances) < 12.0 and max(distances) < 22.5  # chi2 of 6: 1 in 1000


def test_a_cell_reads_it(tmp_path: Path) -> None:
    _, corrected = found(record(PoseWorld(camera_error=SMALL)))
    assert corrected is not None
    files = write_recalibration(corrected, tmp_path)
    names = ("cell.json", "hand_eye/calibration.json", "corrected.yaml")
    assert files == [tmp_path / name for name in names]
    wanted = corrected.transforms[0].found
    by_calibration = calibrated_cell(cell_named(), files[1], None)
    by_correction = read_correction(files[0]).cell(cell_named())
    for cell in (by_calibration, by_correction):
        np.testing.assert_allclose(cell.camera_in_flange.matrix(), wanted.matrix(), atol=1e-12)
    known = read_correction(files[0]).covariance
    assert known.of == twist_names("camera_in_flange")
    np.testing.assert_allclose(known.matrix, corrected.transforms[0].covariance)
    lines = yaml.safe_load(files[2].read_text())["poses"]["camera_in_flange"]
    np.testing.assert_allclose(lines["position"], wanted.position, atol=1e-6)


def test_an_encoder_is_said_and_changes_no_transform() -> None:
    _, corrected = found(record_two_arms(encoder={"bend": 0.008}))
    assert corrected is not None and corrected.transforms == ()
    (statement,) = corrected.statements
    assert statement.effect == "encoder_offset@joint:bend"
    value = float(statement.says.split()[1])
    assert value == pytest.approx(0.008, abs=0.001) and statement.says.endswith("from what bend reads")


@pytest.mark.thorough
def test_a_clock_that_is_ahead_is_shifted_back() -> None:
    _, corrected = found(record_two_arms(tool_clock=0.03))
    assert corrected is not None
    (statement,) = corrected.statements
    assert statement.effect == "clock_offset@arm:tool_arm" and "tool_arm's stamps" in statement.says
    offset = float(statement.says.partition("offset_s: ")[2].partition("}")[0])
    assert offset == pytest.approx(-0.03, abs=0.002)


def test_two_arms_have_their_bases_corrected(tmp_path: Path) -> None:
    recording = record_two_arms()
    assert recording.base_in_base is not None
    off = type(recording.base_in_base).from_matrix(recording.base_in_base.matrix() @ np.linalg.inv(SMALL))
    _, corrected = found(replace(recording, base_in_base=off))
    assert corrected is not None
    write_recalibration(corrected, tmp_path)
    file = tmp_path / "base_to_base" / "calibration.json"
    assert json.loads(file.read_text())["effect"] == "base_to_base@cell"
    cell = calibrated_cell(cell_named(), None, file)
    tool_in_camera = cell.camera_base_in_world.inverse() @ cell.tool_base_in_world
    np.testing.assert_allclose(tool_in_camera.matrix(), recording.base_in_base.matrix(), atol=2e-3)


def test_the_command_applies_or_says_why_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = {"off": PoseWorld(camera_error=SMALL, at_rest=True), "late": PoseWorld(latency=0.04)}
    for name, made_as in made.items():
        write_pose_file(record(made_as), tmp_path / f"{name}.poses.npz")
        command = ["diagnose", str(tmp_path / f"{name}.poses.npz"), "--out", str(tmp_path / name), "--apply"]
        assert run(command) == 0
    said = capsys.readouterr().out
    assert "applied: camera_in_flange, from hand_eye@sensor:camera" in said
    assert "nothing was applied: several causes fit alike" in said
    assert (tmp_path / "off" / "apply" / "hand_eye" / "calibration.json").exists()
    assert not (tmp_path / "late" / "apply").exists()
