"""A task without physics whose correction lies far from what the nominal policy does, and is wide.

Each episode wants a mean residual about 2.5 mm from none, by chance nearer or farther, and takes what lies
within 3 mm of it: 45 % of episodes take none, 85 % the middle one. So it is with a thread whose camera is
8 mm off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.learning.residual.replay import ReplayStep
from samrl_core.policy.agent.exploration import clip_norm
from samrl_core.studies.episodes.residual_episodes import Order, Played
from tests.learning import toy_cell
from tests.learning.small_cell import SIZE
from tests.studies.kinematic_peg import ordered, scene

MIDDLE = np.array([0.0, -0.0008, -0.0024])  # of what is wanted [m]
SPREAD = 0.0013  # of that from episode to episode, per axis [m]
TOLERANCE = 0.003  # [m]
LENGTHS = (22, 30)  # actions until an episode may succeed, drawn from these
COUNTED = 20  # last actions whose mean residual counts


def play(orders: Sequence[Order]) -> list[Played]:
    """Episodes one after the other."""
    return [_episode(order) for order in orders]


def _episode(order: Order) -> Played:
    rng = np.random.default_rng(order.seed)
    noise, actor = ordered(order)
    wanted = MIDDLE + rng.normal(0.0, SPREAD, 3)
    enough = int(rng.integers(*LENGTHS))
    color, depth = scene(np.random.default_rng([order.seed, 1]))
    steps: list[ReplayStep] = []
    while len(steps) < order.max_actions:
        nominal = clip_norm(rng.normal(0.0, 0.003, 3), 0.01)
        noisy = color + rng.integers(0, 20, (SIZE, SIZE, 3), dtype=np.uint8)
        state = ReplayStep(
            0, len(steps), noisy, depth, toy_cell.CAMERA, np.zeros(3), nominal, np.zeros(3), np.zeros(3)
        )
        residual = toy_cell.chosen_residual(actor, state) if order.residual else np.zeros(3)
        residual = clip_norm(residual + noise.next(), order.limit)
        steps.append(ReplayStep(**{**vars(state), "residual": residual, "executed": residual}))
        mean = np.mean([step.residual for step in steps[-COUNTED:]], axis=0)
        if len(steps) >= enough and np.linalg.norm(mean - wanted) < TOLERANCE:
            return Played(tuple(steps), "done", "", True, 0.0)
    return Played(tuple(steps), "action_limit", "", False, 0.0)
