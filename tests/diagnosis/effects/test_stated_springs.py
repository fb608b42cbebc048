"""Springs that an MJCF states are nominal: no gap where they are right, their difference named where not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.gradients import gradient
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds
from tests.diagnosis.effects.test_stated_friction import described
from tests.diagnosis.worlds import LIFT

K, REST = 4.0, 0.3  # [N m/rad], [rad]
TRUTH = {"cable_stiffness": {LIFT: K}, "cable_rest": {LIFT: REST}}


def stated(stiffness: float, rest: float = REST) -> str:
    """The tests' URDF with a spring at the lifting joint."""
    end = '<limit lower="-2.8" upper="2.8" effort="40" velocity="3"/>\n</joint><joint name="bend"'
    said = f'<dynamics damping="0" stiffness="{stiffness}" springref="{rest}"/>'
    assert end in worlds.URDF
    return worlds.URDF.replace(end, end.replace("</joint>", f"{said}</joint>"))


def sprung() -> ArmDescription:
    return replace(worlds.arm(), urdf=stated(3.0))


def test_an_mjcfs_springs_are_in_the_inverse_dynamics(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    text = (
        '<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 1 0" stiffness="2.5" '
        'springref="0.4" ref="0.1"/><geom size="0.05" mass="0.3" pos="0.1 0 0"/><body pos="0.2 0 0">'
        '<joint name="b" type="slide" axis="1 0 0" stiffness="30" springref="-0.02"/>'
        '<geom size="0.05" mass="0.2"/></body></body></worldbody></mujoco>'
    )
    path = tmp_path / "finger.xml"
    path.write_text(text)
    read = read_model(path)
    assert not any("spring" in note for note in read.notes)
    rigid = RigidArm(ArmDescription("tool_arm", ("a", "b"), read.urdf, None))
    model = mujoco.MjModel.from_xml_string(text)
    data, rng = mujoco.MjData(model), np.random.default_rng(1)
    for _ in range(3):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a = rng.normal(size=(3, 2))
        mujoco.mj_inverse(model, data)
        assert np.allclose(rigid.inverse_dynamics(q[None], v[None], a[None])[0], data.qfrc_inverse, atol=1e-9)


def test_a_spring_bends_the_derivative_and_not_the_tilt() -> None:
    bare, with_spring = RigidArm(worlds.arm()), RigidArm(sprung())
    q = np.array([[0.1, -0.4, 0.7]])
    still = np.zeros_like(q)
    more = with_spring.position_derivative(q, still, still) - bare.position_derivative(q, still, still)
    assert np.allclose(more[0], np.diag([0.0, 3.0, 0.0]), atol=1e-9)
    (recording,) = worlds.record(worlds.plant(), "A", np.random.default_rng(2))
    plain, other = worlds.trials([recording]), worlds.trials(described([recording], stated(3.0)))
    assert np.allclose(plain[0].tilt, other[0].tilt, atol=1e-9)


def test_a_simulated_spring_is_the_stated_and_the_plants_own() -> None:
    command = worlds.commanded("A", 2.0)
    assert command.position is not None and command.velocity is not None
    start = command.position[0], command.velocity[0]
    # 3 (q - 0.3) + 1 (q + 0.1) = 4 (q - 0.2)
    own = worlds.plant(cable_stiffness={LIFT: 1.0}, cable_rest={LIFT: -0.1})
    half = ClosedLoop(LoopModel(sprung())).rollout(command, *start, [own], 2.0)
    whole = worlds.rollout(worlds.plant(cable_stiffness={LIFT: 4.0}, cable_rest={LIFT: 0.2}), "A", 2.0)
    assert np.allclose(half.position, whole.position, atol=1e-9)
    assert not np.allclose(half.position, worlds.rollout(PlantParameters(), "A", 2.0).position, atol=1e-5)


@pytest.mark.parametrize("name", ["cable_stiffness", "cable_rest"])
def test_derivatives_see_the_stated_spring(name: str) -> None:
    loop, time = ClosedLoop(LoopModel(sprung())), 0.1
    command: JointSignal = worlds.commanded("A", time)
    assert command.position is not None and command.velocity is not None
    start = command.position[0], command.velocity[0]
    values = {"cable_stiffness": np.array([0.0, 1.0, 0.0]), "cable_rest": np.array([0.0, -0.1, 0.0])}

    def end(run: Rollouts) -> np.ndarray:
        return run.commanded_effort[:, -1, LIFT]

    def value(step: float) -> float:
        moved = values | {name: values[name] + step * np.eye(3)[LIFT]}
        return float(end(loop.rollout(command, *start, [PlantParameters(**moved)], time))[0])

    def last(run: Rollouts) -> tuple[np.ndarray, Rollouts]:
        weights = Rollouts(run.time, *(np.zeros_like(run.position) for _ in range(4)))
        weights.commanded_effort[:, -1, LIFT] = 1.0
        return end(run), weights

    found = gradient(loop, command, *start, [PlantParameters(**values)], time, last)
    wanted = (value(1e-3) - value(-1e-3)) / 2e-3
    assert found.plants[0][name][LIFT] == pytest.approx(wanted, rel=1e-4)


def test_a_negative_spring_is_refused_with_its_joint() -> None:
    with pytest.raises(InputError, match=r"joint 'lift'.*stiffness is -1, must be zero or more"):
        joint_dynamics(replace(worlds.arm(), urdf=stated(-1.0)))


@pytest.mark.parametrize(
    "said", [K, pytest.param(3.0, marks=pytest.mark.thorough), pytest.param(5.5, marks=pytest.mark.thorough)]
)
def test_a_stated_spring_is_no_cause_and_its_difference_is(said: float) -> None:
    """Also where the machine's spring is softer than the model's."""
    a, b, c = described(worlds.world(5, **TRUTH), stated(said))
    diagnosis, _ = diagnose([a, b], [c], DiagnosisSettings(library={"cable", "coulomb_friction"}))
    if said == K:
        assert diagnosis.verdict == "no_gap", [e.name for e in diagnosis.effects]
        return
    assert [e.name for e in diagnosis.effects] == ["cable@joint:lift"], diagnosis.reasons
    found = diagnosis.effects[0].parameters["k"]
    assert found.ci95[0] <= K - said <= found.ci95[1]
