"""All engines, without mismatch, move as the nominal arm model says."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.blind_test.engines.arm_body import (
    ArmBody,
    MovingLink,
    join_mass,
    read_arm_body,
    scaled_inertia,
    second_moments,
)
from samrl_core.blind_test.engines.engines import ENGINES, make_engine
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.nominal import ARMATURE, nominal_arm
from samrl_core.blind_test.worlds.plan import PlanItem
from samrl_core.cell.types.arm_description import STANDARD_GRAVITY
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError


@pytest.mark.parametrize("role", ["tool_arm", "camera_arm"])
@pytest.mark.parametrize("engine", ENGINES)
def test_mass_matrix_and_gravity_are_those_of_the_arm_model(role: str, engine: str) -> None:
    arm = nominal_arm(role)
    made = make_engine(engine, arm.body, 0.001, np.zeros(7), np.zeros(7))
    made.gravity(np.array(STANDARD_GRAVITY))
    made.place(arm.spec.home)
    mass, bias = made.dynamics()
    made.close()
    assert np.allclose(mass + np.diag(ARMATURE[role]), arm.model.mass_matrix(arm.spec.home), atol=1e-9)
    assert np.allclose(bias, arm.model.gravity(arm.spec.home), atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_link_whose_principal_axes_change_places_keeps_its_inertia(engine: str) -> None:
    moments = np.array([0.02, 0.03, 0.01])  # about x, y, z: the least is about z
    found = []
    for axis in np.eye(3):
        link = MovingLink(
            "one", "first", Pose.identity(), axis, 1.0, np.zeros(3), np.diag(moments), slides=False
        )
        made = make_engine(engine, ArmBody((link,), Pose.identity()), 0.001, np.zeros(1), np.zeros(1))
        made.place(np.zeros(1))
        found.append(made.dynamics()[0][0, 0])
        made.close()
    assert np.allclose(found, moments, atol=1e-9)


@pytest.mark.parametrize("role", ["tool_arm", "camera_arm"])
@pytest.mark.parametrize(
    ("engine", "most", "later"),  # `later`: share of the end velocity in the one that the bias is taken at
    [("pybullet", 1e-6, 0.0), ("mujoco", 0.06, 0.0), ("pinocchio", 1e-6, 0.5)],
)
def test_noise_free_effort_is_inverse_dynamics(role: str, engine: str, most: float, later: float) -> None:
    arm = nominal_arm(role)
    trace = world._run(PlanItem("", "none", engine, role, 0, (), 1.0, 0, 1.2), "B", [], 0, None, 0)
    acceleration = np.diff(trace.velocity, axis=0) / 0.001
    middle = trace.position + 0.0005 * trace.velocity  # of the period: where Bullet evaluates it
    velocity = (1.0 - later) * trace.velocity[:-1] + later * trace.velocity[1:]
    links = [
        arm.model.inverse_dynamics(q, v, a) - ARMATURE[role] * a
        for q, v, a in zip(middle[:-1], velocity, acceleration, strict=True)
    ]
    assert np.abs(np.array(links) - trace.effort[:-1]).max() < most  # MuJoCo: two steps in a period
    assert np.abs(acceleration).max() > 3.0  # the arm did move


def test_commanded_effort_is_the_described_law() -> None:
    arm = nominal_arm("tool_arm")
    item = PlanItem("", "none", "pybullet", "tool_arm", 0, (), 1.0, 0, 0.5)
    trace = world._run(item, "C", [], 0, None, 0)
    controller = world.description("tool_arm", "C", world.Tolerances()).controller
    assert controller is not None and controller.stiffness[1] < arm.spec.controller.stiffness[1]
    command = world.world_command("tool_arm", 0, "C", 0.5)
    for k in (0, 200, 450):
        law = controller.stiffness * (command.position[k] - trace.position[k])
        law += controller.damping * (command.velocity[k] - trace.velocity[k])
        law += arm.model.gravity(trace.position[k])
        assert np.allclose(law, trace.commanded[k], atol=1e-9)


def test_altered_bodies_stay_real() -> None:
    rng = np.random.default_rng(0)
    for role in ("tool_arm", "camera_arm"):
        for link in nominal_arm(role).body.links:
            inertia = scaled_inertia(link.inertia, 1.0 + 0.06 * rng.uniform(-1, 1, size=3))
            assert np.linalg.eigvalsh(second_moments(inertia))[0] > 0
            joined = join_mass(
                link, 0.5, rng.normal(size=3) * 0.1, 1e-4 * np.eye(3), link.placement_in_parent
            )
            assert np.linalg.eigvalsh(second_moments(joined.inertia))[0] > 0
            assert joined.mass == pytest.approx(link.mass + 0.5)


def test_unknown_engine_is_refused() -> None:
    with pytest.raises(InputError, match="known are"):
        make_engine("ode", read_arm_body(nominal_arm("tool_arm").spec), 0.001, np.zeros(7), np.zeros(7))
