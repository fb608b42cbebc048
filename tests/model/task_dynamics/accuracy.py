"""Trajectory error of thread and pancake against PyBullet, with parameters as told, wrong, and fitted.

`python -m tests.model.task_dynamics.accuracy needle_threading 3` prints a line per case: fitted on the motion
of seed 0, judged on those of the seeds after it. Wrong is every fitted parameter times 1.5.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import torch
from scipy.optimize import least_squares

from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import SolveError
from samrl_core.model.physics.state import PhysicsParameters
from samrl_core.model.task_dynamics.rigid_task_dynamics import TaskPhysics
from tests.model.task_dynamics.recorded import (
    CELL,
    SAMPLE,
    Recorded,
    pancake_errors,
    recorded,
    replayed,
    thread_errors,
)

WRONG = 1.5


def scaled(given: PhysicsParameters, thread: bool, factors: np.ndarray) -> PhysicsParameters:
    """Thread: stiffness and damping of its joints. Pancake: friction and stiffness of contact."""
    a, b = float(factors[0]), float(factors[1])
    if thread:
        return replace(
            given, joint_stiffness=a * given.joint_stiffness, joint_damping=b * given.joint_damping
        )
    return replace(given, friction=a * given.friction, contact_stiffness=b * given.contact_stiffness)


def seen(task: Task, values: np.ndarray, tips: np.ndarray) -> np.ndarray:
    """What is compared in a fit, per sample, in units of what counts as much: 0.1 mm, and 0.5 deg."""
    if isinstance(task, NeedleThreading):
        return np.array(
            [task.thread_points(v, tip).ravel() / 1e-4 for v, tip in zip(values, tips, strict=True)]
        )
    return values / [1e-4, 1e-4, 1e-4, 0.01, 0.01]


def fitted(task: Task, dynamics: TaskPhysics, real: Recorded) -> np.ndarray:
    """Factors on the told parameters, from wrong ones, by least squares on where things are."""
    thread = isinstance(task, NeedleThreading)
    told = dynamics.parameters
    # A pancake that stands on its rim moves by chance: what comes after 80 deg is left out.
    standing = np.hypot(real.values[::SAMPLE, 3], real.values[::SAMPLE, 4]) > 1.4
    count = len(standing) if thread or not standing.any() else int(np.argmax(standing))

    def residual(logarithm: np.ndarray) -> np.ndarray:
        values = replayed(dynamics.with_parameters(scaled(told, thread, np.exp(logarithm))), real)
        count_here = min(count, len(values))
        where = slice(0, count_here * SAMPLE, SAMPLE)
        true, tips = real.values[where], real.tips[where]
        return (seen(task, values[:count_here], tips) - seen(task, true, tips)).ravel()

    start = np.log([WRONG, WRONG])
    found = least_squares(residual, start, diff_step=0.05, bounds=(-3.0, 3.0), loss="soft_l1", max_nfev=12)
    return np.exp(found.x)


def report(name: str, count: int) -> None:
    """Prints the errors."""
    torch.set_num_threads(1)
    task = task_named(name)
    thread = isinstance(task, NeedleThreading)
    dynamics = TaskPhysics(task, CELL)
    # Jerky motion makes a thread swing; without it, stiffness and damping do not show.
    motions = [recorded(task, seed, 0.25 if thread else 0.0) for seed in range(1 + count)]
    factors = fitted(task, dynamics, motions[0])
    named = "stiffness, damping" if thread else "friction, contact stiffness"
    print(f"{name}: factors on {named} as told, from {WRONG}: {factors.round(3).tolist()}")
    for label, share in (("told", np.ones(2)), ("wrong", np.full(2, WRONG)), ("fitted", factors)):
        model = dynamics.with_parameters(scaled(dynamics.parameters, thread, share))
        lines = []
        for real in motions[1:]:
            try:
                values = replayed(model, real)
            except SolveError as error:
                print(f"  {label}: {error}")
                continue
            if isinstance(task, NeedleThreading):
                errors = 1e3 * thread_errors(task, real, values)
                lines.append((errors.mean(), errors.max(), errors[-1]))
            else:
                errors = pancake_errors(real, values)
                up = int(np.argmax(np.hypot(values[:, 3], values[:, 4]) > 1.4)) or len(values)
                millimetres = 1e3 * errors[:, 0]
                lines.append((millimetres[:up].mean(), millimetres[:up].max(), millimetres[-1]))
        mean, largest, last = np.array(lines).mean(axis=0)
        print(f"  {label}: mean {mean:.3f} mm, largest {largest:.3f} mm, at the end {last:.3f} mm")


if __name__ == "__main__":
    report(sys.argv[1], int(sys.argv[2]))
