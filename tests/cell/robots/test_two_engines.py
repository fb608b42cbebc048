"""The same arms in Pinocchio and in PyBullet, with and without a payload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet
import pytest

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import robots
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.pose import Pose

TOLERANCE = 1e-4
PAYLOAD = Payload(
    0.78, np.array([0.01, -0.02, 0.06]), np.array([[4e-3, 1e-4, 0], [1e-4, 3e-3, 2e-4], [0, 2e-4, 2e-3]])
)
BASE = Pose.from_rpy(np.array([1.0, -0.2, 0.1]), (0.3, -0.2, 2.5))  # tilted: gravity must turn with it


@dataclass(frozen=True, eq=False)
class Pair:
    """One arm in both engines."""

    model: ArmModel
    client: int
    body: int
    joints: list[int]
    link_index: dict[str, int]

    def place(self, q: np.ndarray, dq: np.ndarray) -> None:
        for joint, position, velocity in zip(self.joints, q, dq, strict=True):
            pybullet.resetJointState(self.body, joint, position, velocity, physicsClientId=self.client)


def _with_payload(spec: RobotSpec, folder: Path) -> Path:
    c, i = PAYLOAD.center_of_mass, PAYLOAD.inertia
    extra = f"""
  <link name="load"><inertial><origin xyz="{c[0]} {c[1]} {c[2]}"/><mass value="{PAYLOAD.mass}"/>
    <inertia ixx="{i[0, 0]}" ixy="{i[0, 1]}" ixz="{i[0, 2]}" iyy="{i[1, 1]}" iyz="{i[1, 2]}" izz="{i[2, 2]}"/>
  </inertial></link>
  <joint name="load_fixed" type="fixed"><parent link="{spec.flange}"/><child link="load"/></joint>
</robot>"""
    path = folder / "loaded.urdf"
    path.write_text(spec.urdf.read_text().replace("</robot>", extra))
    return path


@pytest.fixture(params=[(n, loaded) for n in robots() for loaded in (False, True)], ids=str)
def pair(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Pair]:
    name, loaded = request.param
    spec = robots()[name]
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    body = pybullet.loadURDF(
        str(_with_payload(spec, tmp_path) if loaded else spec.urdf),
        BASE.position.tolist(),
        BASE.quat_xyzw.tolist(),
        useFixedBase=True,
        flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
        physicsClientId=client,
    )
    infos = [
        pybullet.getJointInfo(body, k, physicsClientId=client)
        for k in range(pybullet.getNumJoints(body, client))
    ]
    by_name = {info[1].decode(): info[0] for info in infos}
    links = {info[12].decode(): info[0] for info in infos}
    model = ArmModel(spec, BASE, PAYLOAD if loaded else None)
    yield Pair(model, client, body, [by_name[n] for n in spec.joint_names], links)
    pybullet.disconnect(client)


def _draws(model: ArmModel, count: int = 10) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(7)
    limits = model.spec.limits
    for _ in range(count):
        yield rng.uniform(limits.lower, limits.upper), rng.uniform(-1, 1, 7), rng.uniform(-3, 3, 7)


def test_every_link_stands_where_the_other_engine_puts_it(pair: Pair) -> None:
    for q, dq, _ in _draws(pair.model):
        pair.place(q, dq)
        poses = pair.model.link_poses_in_world(q)
        assert len(poses) == 9
        assert next(iter(poses)) == pair.model.spec.base_link
        assert poses[pair.model.spec.base_link].angle_to(BASE) < TOLERANCE
        for name, index in pair.link_index.items():
            if name == "load":
                continue
            state = pybullet.getLinkState(
                pair.body, index, computeForwardKinematics=True, physicsClientId=pair.client
            )
            np.testing.assert_allclose(poses[name].position, state[4], atol=TOLERANCE)
            assert poses[name].angle_to(Pose(np.array(state[4]), np.array(state[5]))) < 1e-3


def test_mass_matrix(pair: Pair) -> None:
    for q, dq, _ in _draws(pair.model):
        pair.place(q, dq)
        other = pybullet.calculateMassMatrix(pair.body, q.tolist(), physicsClientId=pair.client)
        np.testing.assert_allclose(pair.model.mass_matrix(q), np.array(other), atol=TOLERANCE)


def test_inverse_dynamics(pair: Pair) -> None:
    """With an upright base: PyBullet's function takes gravity in the axes of a tilted base as it stands.

    Gravity on a tilted base is compared by the simulated step below.
    """
    upright = ArmModel(pair.model.spec, Pose.identity(), PAYLOAD if "load" in pair.link_index else None)
    for q, dq, ddq in _draws(pair.model):
        pair.place(q, dq)
        other = pybullet.calculateInverseDynamics(
            pair.body, q.tolist(), dq.tolist(), ddq.tolist(), physicsClientId=pair.client
        )
        np.testing.assert_allclose(upright.inverse_dynamics(q, dq, ddq), other, atol=TOLERANCE)


def test_jacobian(pair: Pair) -> None:
    flange = pair.link_index[pair.model.spec.flange]
    for q, dq, _ in _draws(pair.model):
        pair.place(q, dq)
        zeros = [0.0] * 7
        local = pybullet.getLinkState(pair.body, flange, physicsClientId=pair.client)[2]
        linear, angular = pybullet.calculateJacobian(
            pair.body, flange, [-x for x in local], q.tolist(), zeros, zeros, physicsClientId=pair.client
        )
        np.testing.assert_allclose(pair.model.jacobian(q), np.vstack([linear, angular]), atol=TOLERANCE)


def test_simulated_step_has_the_predicted_acceleration(pair: Pair) -> None:
    """Torque in, one short step, velocity out: the engine that the world steps agrees too."""
    h = 1e-4
    pybullet.setTimeStep(h, physicsClientId=pair.client)
    for k in range(-1, pybullet.getNumJoints(pair.body, pair.client)):
        pybullet.changeDynamics(
            pair.body, k, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=pair.client
        )
    pybullet.setJointMotorControlArray(
        pair.body, pair.joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * 7, physicsClientId=pair.client
    )
    q = pair.model.spec.home
    dq, tau = np.full(7, 0.2), pair.model.gravity(q) + 0.05
    pair.place(q, dq)
    pybullet.setJointMotorControlArray(
        pair.body, pair.joints, pybullet.TORQUE_CONTROL, forces=tau.tolist(), physicsClientId=pair.client
    )
    pybullet.stepSimulation(physicsClientId=pair.client)
    states = pybullet.getJointStates(pair.body, pair.joints, physicsClientId=pair.client)
    velocity = np.array([state[1] for state in states])
    np.testing.assert_allclose(
        (velocity - dq) / h, pair.model.forward_dynamics(q, dq, tau), rtol=1e-2, atol=1e-2
    )
