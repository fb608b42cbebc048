"""Errors of the description are named as such: scale of masses, order of joints, unit of torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis
from samrl_core.diagnosis.selection.description import Misdescription, misdescription
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


@pytest.mark.slow
def test_torques_in_another_unit_are_named() -> None:
    def in_kgf(signal: JointSignal | None) -> JointSignal:
        assert signal is not None and signal.effort is not None
        return replace(signal, effort=signal.effort / KGF_M)

    found = diagnosed([replace(r, commanded_effort=in_kgf(r.commanded_effort)) for r in recordings()])
    assert found.verdict == "effect" and found.effects[0].name == "unit_error@arm:tool_arm"
    assert found.effects[0].parameters["factor"].value == pytest.approx(KGF_M)
    assert "kgf m" in found.reasons[0]


@pytest.mark.parametrize(
    "joint, factor, turned, says",
    [
        (1, 1e-3, False, "the torques of lift are in N mm or mN m"),
        (2, -1.0, False, "the torques of bend have the other sign"),
        (1, -1.0, True, "lift turns the other way round"),
        (2, 60.0, False, "the torques of bend are before a gear of"),
    ],
)
def test_one_joint_with_a_unit_sign_or_gear_of_its_own(
    joint: int, factor: float, turned: bool, says: str
) -> None:
    """The log is made wrong by the inverse of what mends it."""
    undo = Misdescription("unit_error", (0, 1, 2), 1.0 / factor, "", 0.0, 0.0, joint, turned)
    found = misdescription(worlds.trials([undo.corrected(r) for r in recordings()]))
    assert found is not None and found.joint == joint and found.says.startswith(says)
    assert found.factor == pytest.approx(factor, rel=0.05)
    assert (
        found.named("tool_arm", worlds.arm().joints)[0].name
        == f"unit_error@joint:{worlds.arm().joints[joint]}"
    )


def test_a_sign_is_found_beneath_friction() -> None:
    """Most of the joint's torque is friction, which has either sign: the share of all of it was small."""
    undo = Misdescription("unit_error", (0, 1, 2), -1.0, "", 0.0, 0.0, 2)
    stiff = recordings(viscous=np.array([0.0, 0.0, 4.0]))
    found = misdescription(worlds.trials([undo.corrected(r) for r in stiff]))
    assert found is not None and (found.joint, found.factor, found.turned) == (2, -1.0, False)
    assert found.says == "the torques of bend have the other sign"
    assert misdescription(worlds.trials(stiff)) is None


def test_a_drive_that_gives_half_of_its_torque_is_no_unit() -> None:
    """Nor is a machine with nothing wrong."""
    weak = Misdescription("unit_error", (0, 1, 2), 2.0, "", 0.0, 0.0, 1)
    assert misdescription(worlds.trials([weak.corrected(r) for r in recordings()])) is None
    assert misdescription(worlds.trials(recordings())) is None


@pytest.mark.thorough
def test_masses_off_by_one_factor_are_named_as_that() -> None:
    heavy = 0.4 * RigidArm(worlds.arm()).inertial_parameters
    found = diagnosed(recordings(inertial_delta=heavy))
    assert found.verdict == "effect" and found.effects[0].name == "model_scale@arm:tool_arm"
    (size,) = found.effects[0].parameters.values()
    assert size.value == pytest.approx(1.4, rel=0.05)


@pytest.mark.slow
def test_a_right_description_is_not_doubted() -> None:
    found = diagnosed(recordings(coulomb=np.array([0.0, 3.0, 0.0])))
    assert not {e.family for e in found.effects} & {"joint_order", "unit_error", "model_scale"}
    assert found.effects[0].name == "coulomb_friction@joint:lift"
