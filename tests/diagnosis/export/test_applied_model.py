"""`--apply` for an arm: its URDF with what was named, and all values with their covariance."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.export.applied_model import write_applied_model
from samrl_core.diagnosis.export.correction import Correction
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT

LIBRARY = DiagnosisSettings(library={"viscous_friction", "coulomb_friction", "payload", "command_delay"})


def found(**fields: object) -> tuple[Correction, list[ArmRecording]]:
    """What a world's A and B name; all three recordings."""
    recordings = worlds.world(5, **fields)
    diagnosis, far = diagnose(recordings[:2], recordings[2:], LIBRARY)
    assert diagnosis.verdict == "effect", diagnosis.reasons
    assert isinstance(far.correction, Correction)
    return far.correction, recordings


@pytest.mark.slow
def test_with_the_applied_model_the_held_out_recording_has_no_gap(tmp_path: Path) -> None:
    correction, recordings = found(viscous={LIFT: 1.0})
    done = write_applied_model(correction, tmp_path / "apply")
    assert [s.place for s in done.inside] == ["joint:lift"] and not done.outside
    urdf = (tmp_path / "apply" / "arm.urdf").read_text()
    applied = [replace(r, arm=replace(r.arm, urdf=urdf)) for r in recordings]
    held_out = applied[2:]
    (again, _), (before, _) = (diagnose(held_out, [], LIBRARY), diagnose(recordings[2:], [], LIBRARY))
    assert before.verdict == "effect", before.reasons
    assert again.verdict == "no_gap", again.reasons

    told = json.loads((tmp_path / "apply" / "arm.json").read_text())
    (value,) = told["values"]
    assert (value["field"], value["joint"], value["unit"]) == ("viscous", "lift", "N m s/rad")
    assert value["value"] == pytest.approx(1.0, rel=0.05)
    assert 0.0 < value["standard_deviation"] < 0.1
    assert told["covariance"][0][0] == pytest.approx(value["standard_deviation"] ** 2)
    with pytest.raises(InputError, match="exists already"):
        write_applied_model(correction, tmp_path / "apply")


def test_what_no_urdf_holds_is_for_the_users_code(tmp_path: Path) -> None:
    """Values that vary together keep their covariance; an effect without numbers is named."""
    drawn = np.random.default_rng(1).standard_normal((200, 2)) @ np.array([[0.002, 0.1], [0.0, 0.05]])
    urdf, joints = worlds.URDF, worlds.JOINTS
    zero = np.zeros(3)
    delay, coulomb = np.array([0.03, 0.0, 0.0]), np.array([0.0, 0.7, 0.0])
    samples = {
        "command_delay": np.pad(0.03 + drawn[:, :1], ((0, 0), (0, 2))),
        "coulomb": np.pad(0.7 + drawn[:, 1:], ((0, 0), (1, 1))),
    }
    made = Correction(
        ("command_delay@joint:turn", "coulomb_friction@joint:lift", "packet_jitter@arm:tool_arm"), joints,
        {"command_delay": delay, "coulomb": coulomb}, ("packet_jitter@arm:tool_arm",), urdf, zero, zero, zero,
        None, None, {"shrink": 0.8}, samples=samples,
    )  # fmt: skip
    done = write_applied_model(made, tmp_path / "apply")
    assert [s.what for s in done.outside] == ["command_delay"]
    assert done.unsimulated == ("packet_jitter@arm:tool_arm",)
    told = json.loads(done.files[1].read_text())
    assert [v["field"] for v in told["values"]] == ["command_delay", "coulomb"]
    np.testing.assert_allclose(told["covariance"], np.cov(drawn.T), rtol=1e-6)
    assert abs(told["covariance"][0][1]) > 1e-4  # they vary together
    with pytest.raises(InputError, match="give --urdf"):
        write_applied_model(replace(made, urdf=""), tmp_path / "none")
