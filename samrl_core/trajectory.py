"""Actions that take the tool through the sub-goals, optimised through the model (eqs. 18-22)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch

from samrl_core.errors import InputError
from samrl_core.tasks.task import SubGoal

Forward = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]  # tip (3,), action (3,) -> next tip (3,)


class ForwardModel(Protocol):
    """What a plan needs of a model: eq. 3."""

    def forward(
        self, tip_position: torch.Tensor, action: torch.Tensor, values: torch.Tensor, /
    ) -> torch.Tensor:
        """Next tip (3,) [m] after an action (3,) [m] with the parameters (P,); differentiable."""
        ...


@dataclass(frozen=True)
class TrajectorySettings:
    """How long the search may go on."""

    max_actions: int = 60  # whole plan
    spare_actions: int = 0  # more per sub-goal than the straight line needs
    max_iterations: int = 8  # gradient steps per sub-goal
    effort_weight: float = 1e-3  # of the squared actions against the squared distance to the goal [-]


@dataclass(frozen=True, eq=False)
class Plan:
    """A sequence of actions and where the model says they lead. Only the first action is executed."""

    actions: np.ndarray  # (T, 3) tool displacement [m], T = 0 when all goals are reached already
    tips: np.ndarray  # (T + 1, 3) tip position, the start first [m]
    reached: bool  # every sub-goal within its tolerance
    iterations: int  # gradient steps in all


@dataclass(frozen=True, eq=False)
class _Leg:
    actions: torch.Tensor  # (T, 3)
    tips: torch.Tensor  # (T + 1, 3)
    distance: float  # of the last tip to the goal [m]
    iterations: int


def _bounded(actions: torch.Tensor, max_step: float) -> torch.Tensor:
    length = actions.norm(dim=1, keepdim=True).clamp_min(1e-12)
    return actions * (max_step / length).clamp_max(1.0)


def _rollout(forward: Forward, tip: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
    tips = [tip]
    for action in actions:
        tips.append(forward(tips[-1], action))
    return torch.stack(tips)


def _to_goal(forward: Forward, tip: torch.Tensor, goal: SubGoal, count: int, s: TrajectorySettings) -> _Leg:
    """One sub-goal, from the straight line (which is the optimum where nothing is in the way)."""
    target = torch.as_tensor(goal.tip_position, dtype=tip.dtype)
    actions = _bounded(((target - tip) / count).expand(count, 3).clone(), goal.max_step)
    # In free space one step of this size is Newton's on the quadratic goal term: every action moves the
    # end by itself, so the curvature along the shared direction is 2 * count.
    rate = 0.5 / (count * (1.0 + s.effort_weight))

    def cost(tips: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        return (tips[-1] - target).square().sum() + s.effort_weight * actions.square().sum()

    iterations = 0
    tips = _rollout(forward, tip, actions)
    while iterations < s.max_iterations and float((tips[-1] - target).norm()) > goal.tolerance:
        iterations += 1
        variable = actions.clone().requires_grad_(True)
        value = cost(_rollout(forward, tip, variable), variable)
        (slope,) = torch.autograd.grad(value, variable)
        if not torch.isfinite(slope).all():
            raise InputError(f"gradient through the model is not finite at tip {tip.tolist()} [m]")
        improved = False
        for halving in range(3):
            trial = _bounded(actions - rate * 0.5**halving * slope, goal.max_step)
            with torch.no_grad():
                trial_tips = _rollout(forward, tip, trial)
                improved = float(cost(trial_tips, trial)) < float(value) - 1e-12
            if improved:
                actions, tips = trial, trial_tips
                break
        if not improved:
            break  # a stationary point: the model says that the goal cannot be reached from here
    return _Leg(actions.detach(), tips.detach(), float((tips[-1] - target).norm()), iterations)


def optimise(
    model: ForwardModel,
    values: np.ndarray,
    tip_position: np.ndarray,
    goals: Sequence[SubGoal],
    settings: TrajectorySettings | None = None,
) -> Plan:
    """Reach the sub-goals one after the other; each one's search starts where the last one ended.

    Args:
        model: its `forward` is eq. 19; called with float64 tensors.
        values: the estimated parameters (P,).
        tip_position: tip now (3,) in the tool arm's base frame [m], eq. 20.
        goals: sub-goals still ahead, in order, eq. 22.
        settings: limits of the search; a goal that is not reached ends the plan.

    Returns:
        The plan; no action is longer than its goal's `max_step`.

    Raises:
        InputError: the tip or a goal is not finite, a `max_step` is not positive, or the model's gradient
            is not finite.
    """
    s = settings or TrajectorySettings()
    start = np.asarray(tip_position, dtype=np.float64)
    if start.shape != (3,) or not np.isfinite(start).all():
        raise InputError(f"tip position {start} must be three finite numbers [m]")
    for goal in goals:
        if not np.isfinite(goal.tip_position).all() or goal.max_step <= 0:
            raise InputError(f"sub-goal {goal.name}: {goal.tip_position} m, max_step {goal.max_step} m")
    tip = torch.tensor(start)
    parameters = torch.tensor(np.array(values, dtype=np.float64))

    def forward(tip: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        return model.forward(tip, action, parameters)

    actions: list[torch.Tensor] = []
    tips = [tip[None]]
    iterations, reached = 0, True
    for goal in goals:
        distance = float(np.linalg.norm(goal.tip_position - tip.numpy()))
        if distance <= goal.tolerance:
            continue
        left = s.max_actions - sum(len(a) for a in actions)
        count = min(left, math.ceil(distance / goal.max_step - 1e-9) + s.spare_actions)
        if count < 1:
            reached = False
            break
        leg = _to_goal(forward, tip, goal, count, s)
        actions.append(leg.actions)
        tips.append(leg.tips[1:])
        iterations += leg.iterations
        tip = leg.tips[-1]
        if leg.distance > goal.tolerance:
            reached = False
            break
    flat = torch.cat(actions) if actions else torch.zeros((0, 3), dtype=torch.float64)
    return Plan(flat.numpy(), torch.cat(tips).numpy(), reached, iterations)
