"""Bodies that MuJoCo and PyBullet move: tosses that end on a table, slides, bounces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco as _mujoco
import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyModel, BodyRecording, Support
from tests.diagnosis.bodies.body_worlds import World, seen

mujoco: Any = _mujoco  # its compiled names have no stubs

CUBE = BodyModel("cube", "box", (0.1, 0.1, 0.1), 0.37)
BLOCK = BodyModel("block", "box", (0.12, 0.1, 0.04), 0.5)
BALL = BodyModel("ball", "sphere", (0.03,), 0.05)
STEP = 2.5e-4  # [s]


def _mujoco_model(world: World, body: BodyModel) -> Any:
    half = " ".join(f"{0.5 * s}" for s in body.sizes) if body.shape == "box" else f"{body.sizes[0]}"
    gravity = " ".join(map(str, world.gravity))
    centre = " ".join(map(str, world.center))
    assert body.mass is not None
    inertia = " ".join(f"{body.mass * i}" for i in world.gyration)
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{STEP}" gravity="{gravity}" cone="elliptic" impratio="20"
        integrator="implicitfast"/>
        <worldbody><geom type="plane" size="5 5 .1" friction="{world.friction} 0 0"/>
        <body name="b"><freejoint/><inertial pos="{centre}" mass="{body.mass}" diaginertia="{inertia}"/>
        <geom type="{body.shape}" size="{half}" friction="{world.friction} 0 0" solref="0.003 1"/></body>
        </worldbody></mujoco>"""
    )


def in_mujoco(
    world: World, body: BodyModel, rng: np.random.Generator, seconds: float, start: np.ndarray,
    velocity: np.ndarray, spin: np.ndarray, turned: Rotation,
) -> BodyRecording:  # fmt: skip
    """Poses of the body's frame from a start, with the world's drag applied at the centre of mass."""
    model = _mujoco_model(world, body)
    data = mujoco.MjData(model)
    data.qpos[:] = [*start, *turned.as_quat()[[3, 0, 1, 2]]]
    data.qvel[:] = [*velocity, *spin]
    every = round(1.0 / world.tracker.rate / STEP)
    position, quats, times = [], [], []
    for k in range(round(seconds / STEP)):
        if k % every == 0:
            mujoco.mj_forward(model, data)
            position.append(data.xipos[1].copy())
            quats.append(data.qpos[[4, 5, 6, 3]].copy())
            times.append(k * STEP)
        speed = data.cvel[1, 3:] + np.cross(data.cvel[1, :3], data.xipos[1] - data.subtree_com[1])
        data.xfrc_applied[1, :3] = -body.mass * world.drag * np.linalg.norm(speed) * speed
        mujoco.mj_step(model, data)
    track = seen(world, np.array(times), np.array(position), Rotation.from_quat(np.array(quats)), rng)
    return BodyRecording("mujoco", "made by a test", "0" * 64, track, body)


def tossed_cube(world: World, rng: np.random.Generator, seconds: float = 1.2) -> BodyRecording:
    """A cube that flies, hits the table on a corner, tumbles and comes to rest."""
    angle = rng.uniform(0, 2 * np.pi)
    velocity = np.array([1.2 * np.cos(angle), 1.2 * np.sin(angle), rng.uniform(1.0, 2.0)])
    made = in_mujoco(
        world, CUBE, rng, seconds, np.array([0, 0, rng.uniform(0.4, 0.6)]), velocity,
        rng.uniform(-6, 6, 3), Rotation.random(random_state=int(rng.integers(1 << 30))),
    )  # fmt: skip
    return _on(made, Support(friction=0.3))


def sliding_block(world: World, rng: np.random.Generator, seconds: float = 1.2) -> BodyRecording:
    """A block that slides flat on the table until it rests, turning a little."""
    angle = rng.uniform(0, 2 * np.pi)
    velocity = np.array([1.3 * np.cos(angle), 1.3 * np.sin(angle), 0.0])
    made = in_mujoco(
        world, BLOCK, rng, seconds, np.array([0, 0, 0.0199]), velocity, np.array([0, 0, rng.uniform(-1, 1)]),
        Rotation.from_euler("z", rng.uniform(0, 6)),
    )  # fmt: skip
    return _on(made, Support(friction=0.3))


def bouncing_ball(world: World, rng: np.random.Generator, seconds: float = 1.6) -> BodyRecording:
    """A ball that PyBullet drops on a floor."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(*world.gravity, physicsClientId=client)
        pybullet.setTimeStep(STEP, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(restitutionVelocityThreshold=0.05, physicsClientId=client)
        floor = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[3, 3, 0.5], physicsClientId=client
        )
        ground = pybullet.createMultiBody(0, floor, basePosition=[0, 0, -0.5], physicsClientId=client)
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=BALL.sizes[0], physicsClientId=client
        )
        ball = pybullet.createMultiBody(
            BALL.mass, shape, basePosition=[0, 0, rng.uniform(0.5, 0.7)], physicsClientId=client
        )
        for body, restitution in ((ground, 1.0), (ball, world.restitution)):
            pybullet.changeDynamics(
                body, -1, restitution=restitution, lateralFriction=0.5, linearDamping=0.0,
                angularDamping=0.0, contactProcessingThreshold=0.0, physicsClientId=client,
            )  # fmt: skip
        pybullet.resetBaseVelocity(ball, [*rng.uniform(-0.4, 0.4, 2), 0.0], [0, 0, 0], physicsClientId=client)
        every = round(1.0 / world.tracker.rate / STEP)
        position, times = [], []
        for k in range(round(seconds / STEP)):
            if k % every == 0:
                position.append(pybullet.getBasePositionAndOrientation(ball, physicsClientId=client)[0])
                times.append(k * STEP)
            pybullet.stepSimulation(physicsClientId=client)
    finally:
        pybullet.disconnect(client)
    track = seen(world, np.array(times), np.array(position), None, rng)
    made = BodyRecording("bullet", "made by a test", "0" * 64, track, BALL)
    return _on(made, Support(friction=0.3, restitution=0.6))


def _on(recording: BodyRecording, support: Support) -> BodyRecording:
    return replace(recording, support=support)
