"""Trajectories through a model: goals in sequence, bounds, obstacles, goals that move, refusals."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.tasks.task import SubGoal
from samrl_core.common.errors import InputError, SolveError
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState
from samrl_core.policy.planning.trajectory import Plan, TrajectorySettings, optimise


class TipOnly(TaskDynamics):
    """The state is the tip, then values that nothing moves."""

    def prepare(self) -> None:
        """Nothing to compile."""

    def start(self, values: np.ndarray, tip_position: np.ndarray) -> TaskState:
        """Tip and values."""
        q = torch.from_numpy(np.concatenate([tip_position, values])[None])
        return TaskState(q, q[:, :0], q[:, :0])

    def forward(self, state: TaskState, action: torch.Tensor) -> TaskState:
        """By `tip_after`."""
        tip = self.tip_after(state.q[:, :3], action, state.q[:, 3:])
        return replace(state, q=torch.cat([tip, state.q[:, 3:]], dim=1))

    def read(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values and tip."""
        return q[3:], q[:3]

    @abstractmethod
    def tip_after(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Where an action leads."""


class Free(TipOnly):
    """The tool goes where it is told."""

    def tip_after(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """No contact anywhere."""
        return tip + action


class Lagging(TipOnly):
    """The tool makes `values[0]` of each displacement: a straight plan falls short."""

    def tip_after(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Short of the order."""
        return tip + values[:, :1] * action


class Slope(TipOnly):
    """The tool is drawn aside by a tenth of its height's change."""

    def tip_after(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Aside along x."""
        return tip + action + 0.1 * torch.stack([action[:, 2], 0 * action[:, 2], 0 * action[:, 2]], dim=1)


class Floor(TipOnly):
    """Nothing gets below height `values[0]`."""

    def tip_after(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Stops at the floor."""
        after = tip + action
        return torch.stack([after[:, 0], after[:, 1], torch.maximum(after[:, 2], values[:, 0])], dim=1)


class Unsolved(TipOnly):
    """Below a height of `values[0]` the equations have no solution."""

    def tip_after(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Free above, an error below."""
        if float((tip + action)[0, 2]) < float(values[0, 0]):
            raise SolveError("too low")
        return tip + action


class Sequence:
    """Goals one after the other, each behind once a tip lower than all before it has been near."""

    def __init__(self, *goals: SubGoal) -> None:
        self.goals = goals

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """Those that lie lower than the tip, or where it is."""
        ahead = [g for g in self.goals if g.tip_position[2] < tip_position[2] + g.tolerance]
        return tuple(g for g in ahead if np.linalg.norm(g.tip_position - tip_position) > g.tolerance)


class Above:
    """One goal that moves with the tip: beside it by as much as it is high."""

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """A tip at x = height, y = 0 is there."""
        place = np.array([tip_position[2], 0.0, 0.05])
        near = np.linalg.norm(place - tip_position) < 1e-4
        return () if near else (SubGoal("beside", place, 1e-4, 0.01),)


ABOVE = SubGoal("above", np.array([0.53, -0.02, 0.06]), 1e-3, 0.01)
DOWN = SubGoal("down", np.array([0.53, -0.02, 0.015]), 1e-3, 0.005)
START = np.array([0.5, 0.0, 0.14])


def plan_of(
    dynamics: TaskDynamics,
    goals: Sequence | Above,
    values: np.ndarray | None = None,
    tip: np.ndarray = START,
    settings: TrajectorySettings | None = None,
) -> Plan:
    """A plan from `tip`."""
    values = np.zeros(0) if values is None else values
    return optimise(dynamics, goals, dynamics.start(values, tip), settings)


def test_goals_in_sequence_within_bounds() -> None:
    """Both goals met in order; no action exceeds its goal's step; tips add up."""
    plan = plan_of(Free(), Sequence(ABOVE, DOWN))
    assert plan.reached and plan.why_stopped == "done" and plan.iterations == 0
    assert plan.sub_goals == tuple(sorted(plan.sub_goals))  # all of "above", then all of "down"
    length = np.linalg.norm(plan.actions, axis=1)
    first = plan.sub_goals.count("above")
    assert np.linalg.norm(plan.tips[first] - ABOVE.tip_position) <= ABOVE.tolerance
    assert length[:first].max() <= ABOVE.max_step + 1e-12
    assert length[first:].max() <= DOWN.max_step + 1e-12
    np.testing.assert_allclose(plan.tips[-1], DOWN.tip_position, atol=DOWN.tolerance)
    np.testing.assert_allclose(np.diff(plan.tips, axis=0), plan.actions, atol=1e-12)


def test_gradient_makes_up_for_a_lagging_tool() -> None:
    """The straight line ends 20 % short; with spare actions the optimised plan does not."""
    settings = TrajectorySettings(spare_actions=5)
    plan = plan_of(Lagging(), Sequence(ABOVE), np.array([0.8]), settings=settings)
    assert plan.iterations > 0 and plan.reached
    assert np.linalg.norm(plan.actions, axis=1).max() <= ABOVE.max_step + 1e-12
    bound = plan_of(Lagging(), Sequence(ABOVE), np.array([0.8]), settings=TrajectorySettings(spare_actions=0))
    assert not bound.reached and bound.why_stopped == "out_of_reach"


def test_one_step_meets_a_goal_that_the_straight_line_misses() -> None:
    """A linear model needs one Gauss-Newton step; the straight line misses by 8 mm."""
    plan = plan_of(Slope(), Sequence(ABOVE), settings=TrajectorySettings(spare_actions=1))
    assert plan.reached
    assert plan.iterations <= 2
    assert np.linalg.norm(plan.tips[-1] - ABOVE.tip_position) < ABOVE.tolerance


def test_a_goal_that_moves_with_the_state_is_met() -> None:
    """Where the tip must go depends on where it is: the slope of the goal is part of the search."""
    plan = plan_of(Free(), Above(), tip=np.array([0.03, 0.03, 0.07]))
    assert plan.reached and 0 < plan.iterations <= 3
    np.testing.assert_allclose(plan.tips[-1], [0.05, 0.0, 0.05], atol=2e-4)


def test_reports_a_goal_out_of_reach_and_stops_there() -> None:
    """A goal below the floor is not reached, and the one after it is not tried."""
    after = SubGoal("after", np.array([0.6, 0.0, 0.01]), 1e-3, 0.01)
    plan = plan_of(Floor(), Sequence(DOWN, after), np.array([0.04]))
    assert not plan.reached and plan.why_stopped == "out_of_reach"
    assert set(plan.sub_goals) == {"down"}
    assert plan.tips[:, 2].min() == pytest.approx(0.04)
    assert np.linalg.norm(plan.tips[-1, :2] - DOWN.tip_position[:2]) < 2e-3


def test_what_cannot_be_solved_ends_the_plan_or_is_said() -> None:
    """What comes first stands; where nothing comes first, the error is the answer."""
    plan = plan_of(Unsolved(), Sequence(ABOVE, DOWN), np.array([0.03]))
    assert set(plan.sub_goals) == {"above"} and plan.why_stopped == "not_solved" and not plan.reached
    with pytest.raises(SolveError, match="too low"):
        plan_of(Unsolved(), Sequence(DOWN), np.array([0.03]))


def test_nothing_to_do() -> None:
    """Goals met already give no action."""
    plan = plan_of(Free(), Sequence(ABOVE), tip=ABOVE.tip_position)
    assert plan.actions.shape == (0, 3) and plan.tips.shape == (1, 3) and plan.reached


def test_length_limits() -> None:
    """A plan that would be too long ends unreached at the limit of actions, or of sub-goals."""
    plan = plan_of(Free(), Sequence(ABOVE, DOWN), settings=TrajectorySettings(max_actions=10))
    assert not plan.reached and len(plan.actions) == 10 and plan.why_stopped == "limit"
    plan = plan_of(Free(), Sequence(ABOVE, DOWN), settings=TrajectorySettings(max_sub_goals=1))
    assert set(plan.sub_goals) == {"above"} and plan.why_stopped == "limit"


@pytest.mark.parametrize(
    "goal", [SubGoal("bad", np.full(3, np.nan), 1e-3, 0.01), SubGoal("still", np.zeros(3), 1e-3, 0.0)]
)
def test_refuses_goals_that_are_none(goal: SubGoal) -> None:
    """Not finite, or without a step."""

    class Bad:
        def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
            return (goal,)

    with pytest.raises(InputError, match=goal.name):
        optimise(Free(), Bad(), Free().start(np.zeros(0), START))


def test_plan_through_the_real_model(model: Model) -> None:
    """Over the rim first, then down: the tip ends in the hole and never meets the block's top off centre."""
    values = np.array([0.53, -0.03])
    plan = optimise(model.dynamics, model.task, model.dynamics.start(values, START))
    assert plan.reached
    low = plan.tips[plan.tips[:, 2] < 0.041]
    assert len(low) and np.linalg.norm(low[:, :2] - values, axis=1).max() < 0.002
    assert model.task.is_done(values, plan.tips[-1])


def test_the_top_of_the_block_stops_a_wrong_goal(model: Model) -> None:
    """A goal inside the block 2 cm beside the hole is not reached; the plan says so."""
    wrong = SubGoal("beside", np.array([0.52, 0.0, 0.02]), 1e-3, 0.005)
    start = model.dynamics.start(np.array([0.5, 0.0]), np.array([0.52, 0.0, 0.06]))
    plan = optimise(model.dynamics, Sequence(wrong), start)
    assert not plan.reached and plan.why_stopped == "out_of_reach"
    assert plan.tips[:, 2].min() > 0.035
