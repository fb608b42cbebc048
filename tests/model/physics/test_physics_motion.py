"""Motion against MuJoCo, closed forms and conservation laws."""

from __future__ import annotations

import contact_cases
import numpy as np
import physics_scenes as scenes
import pytest
import torch
from gradient_check import Case, inputs

from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import WORLD, ContactPair, Joint, JointKind, PhysicsBody, PhysicsScene
from samrl_core.model.physics.shapes import plane
from samrl_core.model.physics.state import PhysicsAction, PhysicsState
from samrl_core.studies.speed import physics_scenes as common


def run(case: Case, dtype: torch.dtype = torch.float64) -> PhysicsState:
    model = PhysicsModel(case.scene, dtype)
    values = inputs(case, model)
    action = PhysicsAction(values["velocity"], values["wrench"])
    return model.rollout(PhysicsState(values["q"], values["v"]), action, model.parameters(1))


def mujoco_chain() -> str:
    inertia = scenes.cylinder_inertia(0.05, 0.02, 0.1)
    bodies = "".join(
        f'<body pos="0 0 {-0.1 if i else 0}"><inertial pos="0 0 -0.05" mass="0.05" '
        f'diaginertia="{inertia[0, 0]} {inertia[1, 1]} {inertia[2, 2]}"/>'
        '<joint type="hinge" axis="1 0 0" damping="0.001"/><joint type="hinge" axis="0 1 0" damping="0.001"/>'
        for i in range(10)
    )
    return f'<mujoco><option timestep="{1 / 240}"/><worldbody>{bodies}{"</body>" * 10}</worldbody></mujoco>'


@pytest.mark.parametrize(("dtype", "limit"), [(torch.float64, 1e-9), (torch.float32, 1e-4)])
def test_free_chain_is_mujocos(dtype: torch.dtype, limit: float) -> None:
    """MuJoCo's Euler steps with implicit damping are the same equations: 30 steps, 20 DoF."""
    mujoco = pytest.importorskip("mujoco")
    rng = np.random.default_rng(0)
    q, v = 0.4 * rng.normal(size=20), rng.normal(size=20)
    states = run(contact_cases.case(common.free_chain(), q, v, 30, None), dtype)
    model = mujoco.MjModel.from_xml_string(mujoco_chain())
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    for k in range(30):
        mujoco.mj_step(model, data)
        assert np.abs(states.q[k + 1, 0].numpy() - data.qpos).max() < limit * np.abs(data.qpos).max()
        assert np.abs(states.v[k + 1, 0].numpy() - data.qvel).max() < 10 * limit * np.abs(data.qvel).max()


def test_sliding_disc_against_closed_form() -> None:
    """x = v t - mu g t^2 / 2 while it slides, v^2 / (2 mu g) when it has stopped."""
    sliding = run(contact_cases.disc(24, 0.0, 0.5)).q[-1, 0, 0].item()
    assert sliding == pytest.approx(0.5 * 0.1 - 0.5 * 0.3 * 9.81 * 0.1**2, rel=0.02)
    finer = common.disc_on_plane(step_s=1 / 480)  # the end error of a first-order step: 2.4 % at 240 Hz
    q = np.array([0, 0, 0.01 - contact_cases.SAG, 0, 0, 0, 1.0])
    stopped = run(contact_cases.case(finer, q, np.array([0.5, 0, 0, 0, 0, 0]), 144, None))
    assert stopped.q[-1, 0, 0].item() == pytest.approx(0.5**2 / (2 * 0.3 * 9.81), rel=0.02)
    assert abs(stopped.v[-1, 0, 0].item()) < 1e-6


def test_disc_rests_at_the_depth_that_carries_it() -> None:
    states = run(contact_cases.disc(240, 0.003, 0.0))
    assert states.q[-1, 0, 2].item() == pytest.approx(0.01 - contact_cases.SAG, abs=1e-6)


