"""Friction and rotors that the URDF states are nominal: no gap where they are right, named where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis import worlds
from tests.diagnosis.worlds import ARMATURE, LIFT

FRICTIONS = {"coulomb_friction", "viscous_friction"}
TRUTH = {"coulomb": {LIFT: 0.8}, "viscous": {LIFT: 0.5}}


def stated(friction: float, damping: float, armature: float = 0.0) -> str:
    """The tests' URDF with losses at the lifting joint."""
    end = '<limit lower="-2.8" upper="2.8" effort="40" velocity="3"/>\n</joint><joint name="bend"'
    said = f'<dynamics friction="{friction}" damping="{damping}" armature="{armature}"/>'
    assert end in worlds.URDF
    return worlds.URDF.replace(end, end.replace("</joint>", f"{said}</joint>"))


def described(recordings: list[ArmRecording], urdf: str) -> list[ArmRecording]:
    """The same recordings with another model."""
    return [replace(r, arm=replace(r.arm, urdf=urdf)) for r in recordings]


def test_losses_and_rotors_are_read_in_the_order_of_the_arm() -> None:
    arm = replace(worlds.arm(), urdf=stated(0.8, 0.5, 0.3), controller=None)
    found = joint_dynamics(arm)
    assert found.friction.tolist() == [0.0, 0.8, 0.0] and found.damping.tolist() == [0.0, 0.5, 0.0]
    assert found.armature.tolist() == [0.0, 0.3, 0.0]
    # the controller's text is the word on rotors
    assert np.array_equal(joint_dynamics(replace(arm, controller=worlds.arm().controller)).armature, ARMATURE)


def test_negative_friction_is_refused_with_its_joint() -> None:
    with pytest.raises(InputError, match=r"joint 'lift'.*friction is -1, must be zero or more"):
        joint_dynamics(replace(worlds.arm(), urdf=stated(-1.0, 0.0)))


def test_simulated_friction_is_the_stated_and_the_plants_own() -> None:
    arm = replace(worlds.arm(), urdf=stated(0.3, 0.2))
    command = worlds.commanded("A", 2.0)
    assert command.position is not None and command.velocity is not None
    start = command.position[0], command.velocity[0]
    half = ClosedLoop(LoopModel(arm)).rollout(
        command, *start, [worlds.plant(coulomb={LIFT: 0.5}, viscous={LIFT: 0.3})], 2.0
    )
    whole = worlds.rollout(worlds.plant(**TRUTH), "A", 2.0)
    assert np.allclose(half.position, whole.position, atol=1e-9)
    assert not np.allclose(half.position, worlds.rollout(PlantParameters(), "A", 2.0).position, atol=1e-5)


@pytest.mark.slow
def test_a_model_that_states_the_friction_has_no_gap() -> None:
    a, b, c = described(worlds.world(3, **TRUTH), stated(0.8, 0.5))
    diagnosis, _ = diagnose([a, b], [c])
    assert diagnosis.verdict == "no_gap", [e.name for e in diagnosis.effects]


@pytest.mark.parametrize("said, missing", [(0.3, 0.5), (1.4, -0.6)])
def test_what_the_model_states_wrongly_is_named_by_its_difference(said: float, missing: float) -> None:
    """Also where the machine has less friction than the model."""
    a, b, c = described(worlds.world(4, **TRUTH), stated(said, 0.5))
    diagnosis, _ = diagnose([a, b], [c], DiagnosisSettings(library=FRICTIONS))
    assert [e.name for e in diagnosis.effects] == ["coulomb_friction@joint:lift"], diagnosis.reasons
    found = diagnosis.effects[0].parameters["Fc"]
    assert found.ci95[0] <= missing <= found.ci95[1]
    assert found.value == pytest.approx(missing, rel=0.1)
    assert diagnosis.gap is not None and diagnosis.gap.shrink is not None and diagnosis.gap.shrink > 0.6
