"""A world of one action: a dot on a plane; the nominal action errs sideways, to which side the dot tells.

Success: nominal and residual together come within a tolerance of what was wanted. A zero residual never does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.types.pose import look_at
from samrl_core.learning.images.packed_images import network_images, packed_depth, poses_as_rows
from samrl_core.learning.residual.replay import End, Replay, ReplayStep
from samrl_core.learning.residual.td3 import TD3Settings
from samrl_core.learning.residual.training import ResidualTraining, TrainingSettings, replay_of
from samrl_core.policy.agent.exploration import clip_norm
from samrl_core.policy.networks.network_image import CHANNELS
from samrl_core.policy.networks.networks import Encoder
from tests.learning.small_cell import SIZE, SMALL

TASK = "toy"
BIAS = 0.0014  # of the nominal action along y, to the side on which the dot lies [m]
TOLERANCE = 0.0013  # [m]
CAMERA = look_at(np.array([0.9, 0.0, 0.3]), np.array([0.5, 0.0, 0.05]))
TIP = np.array([0.5, 0.0, 0.1])
ENCODER = Encoder(CHANNELS, torch.Generator().manual_seed(3))  # as drawn: it tells where the dot is


def draw_state(rng: np.random.Generator, episode: int) -> tuple[ReplayStep, np.ndarray]:
    """A state with residual zero, and what the nominal action errs by (3,) [m]."""
    color = np.full((SIZE, SIZE, 3), 100, dtype=np.uint8) + rng.integers(
        0, 10, (SIZE, SIZE, 3), dtype=np.uint8
    )
    side = int(rng.integers(2))
    u, v = int(rng.integers(1, SIZE // 2 - 3)) + side * SIZE // 2, int(rng.integers(2, SIZE - 4))
    color[v : v + 3, u : u + 3] = (220, 30, 30)
    depth = np.full((SIZE, SIZE), 0.45, dtype=np.float32)
    error = np.array([0.0, BIAS if side else -BIAS, 0.0])
    wanted = rng.uniform(-0.003, 0.003, 3)
    zeros = np.zeros(3)
    return ReplayStep(episode, 0, color, depth, CAMERA, TIP, wanted + error, zeros, zeros), error


def succeeds(residual: np.ndarray, error: np.ndarray) -> bool:
    return float(np.linalg.norm(residual + error)) < TOLERANCE


def chosen_residual(actor: torch.nn.Module, state: ReplayStep) -> np.ndarray:
    images = network_images(
        state.color[None],
        packed_depth(state.depth)[None],
        poses_as_rows([state.camera_in_world]),
        state.tip_in_base[None],
        SMALL,
    )
    with torch.no_grad():
        return actor(images, torch.tensor(state.nominal[None], dtype=torch.float32))[0].double().numpy()


def act(
    replay: Replay, rng: np.random.Generator, count: int, residual_of, noise: float, limit: float
) -> None:
    """Episodes of one action each into the replay."""
    for _ in range(count):
        state, error = draw_state(rng, replay.next_episode())
        residual = clip_norm(residual_of(state) + noise * rng.standard_normal(3), limit)
        step = ReplayStep(**{**state.__dict__, "residual": residual, "executed": state.nominal + residual})
        ended = End.SUCCESS if succeeds(residual, error) else End.FAILURE
        replay.end_episode(replay.append(step), ended)


def settings(learner: TD3Settings, publish_every: int = 10**6) -> TrainingSettings:
    """As many updates as a test asks for."""
    return TrainingSettings(
        learner, capacity=2000, first_steps=1, updates_per_step=1000.0, publish_every=publish_every
    )


def start(folder: Path, settings: TrainingSettings, count: int, seed: int = 0) -> Replay:
    """A replay with episodes of a noisy zero residual; the training's own is not there yet."""
    path, info = replay_of(folder, TASK, SMALL, settings)
    replay = Replay.write(path, info)
    limit = settings.learner.limit
    act(replay, np.random.default_rng(seed), count, lambda _: np.zeros(3), 0.5 * limit, limit)
    return replay


def training(folder: Path, settings: TrainingSettings) -> ResidualTraining:
    return ResidualTraining(folder, TASK, SMALL, ENCODER, settings)


def rate(actor: torch.nn.Module, count: int = 100) -> float:
    """Share of new states in which the residual succeeds."""
    rng = np.random.default_rng(1234)
    states = [draw_state(rng, 0) for _ in range(count)]
    return float(np.mean([succeeds(chosen_residual(actor, state), error) for state, error in states]))
