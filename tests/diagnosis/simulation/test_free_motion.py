"""The rigid-body part against Pinocchio, PyBullet and MuJoCo, and against conservation of energy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis.simulation.arms import ARMS, free, still

TOOL_FREE = {name: (replace(arm, tool=None), start) for name, (arm, start) in ARMS.items()}


def _velocity(joints: int) -> np.ndarray:
    return np.linspace(0.8, -0.6, joints) if joints > 1 else np.array([0.7])


@pytest.mark.parametrize("name", ARMS)
def test_one_step_is_pinocchios_forward_dynamics(name: str) -> None:
    arm, start = ARMS[name]
    loop = ClosedLoop(LoopModel(free(arm)))
    rng = np.random.default_rng(3)
    for _ in range(5):
        q, dq = start + rng.normal(0, 0.6, len(start)), rng.normal(0, 1.5, len(start))
        run = loop.rollout(still(start), q, dq, [PlantParameters()], 0.001)
        ddq = (run.velocity[0, 1] - run.velocity[0, 0]) / 0.001
        torque = loop.model.rigid.inverse_dynamics(q[None], dq[None], ddq[None])[0]
        assert np.abs(torque).max() < 1e-9 * max(1.0, np.abs(loop.model.rigid.gravity(q[None])).max()) * 10
        np.testing.assert_allclose(run.position[0, 1], q + 0.001 * run.velocity[0, 1], atol=1e-14)


@pytest.mark.parametrize("name", ARMS)
def test_trajectory_is_pinocchios(name: str) -> None:
    """300 steps under the described controller against Pinocchio's ABA in Python."""
    arm, start = ARMS[name]
    loop = ClosedLoop(LoopModel(arm))
    target = start + 0.1
    run = loop.rollout(still(target), start, _velocity(len(start)), [PlantParameters()], 0.3)
    assert arm.controller is not None
    q, dq = start.copy(), _velocity(len(start))
    model, data = loop.model.rigid.model, loop.model.rigid.data
    index = [model.joints[model.getJointId(name)].idx_v for name in arm.joints]
    for k in range(300):
        u = (
            arm.controller.stiffness * (target - q)
            - arm.controller.damping * dq
            + loop.model.rigid.gravity(q[None])[0]
        )
        u = np.clip(u, -loop.model.effort_limit, loop.model.effort_limit)
        np.testing.assert_allclose(run.commanded_effort[0, k], u, atol=1e-8)
        full_u = np.zeros(model.nv)
        full_u[index] = u
        ddq = pin.aba(
            model, data, loop.model.rigid._full_q(q[None])[0], loop.model.rigid._full_v(dq[None])[0], full_u
        )[index]
        dq = dq + 0.001 * ddq
        q = q + 0.001 * dq
        np.testing.assert_allclose(run.position[0, k + 1], q, atol=1e-9)
    np.testing.assert_allclose(
        run.effort, run.commanded_effort, atol=1e-12
    )  # nothing between drive and sensor


@pytest.mark.parametrize("name", ARMS)
def test_energy_error_shrinks_with_the_step(name: str) -> None:
    arm, start = ARMS[name]
    drift = []
    for substeps in (1, 10):
        loop = ClosedLoop(LoopModel(free(arm), substeps=substeps))
        run = loop.rollout(still(start), start, _velocity(len(start)), [PlantParameters()], 0.2)
        energy = [_energy(loop, run.position[0, k], run.velocity[0, k]) for k in (0, 200)]
        drift.append(abs(energy[1] - energy[0]))
    assert drift[0] < 0.5
    assert drift[1] < drift[0] / 7 + 1e-9  # a first-order method: ten times smaller, where anything is left


def _energy(loop: ClosedLoop, q: np.ndarray, dq: np.ndarray) -> float:
    model, data = loop.model.rigid.model, loop.model.rigid.data
    full_q, full_v = loop.model.rigid._full_q(q[None])[0], loop.model.rigid._full_v(dq[None])[0]
    return pin.computeKineticEnergy(model, data, full_q, full_v) + pin.computePotentialEnergy(
        model, data, full_q
    )


