"""How a whole trajectory changes with the parameters, from the physics model's own gradients.

One backward pass gives the slope of one number; a trajectory has hundreds. But the steps are independent once
their starts are known: all of them, once per output, are one batch of single steps, whose one backward pass
gives every step's slopes. Chained from the start they are the trajectory's.
"""

from __future__ import annotations

import torch

from samrl_core.attributes.push_scene import PushScene
from samrl_core.model.physics.state import PhysicsState


def trajectory(scene: PushScene, theta: torch.Tensor) -> torch.Tensor:
    """Coordinates and velocities (T + 1, Q + D) for theta (P,), without gradients.

    Raises:
        SolveError: the physics could not be solved for this theta.
    """
    with torch.no_grad():
        one = theta[None]
        whole = scene.model.rollout(scene.start(one), scene.actions(one), scene.parameters(one))
    return torch.cat([whole.q, whole.v], dim=-1)[:, 0]


def sensitivity(scene: PushScene, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The trajectory (T + 1, Q + D) and its slopes (T + 1, Q + D, P).

    Raises:
        SolveError: the physics could not be solved for this theta.
    """
    states = trajectory(scene, theta)
    steps, size = states.shape[0] - 1, states.shape[1]
    coordinates = len(scene.model.layout.start_q)
    # Row (step, output): the same step for each output, so that each has a slope of its own.
    rows = steps * size
    before = states[:-1].repeat_interleave(size, dim=0).requires_grad_()
    values = theta.expand(rows, -1).clone().requires_grad_()
    step = torch.arange(steps).repeat_interleave(size)
    after = scene.model.step(
        PhysicsState(before[:, :coordinates], before[:, coordinates:]),
        scene.action(values, step),
        scene.parameters(values),
    )
    output = torch.arange(size).repeat(steps)
    picked = torch.cat([after.q, after.v], dim=-1)[torch.arange(rows), output]
    by_state, by_theta = torch.autograd.grad(picked.sum(), (before, values))
    by_state, by_theta = by_state.reshape(steps, size, size), by_theta.reshape(steps, size, -1)

    slopes = theta.new_zeros((steps + 1, size, len(theta)))
    slopes[0] = _start_slopes(scene, theta)
    for k in range(steps):
        slopes[k + 1] = by_state[k] @ slopes[k] + by_theta[k]
    return states, slopes


def _start_slopes(scene: PushScene, theta: torch.Tensor) -> torch.Tensor:
    def start(values: torch.Tensor) -> torch.Tensor:
        state = scene.start(values[None])
        return torch.cat([state.q, state.v], dim=-1)[0]

    return torch.autograd.functional.jacobian(start, theta)  # pyright: ignore[reportReturnType]
