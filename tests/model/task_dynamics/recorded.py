"""Motions of the simulated world, and the model's answer to the same motion of the tip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from samrl_core.model.task_dynamics.rigid_task_dynamics import TaskPhysics
from samrl_core.model.task_dynamics.task_dynamics import TaskState
from tests.cell.world.sub_goal_expert import Pace, follow

CELL = cell_named()
SAMPLE = 24  # steps of the physics between two samples, 0.1 s


@dataclass(frozen=True, eq=False)
class Recorded:
    """What truly happened: N steps of 1/240 s, rounded to the world's milliseconds."""

    tips: np.ndarray  # (N + 1, 3) [m]
    values: np.ndarray  # (N + 1, P) parameters of the task


class _Watched(PyBulletWorld):
    """Keeps what is true in every millisecond."""

    def reset(self, seed: int) -> None:
        super().reset(seed)
        self.history = [self.truth()]

    def advance(self) -> None:
        super().advance()
        self.history.append(self.truth())


def recorded(task: Task, seed: int, noise: float = 0.0) -> Recorded:
    """An episode of the expert that follows the task's sub-goals, `noise` as in `Pace`; exact sensors."""
    world = _Watched(task, CELL, NOISELESS)
    follow(world, task, CELL, partial(true_values, task), seed, Pace(noise=noise))
    history = world.history
    world.close()
    at = np.round(np.arange(0.0, (len(history) - 1) / 1000.0, 1.0 / 240.0) * 1000.0).astype(int)
    truths = [history[i] for i in at]
    return Recorded(
        np.array([t.tip_position for t in truths]), np.array([true_values(task, t) for t in truths])
    )


def replayed(dynamics: TaskPhysics, real: Recorded) -> np.ndarray:
    """The model's values (M, P) at every `SAMPLE`-th step, the start included, moved as the real tip was."""
    state = dynamics.start(real.values[0], real.tips[0])
    tips = torch.from_numpy(real.tips)[:, None]
    values = [real.values[0]]
    with torch.no_grad():
        for k in range(0, len(tips) - SAMPLE, SAMPLE):
            path = dynamics.track(state, tips[k : k + SAMPLE + 1])
            state = TaskState(path.q[-1], path.v[-1], state.rest)
            values.append(dynamics.read(state.q[0].numpy())[0])
    return np.array(values)


def thread_errors(task: NeedleThreading, real: Recorded, values: np.ndarray) -> np.ndarray:
    """Mean distance of the thread's joints and end from the real ones, per sample (M,) [m]."""
    errors = []
    for k, model in enumerate(values):
        true, tip = real.values[k * SAMPLE], real.tips[k * SAMPLE]
        away = task.thread_points(model, tip) - task.thread_points(true, tip)
        errors.append(float(np.linalg.norm(away, axis=1).mean()))
    return np.array(errors)


def pancake_errors(real: Recorded, values: np.ndarray) -> np.ndarray:
    """Distance of the centres [m] and angle between the axes [rad] per sample, (M, 2)."""

    def axis(v: np.ndarray) -> np.ndarray:
        angle = float(np.hypot(v[3], v[4]))
        share = float(np.sinc(angle / np.pi))  # sin(angle) / angle
        return np.array([share * v[4], -share * v[3], np.cos(angle)])

    errors = []
    for k, model in enumerate(values):
        true = real.values[k * SAMPLE]
        cosine = float(np.clip(axis(model) @ axis(true), -1.0, 1.0))
        errors.append((float(np.linalg.norm(model[:3] - true[:3])), float(np.arccos(cosine))))
    return np.array(errors)
