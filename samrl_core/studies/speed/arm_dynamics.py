"""How fast the simulator is on this machine, beside Pinocchio called from Python in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop, Rollouts
from samrl_core.diagnosis.simulation.gradients import gradient
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters


def benchmark(
    arm: ArmDescription,
    start_position: np.ndarray,
    *,
    steps: int = 2000,
    plants: int = 4,
    other_step: Callable[[], None] | None = None,
    gradients: bool = True,
) -> dict[str, float]:
    """CPU time per step and plant [us], smallest of five tries, and ratios within this run.

    Args:
        arm: described arm, with URDF and controller.
        start_position: (J,) where it stands.
        steps: controller periods of a rollout.
        plants: plants of a rollout.
        other_step: one step of another engine on the same arm (MuJoCo's `mj_step`, say), for its ratio.
        gradients: also time the adjoint (its kernels take half a minute to compile once).

    Returns:
        Names with units; `*_ratio` is the other's time over that of a nominal rollout (above 1 is faster).
    """
    loop = ClosedLoop(LoopModel(arm))
    start = np.asarray(start_position, dtype=float)
    joints = len(start)
    period = loop.model.step_s
    stamps = np.arange(steps) * period
    wave = 2.0 * np.pi * 0.5
    command = JointSignal(
        stamps,
        start + 0.1 * (1.0 - np.cos(wave * stamps))[:, None] * np.ones(joints),
        0.1 * wave * np.sin(wave * stamps)[:, None] * np.ones(joints),
    )
    zero_velocity, duration = np.zeros(joints), (steps - 1) * period

    def rollout(plant: PlantParameters, count: int = plants) -> Rollouts:
        return loop.rollout(command, start, zero_velocity, [plant] * count, duration)

    began = time.perf_counter()
    rollout(PlantParameters(), 1)
    result = {"load_s": time.perf_counter() - began}
    friction = PlantParameters(coulomb=0.1, stribeck_drop=0.05, viscous=0.1, command_delay=0.002)
    elastic = PlantParameters(joint_stiffness=1e4, coulomb=0.1)
    each = steps * plants
    result["nominal_us"] = _fastest(lambda: rollout(PlantParameters())) / each * 1e6
    result["friction_us"] = _fastest(lambda: rollout(friction)) / each * 1e6
    result["elastic_us"] = _fastest(lambda: rollout(elastic)) / each * 1e6
    result["pinocchio_python_us"] = _fastest(lambda: _pinocchio(loop, command, start, 300)) / 300 * 1e6
    result["pinocchio_python_ratio"] = result["pinocchio_python_us"] / result["nominal_us"]
    if other_step is not None:

        def others(step: Callable[[], None] = other_step) -> None:
            for _ in range(1000):
                step()

        result["other_us"] = _fastest(others) / 1000 * 1e6
        result["other_ratio"] = result["other_us"] / result["nominal_us"]
    if gradients:
        short = min(steps, 400)

        def loss(run: Rollouts) -> tuple[np.ndarray, Rollouts]:
            zero = np.zeros_like(run.position)
            return (run.position**2).sum((1, 2)), Rollouts(run.time, 2.0 * run.position, zero, zero, zero)

        for count in (1, 32):

            def adjoint(count: int = count) -> None:
                gradient(loop, command, start, zero_velocity, [friction] * count, (short - 1) * period, loss)

            adjoint()
            result[f"adjoint_{count}_us"] = _fastest(adjoint, 3) / short / count * 1e6
        result["differences_us"] = 2.0 * result["friction_us"]  # per parameter of a Jacobian
        result["adjoint_pays_above_parameters"] = result["adjoint_1_us"] / result["differences_us"]
    return result


def _pinocchio(loop: ClosedLoop, command: JointSignal, start: np.ndarray, steps: int) -> None:
    """The same nominal loop, Pinocchio's gravity and ABA step by step from Python."""
    model, data = loop.model.rigid.model, loop.model.rigid.data
    q, v = pin.neutral(model), np.zeros(model.nv)
    if len(q) == len(start):
        q = start[loop.model.trees[0].order].copy()
    assert command.position is not None and command.velocity is not None
    for k in range(steps):
        hold = pin.computeGeneralizedGravity(model, data, q)
        u = loop.model.stiffness * (command.position[k] - q[: len(start)])
        u = u + loop.model.damping * (command.velocity[k] - v)
        v = v + loop.model.step_s * pin.aba(
            model, data, q, v, np.clip(u + hold, -loop.model.effort_limit, loop.model.effort_limit)
        )
        q = pin.integrate(model, q, v * loop.model.step_s)


def _fastest(run: Callable[[], object], tries: int = 5) -> float:
    """CPU seconds, so that other work on the machine counts little."""
    best = np.inf
    for _ in range(tries):
        began = time.process_time()
        run()
        best = min(best, time.process_time() - began)
    return best
