"""Derivatives of rollouts: a scalar's by the adjoint method, a Jacobian's by differences in one batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, DivergenceError, Rollouts
from samrl_core.diagnosis.simulation.kernels.adjoint_kernels import (
    before_kernel,
    lambda_kernel,
    power_kernel,
    repeat_kernel,
    update_kernel,
)
from samrl_core.diagnosis.simulation.kernels.rigid_kernels import RigidMotion
from samrl_core.diagnosis.simulation.loop_model import interpolation
from samrl_core.diagnosis.simulation.plant_arrays import unpack_gradient
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.simulation import Simulation
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, F, Mat3, P, S, Vec3

Loss = Callable[[Rollouts], tuple[np.ndarray, Rollouts]]
MEMORY_LIMIT = 4e9  # [byte] for the history of one gradient


@dataclass(frozen=True, eq=False)
class Gradient:
    """Value and derivatives of a loss that is a sum over plants."""

    value: np.ndarray  # (B,) as the loss gave it
    rollouts: Rollouts
    start_position: np.ndarray  # (B, J)
    start_velocity: np.ndarray  # (B, J)
    command: JointSignal  # derivatives with respect to every sample of the command, summed over plants
    plants: tuple[dict[str, np.ndarray], ...]  # per plant: field name to derivative, (J,) for joint fields


def gradient(
    loop: ClosedLoop,
    command: JointSignal,
    start_position: np.ndarray,
    start_velocity: np.ndarray,
    plants: Sequence[PlantParameters],
    duration_s: float,
    loss: Loss,
    *,
    record_every: int = 1,
) -> Gradient:
    """Gradient of a loss of rollouts with respect to start, command and every continuous plant parameter.

    The state of each step is kept, everything inside a step is computed again on the way back.

    Args:
        loop: the arm.
        command: as in `ClosedLoop.rollout`, like the next four.
        start_position: measured at the start.
        start_velocity: measured at the start.
        plants: B plants, all with a mount or all without.
        duration_s: length.
        loss: from rollouts to values (B,) and their derivatives with respect to each channel.
        record_every: controller periods from one sample to the next.

    Raises:
        InputError: plants with and without a mount, or a history that does not fit into memory.
        DivergenceError: a plant that is unstable.
    """
    model = loop.model
    groups = model.groups(plants)
    if len(groups) != 1:
        raise InputError(
            "plants with and without a compliant mount in one gradient; ask for one after the other"
        )
    mount = groups[0][1]
    count, steps, joints = len(plants), loop.model.steps(duration_s), len(loop.arm.joints)
    need = 2 * 8 * steps * count * (joints + mount) * (len(S) + 1)
    if need > MEMORY_LIMIT:
        raise InputError(
            f"{count} plants over {duration_s} s need {need / 1e9:.1f} GB for their history, the limit is "
            f"{MEMORY_LIMIT / 1e9:.0f} GB; pass fewer plants or a shorter piece"
        )
    start_q = loop.model.start_values("start_position", start_position, count)
    start_v = loop.model.start_values("start_velocity", start_velocity, count)
    every = record_every * loop.model.substeps
    simulation = Simulation(loop.model, mount, plants, command, steps, every, full=True)
    simulation.start(start_q, start_v)
    for b, (k, joint) in enumerate(simulation.run()):
        if k >= 0:
            raise DivergenceError(b, loop.model.joint_name(plants[b], int(joint)), k * loop.model.step_s, 0)
    channels = [part.copy() for part in simulation.records()]
    time = np.arange(channels[0].shape[1]) * (every * loop.model.step_s)
    rollouts = Rollouts(time, *channels)
    value, gradient = loss(rollouts)
    _seed(simulation, gradient, channels[0].shape)
    state_grad = _backwards(simulation)
    q_grad, v_grad, params_grad = _start_backwards(simulation, state_grad, start_v)
    a, tree = simulation.arrays, simulation.tree
    inertia, gravity = a.inertia.grad.numpy(), a.gravity.grad.numpy()
    pieces = tuple(
        unpack_gradient(
            params_grad[b], inertia[b], gravity[b], plants[b], model.rigid, tree.order, model.step_s, mount
        )
        for b in range(count)
    )  # fmt: skip
    back = np.argsort(tree.order)
    weights = interpolation(np.asarray(command.time, dtype=float), np.arange(steps) * loop.model.step_s)
    command_grad = JointSignal(
        command.time,
        *(
            _scatter(weights, x.grad.numpy()[:, back], len(command.time)) if given is not None else None
            for x, given in ((a.command_q, command.position), (a.command_v, command.velocity))
        ),
        effort=None
        if command.effort is None
        else _scatter(weights, a.command_u.grad.numpy()[:, back], len(command)),
    )
    return Gradient(np.asarray(value), rollouts, q_grad, v_grad, command_grad, pieces)


def _seed(simulation: Simulation, gradient: Rollouts, shape: tuple[int, ...]) -> None:
    a, order = simulation.arrays, simulation.tree.order
    pairs = (
        ("position", gradient.position, a.out_q),
        ("velocity", gradient.velocity, a.out_v),
        ("effort", gradient.effort, a.out_t),
        ("commanded_effort", gradient.commanded_effort, a.out_u),
    )
    for name, values, array in pairs:
        values = np.asarray(values, dtype=float)
        if values.shape != shape:
            raise InputError(
                f"the loss gave derivatives {values.shape} with respect to {name}, must be {shape}"
            )
        array.grad.assign(np.ascontiguousarray(values[:, :, order]))


def _motion(simulation: Simulation) -> Any:
    count, n, device = len(simulation.plants), simulation.tree.joints, simulation.loop.device
    m = RigidMotion()
    base = np.zeros((count, n + 1, 3, 3))
    base[:, 0] = np.eye(3)
    m.rotation = wp.array(base, dtype=Mat3, device=device, requires_grad=True)
    for name in ("origin", "w", "v", "aw", "av", "yw", "yv"):
        setattr(m, name, wp.zeros((count, n + 1), dtype=Vec3, device=device, requires_grad=True))
    # held fixed in the derivative: no gradient memory
    m.acceleration = wp.zeros((count, n), dtype=wp.float64, device=device)
    m.direction = wp.zeros((count, n), dtype=wp.float64, device=device)
    m.power = wp.zeros(count, dtype=wp.float64, device=device, requires_grad=True)
    return m


def _backwards(simulation: Simulation) -> np.ndarray:
    """All steps backwards; returns the gradient of the first state (B, n, S).

    The adjoint structures are empty, so that gradients go to the arrays' own.
    """
    a, s, m = simulation.arrays, simulation.bodies, _motion(simulation)
    launch = {"dim": len(simulation.plants), "device": simulation.loop.device, "record_cmd": True}
    back = {"adjoint": True, "adj_outputs": [], **launch}
    scratch = [a.acceleration.grad, a.hand.grad, m.power.grad]
    # Packed once: a structure of sixty arrays costs more to pass than a step costs to compute.
    commands = [  # and the place of the step's number among the arguments
        (wp.launch(repeat_kernel, inputs=[a, s, m, 0], **launch), 3),
        (wp.launch(update_kernel, inputs=[a, 0], adj_inputs=[Arrays(), 0], **back), 1),
        (wp.launch(lambda_kernel, inputs=[a, s, m, *scratch], **launch), None),
        (wp.launch(power_kernel, inputs=[a, m, 0], **launch), 2),
        (wp.launch(power_kernel, inputs=[a, m, 0], adj_inputs=[Arrays(), RigidMotion(), 0], **back), 2),
        (wp.launch(before_kernel, inputs=[a, 0], adj_inputs=[Arrays(), 0], **back), 1),
    ]
    for k in reversed(range(simulation.steps)):
        for command, place in commands:
            if place is not None:
                command.set_param_at_index(place, k)
            command.launch()
    simulation.motion = m
    return a.state.grad.numpy()[0].copy()


def _start_backwards(
    simulation: Simulation, state: np.ndarray, v_read: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Adjoint of `Simulation.first_state`: gradients of the readings (B, J) and of all params (B, n, P)."""
    a, m, tree, mount = simulation.arrays, simulation.motion, simulation.tree, simulation.tree.mount
    total = a.params.grad.numpy().copy()
    params, flags = simulation.packed.params, simulation.packed.flags[:, mount:]
    elastic = (flags & int(F.ELASTIC | F.QUASI)) != 0
    link_read = (flags & int(F.READ_LINK)) != 0
    hold = simulation.first_bias
    stiffness = np.where(elastic, params[:, mount:, P.JOINT_STIFFNESS], 1.0)
    driven = state[:, mount:]
    wound = np.where(elastic, np.where(link_read, driven[..., S.QM], -driven[..., S.Q]), 0.0)
    total[:, mount:, P.JOINT_STIFFNESS] -= wound * hold[:, mount:] / stiffness**2
    total[:, mount:, P.BACKLASH] += wound * np.sign(hold[:, mount:])
    pull = state[:, :, S.LINK_TORQUE].copy()
    pull[:, mount:] += wound / stiffness
    if a.shift:  # the first efforts are the torque that holds the arm
        pull[:, mount:] += a.out_t.grad.numpy()[:, 0] + a.out_u.grad.numpy()[:, 0]
    if mount:
        spring = params[:, :mount, P.JOINT_STIFFNESS]
        pull[:, :mount] -= state[:, :mount, S.Q] / spring
        total[:, :mount, P.JOINT_STIFFNESS] += state[:, :mount, S.Q] * hold[:, :mount] / spring**2
    # gravity torque at the unwound state, through the same virtual power; the last slot is free by now
    q = simulation.first_q
    last = np.zeros((len(q), tree.joints, len(S)))
    last[:, mount:, S.Q] = q
    spare = simulation.steps
    wp.copy(a.state[spare], simulation.numbers(last))
    a.state.grad[spare].zero_()
    m.acceleration.zero_()
    m.direction.assign(-pull)
    m.power.grad.fill_(1.0)
    launch = {"dim": len(q), "device": simulation.loop.device}
    wp.launch(power_kernel, inputs=[a, m, spare], **launch)
    wp.launch(
        power_kernel,
        inputs=[a, m, spare],
        adjoint=True,
        adj_inputs=[Arrays(), RigidMotion(), 0],
        adj_outputs=[],
        **launch,
    )
    q_grad = driven[..., S.Q] + driven[..., S.QM] + a.state.grad.numpy()[spare][:, mount:, S.Q]
    v_grad = driven[..., S.V] + driven[..., S.VM]
    amplitude, phase = params[:, mount:, P.ENCODER_AMPLITUDE], params[:, mount:, P.ENCODER_PHASE]
    sine, cosine = np.sin(q + phase), np.cos(q + phase)
    scale = 1.0 + amplitude * cosine
    speed = v_read[:, tree.order] / scale**2
    q_grad = q_grad + v_grad * speed * amplitude * sine
    total[:, mount:, P.ENCODER_OFFSET] -= q_grad / scale
    total[:, mount:, P.ENCODER_AMPLITUDE] -= q_grad * sine / scale + v_grad * speed * cosine
    total[:, mount:, P.ENCODER_PHASE] += (
        -q_grad * amplitude * cosine / scale + v_grad * speed * amplitude * sine
    )
    back = np.argsort(tree.order)
    return (q_grad / scale)[:, back], (v_grad / scale + driven[..., S.DAMPED_V])[:, back], total


def _scatter(weights: tuple[np.ndarray, np.ndarray], values: np.ndarray, samples: int) -> np.ndarray:
    """Transpose of the linear interpolation of commands: derivatives (steps, J) to (samples, J)."""
    left, share = weights
    out = np.zeros((samples, values.shape[1]))
    np.add.at(out, left, values * (1.0 - share)[:, None])
    np.add.at(out, np.minimum(left + 1, samples - 1), values * share[:, None])
    return out