@pytest.mark.parametrize(("slope", "slips"), [(0.25, False), (0.35, True)])
def test_friction_cone_on_a_slope(slope: float, slips: bool) -> None:
    """On a slope of tangent 0.25 a disc of friction 0.3 holds (it creeps), at 0.35 it slides."""
    flat = common.disc_on_plane()
    angle = np.arctan(slope)
    gravity = (9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
    scene = PhysicsScene(flat.bodies, flat.world_shapes, flat.contacts, gravity)
    q = np.array([0, 0, 0.01 - contact_cases.SAG, 0, 0, 0, 1.0])
    speed = run(contact_cases.case(scene, q, np.zeros(6), 120, None)).v[-1, 0, 0].item()
    if slips:
        assert speed == pytest.approx(9.81 * 0.5 * (np.sin(angle) - 0.3 * np.cos(angle)), rel=0.02)
    else:  # slip speed times tan(asin(share of the cone that is used))
        used = slope / 0.3
        assert speed == pytest.approx(1e-3 * used / np.sqrt(1 - used**2), rel=0.05)


def test_ball_rolls_down_a_slope() -> None:
    """One point with a radius is a ball: without slip it falls with 5/7 of g sin(angle)."""
    angle = 0.1
    ball = PhysicsBody("ball", 0.2, 0.4 * 0.2 * 0.03**2 * np.eye(3), (Joint(JointKind.FREE),))
    pair = ContactPair(0, np.zeros((1, 3)), WORLD, 0, 0.03)
    gravity = (9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
    scene = PhysicsScene((ball,), (plane(),), (pair,), gravity, slip_speed=1e-4)
    q = np.array([0, 0, 0.03 - 0.2 * 9.81 / 5e3, 0, 0, 0, 1.0])
    states = run(contact_cases.case(scene, q, np.zeros(6), 240, None))
    speed = states.v[-1, 0, 0].item()
    assert speed == pytest.approx(5 / 7 * 9.81 * np.sin(angle), rel=0.01)
    assert states.v[-1, 0, 4].item() * 0.03 == pytest.approx(speed, rel=0.02)


def energy(states: PhysicsState, inertia: np.ndarray, mass: float) -> np.ndarray:
    """Kinetic and potential energy of one free body, (T + 1,) [J]."""
    v = states.v[:, 0].numpy()
    quat = states.q[:, 0, 3:].numpy()
    x, y, z, w = quat.T
    rotation = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )
    spin = np.einsum("tji,tj->ti", rotation, v[:, 3:])
    moving = 0.5 * mass * (v[:, :3] ** 2).sum(axis=1) + 0.5 * (spin @ inertia * spin).sum(axis=1)
    return moving + mass * 9.81 * states.q[:, 0, 2].numpy()


def test_energy_of_a_tumbling_disc_does_not_grow() -> None:
    """Thrown on its rim, it bounces, rolls and falls over; every step may only lose energy."""
    q = np.array([0, 0, 0.12, *(np.array([0.5, 0.1, 0.0, 0.86]) / np.linalg.norm([0.5, 0.1, 0.0, 0.86]))])
    states = run(
        contact_cases.case(common.disc_on_plane(), q, np.array([0.4, 0.1, -0.5, 1, 2, 0.5]), 480, None)
    )
    total = energy(states, scenes.cylinder_inertia(0.1, 0.08, 0.02), 0.1)
    assert total[-1] < 0.3 * total[0]
    # In flight the explicit step of the gyroscopic torque turns a little work up; compare with the start's.
    assert np.diff(total).max() < 1e-3 * total[0]
    assert total.max() < total[0] * (1 + 1e-3)


def test_momentum_of_two_free_bodies_is_kept() -> None:
    """A ball hits a free plate: what one gets the other gives, in momentum and angular momentum."""
    from samrl_core.model.physics.shapes import box

    free = Joint(JointKind.FREE)
    plate = PhysicsBody(
        "plate", 0.3, np.diag([1e-4, 1e-4, 2e-4]), (free,), shapes=(box((0.05, 0.05, 0.005), 0.001),)
    )
    ball = PhysicsBody("ball", 0.1, 1e-5 * np.eye(3), (free,))
    pair = ContactPair(1, np.zeros((1, 3)), 0, 0, 0.01, friction=0.5)
    scene = PhysicsScene((plate, ball), (), (pair,), gravity=(0.0, 0.0, 0.0))
    q = np.array([0, 0, 0, 0, 0, 0, 1, 0.02, 0.01, 0.018, 0, 0, 0, 1.0])
    v = np.array([0, 0, 0, 0, 0, 0, 0.2, 0, -0.5, 0, 3.0, 0])
    states = run(contact_cases.case(scene, q, v, 12, None))
    end = states.v[-1, 0].numpy()
    assert 0.3 * end[:3] + 0.1 * end[6:9] == pytest.approx(0.1 * v[6:9], abs=1e-12)
    assert np.linalg.norm(end[:3]) > 0.01  # it did hit


def test_light_links_far_from_the_origin_keep_their_precision() -> None:
    """Half-gram links half a metre away move in float32 as in float64: inertia is taken about the link."""
    near, far = contact_cases.thread(40), contact_cases.thread(40)
    far.q[:2] += torch.tensor([0.5, 0.25])
    scene = PhysicsScene(far.scene.bodies, far.scene.world_shapes, ())
    single = run(Case(scene, far.q, far.v, far.velocity, far.wrench), torch.float32)
    double = run(Case(scene, near.q, near.v, near.velocity, near.wrench))
    assert float((single.q[-1, 0, 7:].double() - double.q[-1, 0, 7:]).abs().max()) < 1e-4
