"""How a whole trajectory changes with the parameters, from the physics model's own gradients.

One backward pass gives the gradient of one number; a trajectory has hundreds. But the steps are independent
once their starts are known: all of them, once per output, are one batch of single steps, whose one backward
pass gives every step's Jacobian. Chained from the start they are the trajectory's.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from samrl_core.model.physical_parameters.push_scene import PushScene
from samrl_core.model.physics.state import PhysicsState


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """A trajectory of T steps with states of S numbers, and its Jacobian."""

    states: torch.Tensor  # (T + 1, S) coordinates, then velocities
    jacobian: torch.Tensor  # (T + 1, S, P) by theta
    by_state: torch.Tensor  # (T, S, S) of each step's end by its start
    by_theta: torch.Tensor  # (T, S, P) of each step's end by theta in this step alone

    def response(self, column: int, step_of: torch.Tensor, where: torch.Tensor) -> torch.Tensor:
        """Slopes (T + 1, S, N) by a parameter that differs in time.

        Args:
            column: of theta.
            step_of: (T,) which of its N values each step has.
            where: (T,) bool, steps in which it differs from theta's at all.
        """
        change = self.states.new_zeros((*self.states.shape, int(step_of[-1]) + 1))
        own = self.by_theta[:, :, column] * where[:, None]
        for t, number in enumerate(step_of.tolist()):
            change[t + 1] = self.by_state[t] @ change[t]
            change[t + 1, :, number] += own[t]
        return change


def trajectory(scene: PushScene, theta: torch.Tensor) -> torch.Tensor:
    """Coordinates and velocities (T + 1, Q + D) for theta (P,), without gradients.

    Raises:
        SolveError: the physics could not be solved for this theta.
    """
    with torch.no_grad():
        one = theta[None]
        whole = scene.model.rollout(scene.start(one), scene.actions(one), scene.parameters(one))
    return torch.cat([whole.q, whole.v], dim=-1)[:, 0]


def sensitivity(scene: PushScene, theta: torch.Tensor) -> Sensitivity:
    """The trajectory for theta (P,), and its Jacobian.

    Raises:
        SolveError: the physics could not be solved for this theta.
    """
    states = trajectory(scene, theta)
    steps, size = states.shape[0] - 1, states.shape[1]
    coordinates, outputs = scene.coordinates, torch.tensor(scene.in_plane)
    # Row (step, output): the same step for each output, so that each has a gradient of its own.
    rows = steps * len(outputs)
    before = states[:-1].repeat_interleave(len(outputs), dim=0).requires_grad_()
    values = theta.expand(rows, -1).clone().requires_grad_()
    step = torch.arange(steps).repeat_interleave(len(outputs))
    after = scene.model.step(
        PhysicsState(before[:, :coordinates], before[:, coordinates:]),
        scene.action(values, step),
        scene.parameters(values),
    )
    picked = torch.cat([after.q, after.v], dim=-1)[torch.arange(rows), outputs.repeat(steps)]
    of_rows = torch.autograd.grad(picked.sum(), (before, values))
    by_state, by_theta = (theta.new_zeros((steps, size, of.shape[1])) for of in of_rows)
    for whole, of in zip((by_state, by_theta), of_rows, strict=True):
        whole[:, outputs] = of.reshape(steps, len(outputs), -1)

    jacobian = theta.new_zeros((steps + 1, size, len(theta)))
    jacobian[0] = _start_jacobian(scene, theta)
    for k in range(steps):
        jacobian[k + 1] = by_state[k] @ jacobian[k] + by_theta[k]
    return Sensitivity(states, jacobian, by_state, by_theta)


def _start_jacobian(scene: PushScene, theta: torch.Tensor) -> torch.Tensor:
    def start(values: torch.Tensor) -> torch.Tensor:
        state = scene.start(values[None])
        return torch.cat([state.q, state.v], dim=-1)[0]

    return torch.autograd.functional.jacobian(start, theta)
