"""Wrong input is refused by name, and divergence is said, not returned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, DivergenceError
from samrl_core.diagnosis.simulation.jacobian import jacobian
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis.simulation.arms import of_spec, still, swing

START = PANDA.home
ZERO = np.zeros(7)


@pytest.fixture(scope="module")
def loop() -> ClosedLoop:
    return ClosedLoop(LoopModel(of_spec(PANDA)))


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"coulomb": np.nan}, "coulomb"),
        ({"coulomb": np.inf}, "finite"),
        ({"coulomb": np.ones((2, 2))}, "coulomb"),
        ({"backlash": -0.1}, "backlash"),
        ({"joint_stiffness": 0.0}, "above 0"),
        ({"coulomb_velocity": 0.0}, "above 0"),
        ({"command_delay": np.array([0.0, -1e-3])}, "command_delay"),
        ({"payload": np.zeros(4)}, "payload"),
        ({"inertial_delta": np.zeros((7, 9))}, "inertial_delta"),
        ({"gravity": np.array([0, 0, np.nan])}, "gravity"),
        ({"mount_stiffness": 0.0}, "mount stiffness"),
        ({"reading": "both"}, "reading"),
    ],
)
def test_bad_parameters(values: dict, text: str) -> None:
    with pytest.raises(InputError, match=text):
        PlantParameters(**values)


def test_parameters_of_another_arm(loop: ClosedLoop) -> None:
    for plant in (PlantParameters(coulomb=np.ones(6)), PlantParameters(inertial_delta=np.zeros((6, 10)))):
        with pytest.raises(InputError, match="7"):
            loop.rollout(still(START), START, ZERO, [plant], 0.01)


def test_bad_calls(loop: ClosedLoop) -> None:
    plants = [PlantParameters()]
    with pytest.raises(InputError, match="start_position"):
        loop.rollout(still(START), START[:6], ZERO, plants, 0.01)
    with pytest.raises(InputError, match="start_velocity"):
        loop.rollout(still(START), START, ZERO * np.nan, plants, 0.01)
    with pytest.raises(InputError, match="duration"):
        loop.rollout(still(START), START, ZERO, plants, -1.0)
    with pytest.raises(InputError, match="record_every"):
        loop.rollout(still(START), START, ZERO, plants, 0.01, record_every=0)
    with pytest.raises(InputError, match="no plants"):
        loop.rollout(still(START), START, ZERO, [], 0.01)
    with pytest.raises(InputError, match="positions"):
        loop.rollout(JointSignal(np.array([0.0])), START, ZERO, plants, 0.01)
    with pytest.raises(InputError, match="increase"):
        loop.rollout(JointSignal(np.array([0.0, 0.0]), np.tile(START, (2, 1))), START, ZERO, plants, 0.01)
    with pytest.raises(InputError, match="shape|must be"):
        loop.rollout(JointSignal(np.array([0.0]), START[None, :5]), START, ZERO, plants, 0.01)
    with pytest.raises(InputError, match="rotor inertia"):
        loop.rollout(still(START), START, ZERO, [PlantParameters(rotor_inertia=-0.1)], 0.01)


def test_descriptions_that_cannot_be_simulated() -> None:
    arm = of_spec(PANDA)
    with pytest.raises(InputError, match="controller"):
        ClosedLoop(LoopModel(replace(arm, controller=None)))
    with pytest.raises(InputError, match="URDF"):
        ClosedLoop(LoopModel(replace(arm, urdf=None)))
    assert arm.controller is not None
    with pytest.raises(InputError, match="stiffness"):
        ClosedLoop(LoopModel(replace(arm, controller=replace(arm.controller, stiffness=np.ones(3)))))


def test_divergence_names_plant_joint_and_time(loop: ClosedLoop) -> None:
    wild = PlantParameters(viscous=np.where(np.arange(7) == 0, -25.0, 0.0))  # friction that drives
    plants = [PlantParameters(), wild]
    with pytest.raises(DivergenceError, match="plant 1") as caught:
        loop.rollout(swing(START, 1.0), START, ZERO, plants, 1.0)
    assert caught.value.plant == 1 and 0 < caught.value.time_s < 1
    assert caught.value.joint in loop.arm.joints
    kept = loop.rollout(swing(START, 1.0), START, ZERO, plants, 1.0, keep_diverged=True)
    assert np.isfinite(kept.position[0]).all() and np.isnan(kept.position[1, -1]).all()


def test_parameters_without_derivative_are_refused(loop: ClosedLoop) -> None:
    for parameter, text in (
        (("joint_stiffness", 2), "absent"),
        (("presliding_stiffness", 2), "absent"),
        (("backlash", 2), "rigid"),
        (("seed", None), "no derivative"),
        (("coulomb", 9), "index"),
        (("mount_damping", None), "mount is rigid"),
    ):
        with pytest.raises(InputError, match=text):
            jacobian(loop, still(START), START, ZERO, PlantParameters(), 0.01, [parameter])
