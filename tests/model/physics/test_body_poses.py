"""Forward kinematics in torch against the poses that the step's kernels use."""

from __future__ import annotations

import contact_cases
import pytest
import torch
import warp as wp
from gradient_check import inputs

from samrl_core.common.errors import InputError
from samrl_core.model.physics.body_poses import body_poses
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.state import PhysicsAction, PhysicsState


@pytest.mark.parametrize("name", ["peg jammed", "thread in eye", "spatula lifts"])
def test_poses_are_those_of_the_kernels(name: str) -> None:
    case = contact_cases.CASES[name]()
    model = PhysicsModel(case.scene, torch.float64)
    values = inputs(case, model)
    action = PhysicsAction(values["velocity"], values["wrench"])
    states = model.rollout(PhysicsState(values["q"], values["v"]), action, model.parameters(1))
    # The last step's scratch holds the poses at its start.
    turn, place = body_poses(model.layout, states.q[-2])
    links = model.workspace(1, case.velocity.shape[0]).links
    which = torch.as_tensor(model.layout.link_of_body, dtype=torch.int64)
    torch.testing.assert_close(turn[0], wp.to_torch(links.turn)[0, which], rtol=0, atol=1e-12)
    torch.testing.assert_close(place[0], wp.to_torch(links.place)[0, which], rtol=0, atol=1e-12)


def test_poses_of_a_whole_rollout_have_gradients() -> None:
    case = contact_cases.CASES["thread in eye"]()
    model = PhysicsModel(case.scene)
    q = case.q.float().repeat(5, 2, 1).requires_grad_()
    turn, place = body_poses(model.layout, q)
    assert turn.shape == (5, 2, 11, 3, 3) and place.shape == (5, 2, 11, 3)
    place[..., -1, 0].sum().backward()
    assert q.grad is not None and float(q.grad[0, 0, 8].abs()) > 0.01  # an early hinge moves the last link
    with pytest.raises(InputError):
        body_poses(model.layout, q[..., :5])
