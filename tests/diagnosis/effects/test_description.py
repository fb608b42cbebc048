"""Errors of the description are named as such: scale of masses, order of joints, unit of torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis
from samrl_core.diagnosis.selection.description import Misdescription
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds

KGF_M = 9.80665  # [N m]


def recordings(**fields: object) -> list[ArmRecording]:
    """A and C of a plant with a background, as a machine without torque sensors has them."""
    rng = np.random.default_rng(3)
    real = worlds.merged(replace(PlantParameters(), **fields), worlds.background(rng))
    return [replace(r, states=replace(r.states, effort=None)) for r in worlds.record(real, "AC", rng)]


def diagnosed(made: list[ArmRecording]) -> Diagnosis:
    return diagnose(made[:1], made[1:], DiagnosisSettings(share_held_out=False))[0]


@pytest.mark.thorough
def test_columns_under_each_others_names_are_named() -> None:
    mixed = [Misdescription("joint_order", (0, 2, 1), 1.0, "", 0.0, 0.0).corrected(r) for r in recordings()]
    found = diagnosed(mixed)
    assert found.verdict == "effect" and found.effects[0].name == "joint_order@arm:tool_arm"
    assert found.reasons[0].startswith("this log fits if lift and bend are exchanged")
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.6


@pytest.mark.thorough
def test_torques_in_another_unit_are_named() -> None:
    def in_kgf(signal: JointSignal | None) -> JointSignal:
        assert signal is not None and signal.effort is not None
        return replace(signal, effort=signal.effort / KGF_M)

    found = diagnosed([replace(r, commanded_effort=in_kgf(r.commanded_effort)) for r in recordings()])
    assert found.verdict == "effect" and found.effects[0].name == "unit_error@arm:tool_arm"
    assert found.effects[0].parameters["factor"].value == pytest.approx(KGF_M)
    assert "kgf m" in found.reasons[0]


def test_masses_off_by_one_factor_are_named_as_that() -> None:
    heavy = 0.4 * RigidArm(worlds.arm()).inertial_parameters
    found = diagnosed(recordings(inertial_delta=heavy))
    assert found.verdict == "effect" and found.effects[0].name == "model_scale@arm:tool_arm"
    (size,) = found.effects[0].parameters.values()
    assert size.value == pytest.approx(1.4, rel=0.05)


@pytest.mark.thorough
def test_a_right_description_is_not_doubted() -> None:
    found = diagnosed(recordings(coulomb=np.array([0.0, 3.0, 0.0])))
    assert not {e.family for e in found.effects} & {"joint_order", "unit_error", "model_scale"}
    assert found.effects[0].name == "coulomb_friction@joint:lift"
