"""Peg insertion without forces: a calibration that is off lets the peg stand on the rim, at times.

Nominal actions go straight to the sub-goals, where the hole is believed to be; really it lies elsewhere,
by much the same in every episode. The camera shows nothing of it: it has to be found out by trying. What it
does show is another scene in every episode, so that a learner could know each by heart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.learning.residual.replay import ReplayStep
from samrl_core.policy.agent.exploration import Exploration, clip_norm
from samrl_core.policy.networks.networks import ResidualActor
from samrl_core.studies.episodes.residual_episodes import Order, Played
from tests.learning import toy_cell
from tests.learning.small_cell import SIZE

TASK = PegInsertion()
OFFSET = np.array([0.0022, 0.0])  # of the hole [m]
SPREAD = 0.0005  # of that from episode to episode [m]
ESTIMATE = 0.0003  # standard deviation of the believed hole from action to action [m]


def play(orders: Sequence[Order], spoilt: float = 0.0) -> list[Played]:
    """Episodes one after another; this share of those that explore fails for no reason."""
    found = [_episode(order) for order in orders]
    lost = [o.exploration > 0 and np.random.default_rng([o.seed, 9]).random() < spoilt for o in orders]
    failed = {"success": False, "ended": "action_limit"}
    return [replace(one, **failed) if bad else one for one, bad in zip(found, lost, strict=True)]


def ordered(order: Order) -> tuple[Exploration, ResidualActor]:
    """The noise and the residual of an episode."""
    noise = Exploration(order.exploration, order.memory, np.random.default_rng(order.noise_seed))
    actor = ResidualActor(order.limit)
    if order.residual:
        actor.load_state_dict({k: torch.from_numpy(v) for k, v in order.residual.items()})
    return noise, actor


def _episode(order: Order) -> Played:
    rng = np.random.default_rng(order.seed)
    noise, actor = ordered(order)
    believed = TASK.start_values(rng)
    hole = believed + OFFSET + rng.normal(0.0, SPREAD, 2)
    tip = np.array([TASK.center_x, TASK.center_y, TASK.height + TASK.start_above])
    steps: list[ReplayStep] = []
    color, depth = scene(np.random.default_rng([order.seed, 1]))
    while True:
        seen = believed + rng.normal(0.0, ESTIMATE, 2)
        if TASK.is_done(seen, tip):
            return Played(tuple(steps), "done", "", True, 0.0)
        if len(steps) == order.max_actions:
            return Played(tuple(steps), "action_limit", "", False, float(np.linalg.norm(tip[:2] - hole)))
        goal = TASK.sub_goals(seen, tip)[0]
        nominal = clip_norm(goal.tip_position - tip, goal.max_step)
        state = ReplayStep(
            0,
            len(steps),
            color + rng.integers(0, 20, (SIZE, SIZE, 3), dtype=np.uint8),
            depth,
            toy_cell.CAMERA,
            tip,
            nominal,
            np.zeros(3),
            np.zeros(3),
        )
        residual = toy_cell.chosen_residual(actor, state) if order.residual else np.zeros(3)
        residual = clip_norm(residual + noise.next(), order.limit)
        after = _moved(tip, nominal + residual, hole)
        steps.append(ReplayStep(**{**vars(state), "residual": residual, "executed": after - tip}))
        tip = after


def scene(rng: np.random.Generator, squares: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Colour (H, W, 3) and depth (H, W) [m] of a block of coloured squares, each at another height."""
    one = np.ones((SIZE // squares, SIZE // squares))
    color = np.kron(rng.integers(20, 220, (squares, squares, 3), dtype=np.uint8), one[..., None])
    depth = np.kron(rng.uniform(0.42, 0.48, (squares, squares)), one)
    return color.astype(np.uint8), depth.astype(np.float32)


def _moved(tip: np.ndarray, way: np.ndarray, hole: np.ndarray, parts: int = 5) -> np.ndarray:
    """Where the tip comes to: on the rim it slides by half, in the hole it stays within the clearance."""
    for _ in range(parts):
        to = tip + way / parts
        aside = to[:2] - hole
        lateral = float(np.linalg.norm(aside))
        if to[2] < TASK.height and lateral > TASK.clearance:
            if tip[2] < TASK.height - 1e-6:
                to[:2] = hole + aside * TASK.clearance / lateral
            else:
                to = np.array([*(tip[:2] + 0.5 * way[:2] / parts), TASK.height])
        tip = to
    return tip
