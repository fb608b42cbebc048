"""One batch of plants in the simulator's memory: filled, started, run, read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError
from samrl_core.common.warp_runtime import start as start_warp
from samrl_core.diagnosis.simulation.kernels.rollout_kernels import bias_kernel, rollout_kernel
from samrl_core.diagnosis.simulation.loop_model import LoopModel, sampled
from samrl_core.diagnosis.simulation.plant_arrays import pack
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, Bodies, F, H, Mat3, P, S, Vec3


class Simulation:
    """Memory for one batch; `full` keeps every step, for gradients.

    Raises:
        InputError: a command or a log that does not fit.
    """

    def __init__(
        self,
        loop: LoopModel,
        mount: int,
        plants: Sequence[PlantParameters],
        command: JointSignal,
        steps: int,
        every: int,
        *,
        position_log: JointSignal | None = None,
        enabled: JointSignal | None = None,
        full: bool = False,
    ) -> None:
        """Allocate and fill everything but the start."""
        start_warp()
        if loop.reading == "link":
            plants = [replace(plant, reading="link") for plant in plants]
        self.loop, self.tree, self.plants, self.steps = loop, loop.trees[mount], list(plants), steps
        tree = self.tree
        n, count, order = tree.joints, len(plants), tree.order
        self.packed = pack(
            plants,
            loop.rigid,
            order,
            loop.joint_dynamics,
            loop.damping,
            loop.teeth,
            loop.gravity,
            loop.step_s,
            mount,
            full,
        )
        delays = self.packed.params[:, :, P.EFFORT_DELAY]
        slots = steps + 1 if full else int(np.ceil(delays.max())) + 3
        records = (steps - 1) // every + 1
        a: Any = Arrays()
        self.arrays = a
        self._full = full
        self.motion: Any = None  # scratch of the way back, made by it
        a.joints, a.mount = n, mount
        a.parent, a.prismatic = self._ints(tree.parent), self._ints(tree.prismatic)
        a.rotation = wp.array(tree.rotation, dtype=Mat3, device=loop.device)
        a.origin = wp.array(tree.origin, dtype=Vec3, device=loop.device)
        a.axis = wp.array(tree.axis, dtype=Vec3, device=loop.device)
        a.step, a.substeps = loop.step_s, loop.substeps
        assert loop.arm.controller is not None
        a.compensate = int(loop.arm.controller.gravity_compensation)
        a.nominal_gravity = Vec3(*loop.gravity)
        nominal = np.zeros((n, 10))
        nominal[mount:] = loop.rigid.inertial_parameters[order]
        a.nominal_inertia = self.numbers(nominal)
        a.stiffness, a.damping = self.numbers(loop.stiffness[order]), self.numbers(loop.damping[order])
        a.limit = self.numbers(loop.effort_limit[order])
        a.law, a.braked = self.numbers(loop.law[order]), int(loop.arm.controller.law.braked)
        a.cascaded = int(loop.arm.controller.law.cascaded)
        a.enabled = self.numbers(loop.enabled(enabled, steps)[:, order])
        a.command_q, a.command_v, a.command_u = (
            self.numbers(values[:, order]) for values in loop.commands(command, steps)
        )
        self._log(position_log)
        a.seed, a.flags = self._ints(self.packed.seed), self._ints(self.packed.flags)
        a.params, a.inertia = self.numbers(self.packed.params), self.numbers(self.packed.inertia)
        a.gravity = wp.array(self.packed.gravity, dtype=Vec3, device=loop.device, requires_grad=full)
        a.slots = slots
        a.state, a.effort = self._zeros(slots, count, n, len(S)), self._zeros(slots, count, n)
        a.measured_q, a.measured_v, a.damped_v, a.held = (self._zeros(count, n) for _ in range(4))
        a.hand, a.acceleration = self._zeros(count, n, len(H)), self._zeros(count, n)
        a.g_rotation, a.g_origin = self._zeros(count, n, dtype=Mat3), self._zeros(count, n, dtype=Vec3)
        a.g_mass, a.g_moment = self._zeros(count, n), self._zeros(count, n, dtype=Vec3)
        a.every, a.shift = every, loop.shift
        a.out_q, a.out_v, a.out_u, a.out_t = (self._zeros(count, records, n - mount) for _ in range(4))
        s: Any = Bodies()
        self.bodies = s
        for name in ("rotation", "inertia"):
            setattr(s, name, wp.zeros((count, n), dtype=Mat3, device=loop.device))
        for name in ("origin", "w", "v", "aw", "av", "sw", "sv", "fw", "fv", "moment"):
            setattr(s, name, wp.zeros((count, n), dtype=Vec3, device=loop.device))
        s.mass = wp.zeros((count, n), dtype=wp.float64, device=loop.device)
        s.matrix = wp.zeros((count, n, n), dtype=wp.float64, device=loop.device)
        if mount not in loop.hints:
            loop.hints[mount] = self._hint()
        a.inertia_hint = self.numbers(loop.hints[mount])

    def start(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Put every plant where it was measured, (B, J) in the description's order."""
        self._write_first(self.first_state(position, velocity))

    def first_state(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """State (B, n, S) at rest of springs, from measured positions and velocities (B, J).

        Encoder errors are taken off; the transmission, the backlash and the mount rest on their own gravity.
        """
        tree, mount = self.tree, self.tree.mount
        params, flags = self.packed.params[:, mount:], self.packed.flags[:, mount:]
        q_read, v_read = position[:, tree.order], velocity[:, tree.order]
        amplitude, phase = params[..., P.ENCODER_AMPLITUDE], params[..., P.ENCODER_PHASE]
        q = q_read - params[..., P.ENCODER_OFFSET]
        unwaved = q
        for _ in range(4):  # a contraction by the amplitude, far below 1
            q = unwaved - amplitude * np.sin(q + phase)
        v = v_read / (1.0 + amplitude * np.cos(q + phase))
        state = np.zeros((len(self.plants), tree.joints, len(S)))
        state[:, mount:, S.Q] = q
        self._write_first(state)
        gravity = self._bias()
        self.first_q, self.first_bias = q, gravity
        elastic = (flags & int(F.ELASTIC | F.QUASI)) != 0
        stiffness = np.where(elastic, params[..., P.JOINT_STIFFNESS], 1.0)
        hold = gravity[:, mount:]
        wound = np.where(elastic, hold / stiffness + np.sign(hold) * params[..., P.BACKLASH], 0.0)
        link_read = (flags & int(F.READ_LINK)) != 0
        state[:, mount:, S.Q] = np.where(link_read, q, q - wound)
        state[:, mount:, S.QM] = np.where(link_read, q + wound, q)
        state[:, mount:, S.V] = state[:, mount:, S.VM] = v
        state[:, mount:, S.DAMPED_V] = v_read
        state[:, :, S.LINK_TORQUE] = gravity
        if mount:
            state[:, :mount, S.Q] = -gravity[:, :mount] / self.packed.params[:, :mount, P.JOINT_STIFFNESS]
        return state

    def run(self) -> np.ndarray:
        """Whole rollouts; returns (B, 2) step and joint of divergence, -1 where there is none."""
        failed = wp.full((len(self.plants), 2), -1, dtype=int, device=self.loop.device)
        wp.launch(
            rollout_kernel, dim=len(self.plants), inputs=[self.arrays, self.bodies, self.steps, failed],
            device=self.loop.device,
        )  # fmt: skip
        return failed.numpy()

    def records(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity, effort, commanded effort (B, T, J) in the description's order."""
        a, back = self.arrays, np.argsort(self.tree.order)
        q, v, t, u = (x.numpy()[:, :, back] for x in (a.out_q, a.out_v, a.out_t, a.out_u))
        if a.shift:
            t[:, 0] = u[:, 0] = self.first_bias[:, self.tree.mount :][:, back]
        return q, v, t, u

    def _write_first(self, state: np.ndarray) -> None:
        wp.copy(self.arrays.state[0], self.numbers(state))

    def _bias(self) -> np.ndarray:
        bias = wp.zeros((len(self.plants), self.tree.joints), dtype=wp.float64, device=self.loop.device)
        wp.launch(
            bias_kernel,
            dim=len(self.plants),
            inputs=[self.arrays, self.bodies, bias],
            device=self.loop.device,
        )
        return bias.numpy().copy()

    def _hint(self) -> np.ndarray:
        """Inertia (n,) that each joint feels with the others free, in the middle of the joint ranges."""
        tree, mount = self.tree, self.tree.mount
        lower, upper = self.loop.rigid.position_limits()
        bounded = np.isfinite(lower) & np.isfinite(upper)
        middle = np.where(bounded, np.where(bounded, lower, 0.0) / 2 + np.where(bounded, upper, 0.0) / 2, 0.0)
        state = np.zeros((len(self.plants), tree.joints, len(S)))
        state[:, mount:, S.Q] = middle[tree.order]
        kept = self.arrays.inertia
        self.arrays.inertia = self.numbers(
            np.repeat(self.arrays.nominal_inertia.numpy()[None], len(state), 0)
        )
        self._write_first(state)
        self._bias()
        self.arrays.inertia = kept
        matrix = self.bodies.matrix.numpy()[0]
        matrix = np.tril(matrix) + np.tril(matrix, -1).T
        tiny = 1e-9 * max(np.abs(matrix).max(), 1e-9)
        return 1.0 / np.diag(np.linalg.inv(matrix + tiny * np.eye(len(matrix))))

    def _log(self, log: JointSignal | None) -> None:
        a, joints = self.arrays, len(self.tree.order)
        a.logged = int(log is not None)
        values = np.zeros((2, 1, joints))
        if log is not None:
            if log.position is None or log.velocity is None:
                raise InputError("the position log needs positions and velocities")
            time = np.arange(self.steps) * self.loop.step_s
            parts = (sampled("position log", log.time, x, time, joints) for x in (log.position, log.velocity))
            values = np.array([part[:, self.tree.order] for part in parts])
        a.log_q, a.log_v = self.numbers(values[0]), self.numbers(values[1])

    def numbers(self, values: np.ndarray) -> Any:
        """A float64 array of the kernels."""
        return wp.array(
            np.ascontiguousarray(values, dtype=float), dtype=wp.float64, device=self.loop.device,
            requires_grad=self._full,
        )  # fmt: skip

    def _ints(self, values: np.ndarray) -> Any:
        return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=int, device=self.loop.device)

    def _zeros(self, *shape: int, dtype: Any = wp.float64) -> Any:
        return wp.zeros(shape, dtype=dtype, device=self.loop.device, requires_grad=self._full)
