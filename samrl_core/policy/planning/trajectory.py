"""Actions that take the tool through the sub-goals, optimised through the model (eqs. 18-22).

One sub-goal after the other: the first that the task names in the predicted state is reached by as few
actions as its step allows, then the task is asked again. The last term of eq. 22, the squared distance of
the state from the sub-goal, is r^2 with r = G(s) - tip(s): the sub-goal may move with the state, as where a
thread must be gripped moves with its shape. Gauss-Newton's method on r and the actions' squares, with the
derivative of the state by the actions from the model (eq. 19) and that of r by the state from differences.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch

from samrl_core.cell.tasks.task import SubGoal
from samrl_core.common.errors import InputError, SolveError
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState

_DIFFERENCE = 1e-5  # of a coordinate, for the Jacobian of r [m], [rad]


class Goals(Protocol):
    """What a plan needs of a task."""

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray, /) -> tuple[SubGoal, ...]:
        """Goals still ahead in a state; empty when done."""
        ...


@dataclass(frozen=True)
class TrajectorySettings:
    """How long the search may go on."""

    max_actions: int = 60  # whole plan
    # The plan ends after so many; all but its first action is thrown away in the loop.
    max_sub_goals: int = 60
    spare_actions: int = 2  # more per sub-goal than the straight line needs, where it cannot be reached else
    max_iterations: int = 8  # Gauss-Newton steps per sub-goal and number of actions
    effort_weight: float = 1e-3  # of the squared actions against the squared distance to the goal [-]


@dataclass(frozen=True, eq=False)
class Plan:
    """A sequence of actions and where they lead in the model. Only the first action is executed."""

    actions: np.ndarray  # (T, 3) tool displacement [m], T = 0 when all goals are reached already
    tips: np.ndarray  # (T + 1, 3) tip position, the start first [m]
    values: np.ndarray  # (T + 1, P) the task's parameters, the start first
    sub_goals: tuple[str, ...]  # which one each action heads for, T names
    reached: bool  # no sub-goal is left
    why_stopped: str  # done | out_of_reach: the last sub-goal | not_solved: the one after it | limit
    iterations: int  # Gauss-Newton steps in all


@dataclass(frozen=True, eq=False)
class _Leg:
    actions: torch.Tensor  # (T, 3)
    states: list[TaskState]  # T + 1
    reached: bool
    iterations: int


def optimise(
    dynamics: TaskDynamics, task: Goals, state: TaskState, settings: TrajectorySettings | None = None
) -> Plan:
    """Reach the sub-goals one after the other; each one's search starts where the last one ended.

    Args:
        dynamics: eq. 19.
        task: names the sub-goals that are ahead of a state, eq. 22.
        state: one state (B = 1), eq. 20.
        settings: limits of the search; a goal that is not reached ends the plan.

    Returns:
        The plan; no action is longer than its goal's `max_step`.

    Raises:
        InputError: a goal is not finite, a `max_step` is not positive, or the model's gradient is not finite.
        SolveError: the model cannot follow the straight line to the first sub-goal.
    """
    s = settings or TrajectorySettings()
    actions: list[np.ndarray] = []
    states, names = [state], []
    iterations, why = 0, "limit"
    for _ in range(s.max_sub_goals):
        goal = _next_goal(dynamics, task, states[-1])
        if goal is None:
            why = "done"
            break
        left = s.max_actions - len(names)
        if left < 1:
            break
        try:
            leg = _Search(dynamics, task, goal, s).leg(states[-1], left)
        except SolveError:
            if not actions:
                raise
            why = "not_solved"
            break
        actions.append(leg.actions.numpy())
        states += leg.states[1:]
        names += [goal.name] * len(leg.actions)
        iterations += leg.iterations
        if not leg.reached:
            why = "out_of_reach" if len(names) < s.max_actions else "limit"
            break
    read = [dynamics.read(one.q[0].detach().numpy()) for one in states]
    return Plan(
        np.concatenate(actions) if actions else np.zeros((0, 3)),
        np.array([tip for _, tip in read]),
        np.array([values for values, _ in read]),
        tuple(names),
        why == "done",
        why,
        iterations,
    )


def _next_goal(dynamics: TaskDynamics, task: Goals, state: TaskState) -> SubGoal | None:
    """The first sub-goal that is not within its tolerance."""
    values, tip = dynamics.read(state.q[0].detach().numpy())
    for goal in task.sub_goals(values, tip):
        if not np.isfinite(goal.tip_position).all() or goal.max_step <= 0:
            raise InputError(f"sub-goal {goal.name}: {goal.tip_position} m, max_step {goal.max_step} m")
        if float(np.linalg.norm(goal.tip_position - tip)) > goal.tolerance:
            return goal
    return None


class _Search:
    """The actions towards one sub-goal."""

    def __init__(
        self, dynamics: TaskDynamics, task: Goals, goal: SubGoal, settings: TrajectorySettings
    ) -> None:
        self._dynamics, self._task, self._goal, self._settings = dynamics, task, goal, settings

    def leg(self, start: TaskState, most: int) -> _Leg:
        """With as few actions as reach it, at most `most`; the last attempt where none does."""
        goal = self._goal
        _, tip = self._dynamics.read(start.q[0].detach().numpy())
        way = torch.from_numpy(goal.tip_position - tip)
        fewest = math.ceil(float(way.norm()) / goal.max_step - 1e-9)
        iterations = 0
        found: _Leg | None = None
        for spare in range(self._settings.spare_actions + 1):
            count = min(most, fewest + spare)
            if found is not None and count == len(found.actions):
                break
            found = self._descend(start, _bounded((way / count).expand(count, 3), goal.max_step))
            iterations += found.iterations
            if found.reached:
                break
        assert found is not None
        return _Leg(found.actions, found.states, found.reached, iterations)

    def _descend(self, start: TaskState, actions: torch.Tensor) -> _Leg:
        """From the straight line, which is the optimum where nothing is in the way."""
        s, goal = self._settings, self._goal
        states = self._rollout(start, actions)
        missing, passed = self._missing(states[-1])
        for iteration in range(s.max_iterations + 1):
            reached = passed or float(np.linalg.norm(missing)) <= goal.tolerance
            if reached or iteration == s.max_iterations:
                return _Leg(actions, states, reached, iteration)
            jacobian = self._jacobian(start, actions)  # (3, 3 T)
            flat = actions.reshape(-1).numpy()
            w = s.effort_weight
            step = np.linalg.solve(
                jacobian.T @ jacobian + w * np.eye(len(flat)), -(jacobian.T @ missing + w * flat)
            ).reshape(-1, 3)
            cost = float(missing @ missing) + w * float(flat @ flat)
            for halving in range(4):
                trial = _bounded(actions + 0.5**halving * torch.from_numpy(step), goal.max_step)
                try:
                    trial_states = self._rollout(start, trial)
                except SolveError:
                    continue  # no better than what is known
                trial_missing, passed = self._missing(trial_states[-1])
                value = float(trial_missing @ trial_missing) + w * float(trial.square().sum())
                if passed or value < cost * (1.0 - 1e-6):
                    actions, states, missing = trial, trial_states, trial_missing
                    break
            else:
                # A stationary point: in the model the goal cannot be reached so.
                return _Leg(actions, states, False, iteration + 1)
        raise AssertionError("the loop returns at its last iteration")

    def _rollout(self, start: TaskState, actions: torch.Tensor) -> list[TaskState]:
        states = [start]
        with torch.no_grad():
            for action in actions:
                states.append(self._dynamics.forward(states[-1], action[None]))
        return states

    def _missing(self, state: TaskState) -> tuple[np.ndarray, bool]:
        """r (3,) [m], and whether the task no longer names the goal."""
        return self._distance(state.q[0].detach().numpy())

    def _distance(self, q: np.ndarray) -> tuple[np.ndarray, bool]:
        values, tip = self._dynamics.read(q)
        for goal in self._task.sub_goals(values, tip):
            if goal.name == self._goal.name:
                return goal.tip_position - tip, False
        return self._goal.tip_position - tip, True

    def _jacobian(self, start: TaskState, actions: torch.Tensor) -> np.ndarray:
        """dr/da (3, 3 T): by differences to the last coordinates, from there by the model's gradient."""
        # Three times the same motion, one for each row of r: one backward pass for all.
        variable = actions.repeat(3, 1, 1).requires_grad_(True)
        state = TaskState(*(part.expand(3, -1) for part in (start.q, start.v, start.rest)))
        for k in range(len(actions)):
            state = self._dynamics.forward(state, variable[:, k])
        q = state.q[0].detach().numpy()
        by_q = np.zeros((3, len(q)))
        for i in range(len(q)):
            change = np.zeros(len(q))
            change[i] = _DIFFERENCE
            by_q[:, i] = (self._distance(q + change)[0] - self._distance(q - change)[0]) / (2 * _DIFFERENCE)
        (gradient,) = torch.autograd.grad(state.q, variable, torch.from_numpy(by_q))
        jacobian = gradient.reshape(3, -1).numpy()
        if not np.isfinite(jacobian).all():
            raise InputError(f"gradient through the model is not finite at {q.tolist()}")
        return jacobian


def _bounded(actions: torch.Tensor, max_step: float) -> torch.Tensor:
    length = actions.norm(dim=1, keepdim=True).clamp_min(1e-12)
    return actions * (max_step / length).clamp_max(1.0)