def _without_locked_limits(urdf: str) -> str:
    return urdf.replace('lower="-2" upper="2"', 'lower="-20" upper="20"')


@pytest.mark.parametrize("name", TOOL_FREE)
def test_pybullet_moves_alike(name: str, tmp_path: Path) -> None:
    pybullet = pytest.importorskip("pybullet")
    arm, start = TOOL_FREE[name]
    ours = _ours(arm, start)
    assert arm.urdf is not None
    path = tmp_path / "arm.urdf"
    path.write_text(_without_locked_limits(arm.urdf))
    client = pybullet.connect(pybullet.DIRECT)
    try:
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_MAINTAIN_LINK_ORDER
        body = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        pybullet.setTimeStep(0.001, physicsClientId=client)
        names = {
            pybullet.getJointInfo(body, i, physicsClientId=client)[1].decode(): i
            for i in range(pybullet.getNumJoints(body, physicsClientId=client))
        }
        for i in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
            pybullet.changeDynamics(
                body, i, linearDamping=0, angularDamping=0, jointDamping=0, maxJointVelocity=1e3,
                collisionMargin=0, physicsClientId=client,
            )  # fmt: skip
            if i >= 0:
                pybullet.setCollisionFilterGroupMask(body, i, 0, 0, physicsClientId=client)
                pybullet.setJointMotorControl2(
                    body, i, pybullet.VELOCITY_CONTROL, force=0, physicsClientId=client
                )
        index = [names[joint] for joint in arm.joints]
        for i, q, dq in zip(index, start, _velocity(len(start)), strict=True):
            pybullet.resetJointState(body, i, q, dq, physicsClientId=client)
        error = 0.0
        for k in range(1, 201):
            pybullet.stepSimulation(physicsClientId=client)
            states = pybullet.getJointStates(body, index, physicsClientId=client)
            error = max(error, np.abs(ours[k] - [state[0] for state in states]).max())
    finally:
        pybullet.disconnect(client)
    print(f"PyBullet, {name}: {error:.1e} rad after 0.2 s")
    assert error < 1e-8


@pytest.mark.parametrize("name", TOOL_FREE)
def test_mujoco_moves_alike(name: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    arm, start = TOOL_FREE[name]
    ours = _ours(arm, start)
    assert arm.urdf is not None
    model = _mujoco_model(mujoco, arm)
    data = mujoco.MjData(model)
    index = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint) for joint in arm.joints]
    data.qpos[index], data.qvel[index] = start, _velocity(len(start))
    error = 0.0
    for k in range(1, 201):
        mujoco.mj_step(model, data)
        error = max(error, np.abs(ours[k] - data.qpos[index]).max())
    print(f"MuJoCo, {name}: {error:.1e} rad after 0.2 s")
    assert error < 1e-12


def _ours(arm: ArmDescription, start: np.ndarray) -> np.ndarray:
    run = ClosedLoop(LoopModel(free(arm))).rollout(
        still(start), start, _velocity(len(start)), [PlantParameters()], 0.2
    )
    return run.position[0]


def _mujoco_model(mujoco, arm: ArmDescription):
    """The URDF read by MuJoCo, without meshes, limits or contacts."""
    import re

    assert arm.urdf is not None
    text = re.sub(r"<(visual|collision)\b.*?</\1>", "", arm.urdf, flags=re.DOTALL)
    text = re.sub(r"<dynamics[^>]*/>", "", text)
    option = '<mujoco><compiler fusestatic="false" balanceinertia="false" discardvisual="true"/></mujoco>'
    model = mujoco.MjModel.from_xml_string(re.sub(r"(<robot[^>]*>)", r"\1" + option, text, count=1))
    model.opt.timestep = 0.001
    model.opt.gravity[:] = (0, 0, -9.81)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    model.dof_damping[:] = model.dof_frictionloss[:] = model.dof_armature[:] = 0
    return model
