"""Trajectories through the model: goals in sequence, bounds, obstacles, refusals."""

import numpy as np
import pytest
import torch

from samrl_core.errors import InputError
from samrl_core.model.model import Model
from samrl_core.tasks.task import SubGoal
from samrl_core.trajectory import TrajectorySettings, optimise


class Free:
    """The tool goes where it is told."""

    def forward(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """No contact anywhere."""
        return tip + action


class Lagging:
    """The tool makes `values[0]` of each displacement: a straight plan falls short."""

    def forward(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Short of the order."""
        return tip + values[0] * action


class Floor:
    """Nothing gets below height `values[0]`, softly, so that a slope is left."""

    def forward(self, tip: torch.Tensor, action: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Stops at the floor."""
        following = tip + action
        return torch.stack([following[0], following[1], torch.maximum(following[2], values[0])])


ABOVE = SubGoal("above", np.array([0.53, -0.02, 0.06]), 1e-3, 0.01)
DOWN = SubGoal("down", np.array([0.53, -0.02, 0.015]), 1e-3, 0.005)
START = np.array([0.5, 0.0, 0.14])


def test_goals_in_sequence_within_bounds() -> None:
    """Both goals met in order; no action exceeds its goal's step; tips add up."""
    plan = optimise(Free(), np.zeros(0), START, (ABOVE, DOWN))
    assert plan.reached
    length = np.linalg.norm(plan.actions, axis=1)
    at_first = int(np.argmin(np.linalg.norm(plan.tips - ABOVE.tip_position, axis=1)))
    assert np.linalg.norm(plan.tips[at_first] - ABOVE.tip_position) <= ABOVE.tolerance
    assert length[:at_first].max() <= ABOVE.max_step + 1e-12
    assert length[at_first:].max() <= DOWN.max_step + 1e-12
    np.testing.assert_allclose(plan.tips[-1], DOWN.tip_position, atol=DOWN.tolerance)
    np.testing.assert_allclose(np.diff(plan.tips, axis=0), plan.actions, atol=1e-12)


def test_gradient_makes_up_for_a_lagging_tool() -> None:
    """The straight line ends 20 % short; the optimised plan does not."""
    settings = TrajectorySettings(spare_actions=5)
    plan = optimise(Lagging(), np.array([0.8]), START, (ABOVE,), settings)
    assert plan.iterations > 0 and plan.reached
    assert np.linalg.norm(plan.actions, axis=1).max() <= ABOVE.max_step + 1e-12


def test_reports_a_goal_out_of_reach_and_stops_there() -> None:
    """A goal below the floor is not reached, and the one after it is not tried."""
    after = SubGoal("after", np.array([0.6, 0.0, 0.3]), 1e-3, 0.01)
    plan = optimise(Floor(), np.array([0.04]), START, (DOWN, after))
    assert not plan.reached
    assert plan.tips[:, 2].min() == pytest.approx(0.04)
    assert np.linalg.norm(plan.tips[-1, :2] - DOWN.tip_position[:2]) < 2e-3


def test_nothing_to_do() -> None:
    """Goals met already give no action."""
    plan = optimise(Free(), np.zeros(0), ABOVE.tip_position, (ABOVE,))
    assert plan.actions.shape == (0, 3) and plan.tips.shape == (1, 3) and plan.reached


def test_length_limit() -> None:
    """A plan that would be too long ends unreached at the limit."""
    plan = optimise(Free(), np.zeros(0), START, (ABOVE, DOWN), TrajectorySettings(max_actions=10))
    assert len(plan.actions) == 10 and not plan.reached


@pytest.mark.parametrize("tip", [np.array([0.0, np.nan, 0.0]), np.zeros(2)])
def test_refuses_bad_tips(tip: np.ndarray) -> None:
    """Not finite, or not three numbers."""
    with pytest.raises(InputError):
        optimise(Free(), np.zeros(0), tip, (ABOVE,))


def test_refuses_bad_goals() -> None:
    """A goal that is not finite, or a step of zero."""
    for goal in (SubGoal("nan", np.full(3, np.nan), 1e-3, 0.01), SubGoal("still", np.zeros(3), 1e-3, 0.0)):
        with pytest.raises(InputError):
            optimise(Free(), np.zeros(0), START, (goal,))


def test_plan_through_the_real_model(model: Model) -> None:
    """Over the rim first, then down: the tip ends in the hole and never meets the block's top off centre."""
    values = np.array([0.53, -0.03])
    goals = model.task.sub_goals(values, START)
    plan = optimise(model, values, START, goals)
    assert plan.reached
    low = plan.tips[plan.tips[:, 2] < 0.041]
    assert len(low) and np.linalg.norm(low[:, :2] - values, axis=1).max() < 0.002
    assert model.task.is_done(values, plan.tips[-1])


def test_the_top_of_the_block_stops_a_wrong_goal(model: Model) -> None:
    """A goal inside the block 2 cm beside the hole is not reached; the plan says so."""
    values = np.array([0.5, 0.0])
    wrong = SubGoal("beside", np.array([0.52, 0.0, 0.02]), 1e-3, 0.005)
    plan = optimise(model, values, np.array([0.52, 0.0, 0.06]), (wrong,))
    assert not plan.reached
    assert plan.tips[:, 2].min() > 0.035
