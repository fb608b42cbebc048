"""Newton's differentiable solvers on the chain (Featherstone) and on the sliding disc (semi-implicit).

Newton keeps matrices on the solver object that its backward pass reads, so every step needs a solver of its
own; with one for all, gradients over several steps are wrong without any warning.
"""
# The library's stubs lack or misstate these.

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import newton
import numpy as np
import warp as wp

from samrl_core.common.warp_runtime import start
from samrl_core.studies.speed import physics_scenes as scenes

DISC_STEP_S = 1e-3  # at 1/240 s its contact is unstable
_STIFFNESS, _DAMPING, _SLIDING = 1e4, 10.0, 1e3  # of its contact: ke, kd, kf


class NewtonRollout:
    """Some steps of a number of environments; `forward` and `both` replay recorded graphs."""

    def __init__(self, model: Any, solvers: list[Any], step_s: float, collide: bool) -> None:
        self._model, self._solvers, self._step = model, solvers, step_s
        self._states = [model.state(requires_grad=True) for _ in range(len(solvers) + 1)]
        self._control = model.control()
        self._pipeline, self._contacts = None, None
        if collide:
            self._pipeline = newton.CollisionPipeline(model, broad_phase="explicit", requires_grad=True)
            self._contacts = [self._pipeline.contacts() for _ in solvers]

    def begin(self, joint_q: np.ndarray | None, joint_qd: np.ndarray) -> None:
        """Sets the first state."""
        first = self._states[0]
        if joint_q is not None:
            first.joint_q.assign(joint_q.astype(np.float32))
        first.joint_qd.assign(joint_qd.astype(np.float32))
        newton.eval_fk(self._model, first.joint_q, first.joint_qd, first)

    def run(self) -> None:
        """Forward, launch by launch."""
        for k, solver in enumerate(self._solvers):
            now, then = self._states[k], self._states[k + 1]
            now.clear_forces()
            contacts = None
            if self._pipeline is not None and self._contacts is not None:
                contacts = self._contacts[k]
                self._pipeline.collide(now, contacts)
            solver.step(now, then, self._control, contacts, self._step)

    def run_both(self, last: Callable[[Any], Any]) -> None:
        """Forward and backward from ones on an array of the last state."""
        tape = wp.Tape()
        with tape:
            self.run()
        array = last(self._states[-1])
        tape.backward(grads={array: wp.ones_like(array, requires_grad=False)})
        tape.zero()

    def recorded(self, work: Callable[[], None]) -> Callable[[], None]:
        """The same as a graph; eager where Newton cannot be captured on this device."""
        work()
        with wp.ScopedCapture(device=str(self._model.device)) as capture:
            work()
        graph = capture.graph
        return lambda: wp.capture_launch(graph)

    @property
    def last(self) -> Any:
        """The last state."""
        return self._states[-1]


def chain(environments: int, steps: int, device: str = "cpu") -> NewtonRollout:
    """Ten links, Featherstone, one solver per step."""
    start()
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    side, _, along = np.diag(scenes.cylinder_inertia(scenes.MASS, scenes.RADIUS, scenes.LENGTH))
    joints, parent = [], -1
    for i in range(scenes.LINKS):
        # The body between two hinges must weigh something.
        light = builder.add_link(mass=1e-6, inertia=wp.mat33(np.eye(3) * 1e-9), lock_inertia=True)
        link = builder.add_link(
            mass=scenes.MASS,
            com=wp.vec3(0.0, 0.0, -0.5 * scenes.LENGTH),
            inertia=wp.mat33(np.diag([side, side, along])),
            lock_inertia=True,
        )
        at = wp.transform(wp.vec3(0.0, 0.0, -scenes.LENGTH if i else 0.0), wp.quat_identity())
        for a, b, axis, joint_in_parent in (
            (parent, light, (1.0, 0.0, 0.0), at),
            (light, link, (0.0, 1.0, 0.0), wp.transform_identity()),
        ):
            joints.append(
                builder.add_joint_revolute(
                    a,
                    b,
                    parent_xform=joint_in_parent,
                    axis=wp.vec3(*axis),
                    damping=scenes.DAMPING,
                    armature=0.0,
                    limit_ke=0.0,
                    limit_kd=0.0,
                )
            )
        parent = link
    builder.add_articulation(joints)
    whole = newton.ModelBuilder(up_axis=newton.Axis.Z)
    whole.replicate(builder, environments)
    model = whole.finalize(device=device, requires_grad=True)
    solvers = [newton.solvers.SolverFeatherstone(model, angular_damping=0.0) for _ in range(steps)]
    rollout = NewtonRollout(model, solvers, scenes.STEP_S, collide=False)
    q, v = scenes.chain_start()
    rollout.begin(np.tile(q, environments), np.tile(v, environments))
    return rollout


def disc(environments: int, frames: int, device: str = "cpu") -> NewtonRollout:
    """A cylinder sliding on a plane with Newton's general collision, about 4.17 steps a frame of 1/240 s."""
    start()
    visual = newton.ModelBuilder.ShapeConfig(
        density=0.0, ke=_STIFFNESS, kd=_DAMPING, kf=_SLIDING, mu=scenes.DISC_FRICTION
    )
    inertia = scenes.cylinder_inertia(scenes.DISC_MASS, scenes.DISC_RADIUS, scenes.DISC_HEIGHT)
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    body = builder.add_body(
        xform=wp.transform(wp.vec3(0.0, 0.0, 0.5 * scenes.DISC_HEIGHT), wp.quat_identity()),
        mass=scenes.DISC_MASS,
        inertia=wp.mat33(inertia),
        lock_inertia=True,
    )
    builder.add_shape_cylinder(
        body, radius=scenes.DISC_RADIUS, half_height=0.5 * scenes.DISC_HEIGHT, cfg=visual
    )
    whole = newton.ModelBuilder(up_axis=newton.Axis.Z)
    whole.replicate(builder, environments)
    whole.add_ground_plane(cfg=visual)
    model = whole.finalize(device=device, requires_grad=True)
    steps = round(frames * scenes.STEP_S / DISC_STEP_S)
    solvers = [newton.solvers.SolverSemiImplicit(model) for _ in range(steps)]
    rollout = NewtonRollout(model, solvers, DISC_STEP_S, collide=True)
    rollout.begin(None, np.tile([scenes.DISC_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0], environments))
    return rollout
