"""Transitions of a replay over one or more steps, and batches of them: features in place of images.

The features are those of the nominal policy's encoder. They are computed once per step and cached.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError
from samrl_core.learning.images.packed_images import network_images
from samrl_core.learning.residual.replay import End, Replay
from samrl_core.policy.networks.networks import FEATURES, Encoder, SimActor
from samrl_core.policy.networks.weights import load_weights, weights_file


@dataclass(frozen=True, eq=False)
class Transitions:
    """Where each transition begins and ends, by numbers of steps (N,)."""

    start: np.ndarray  # (N,) step in whose state the residual was chosen
    after: np.ndarray  # (N,) step whose state the return goes on from; without meaning where discount is 0
    reward: np.ndarray  # (N,) discounted sum of eq. 16's rewards on the way
    discount: np.ndarray  # (N,) of what follows, 0 where the episode has ended
    episodes: int  # how many they are from

    def __len__(self) -> int:
        return int(self.start.size)


def transitions_of(replay: Replay, n_step: int, gamma: float) -> Transitions:
    """All transitions that are known whole, of `n_step` steps or as many as there are.

    A step counts when its successor is there or its episode ended with it, in success (reward 1) or with all
    actions used up (reward 0): both end the return, as in the paper. A step cut short by a fault counts only
    as what an earlier one led to.
    """
    numbers, episodes, steps, ends = replay.outline()
    ended = (ends == End.SUCCESS) | (ends == End.FAILURE)
    goes_on = np.zeros(numbers.size, dtype=bool)
    if numbers.size:
        neighbour = (np.diff(numbers) == 1) & (np.diff(episodes) == 0) & (np.diff(steps) == 1)
        goes_on[:-1] = (ends[:-1] == End.OPEN) & neighbour
    at = np.arange(numbers.size)
    alive = ended | goes_on
    known = alive.copy()
    reward, discount = np.zeros(numbers.size), np.ones(numbers.size)
    for _ in range(n_step):
        reward += np.where(alive & (ends[at] == End.SUCCESS), discount, 0.0)
        discount = np.where(alive & ended[at], 0.0, discount)
        alive = alive & goes_on[at]
        at = np.where(alive, at + 1, at)
        discount = np.where(alive, gamma * discount, discount)
    count = np.unique(episodes[known]).size
    return Transitions(numbers[known], numbers[at][known], reward[known], discount[known], count)


@dataclass(frozen=True, eq=False)
class Batch:
    """Transitions as tensors."""

    features: torch.Tensor  # (B, 128) of the real image before the action
    nominal: torch.Tensor  # (B, 3) [m]
    residual: torch.Tensor  # (B, 3) as it was applied [m]
    reward: torch.Tensor  # (B,)
    discount: torch.Tensor  # (B,)
    next_features: torch.Tensor  # (B, 128)
    next_nominal: torch.Tensor  # (B, 3) [m]
    episodes: int  # of all transitions that these were sampled from


def nominal_encoder(task: str, cell: CellSpec, folder: Path | None = None) -> Encoder:
    """The encoder of a task's `sim_actor`: from a folder, or from the package.

    Raises:
        InputError: the file is missing or does not fit; see `load_weights`.
    """
    actor, _ = load_weights(weights_file(task, "sim_actor", folder), "sim_actor", task, cell)
    assert isinstance(actor, SimActor)
    return actor.encoder.requires_grad_(False)


def encoder_sha256(encoder: Encoder) -> str:
    """Hexadecimal SHA-256 of its weights in half precision, as files keep them."""
    found = hashlib.sha256()
    for name, value in sorted(encoder.state_dict().items()):
        found.update(name.encode() + value.detach().to("cpu", torch.float16).contiguous().numpy().tobytes())
    return found.hexdigest()


class StepFeatures:
    """Cached features of a replay's steps: 0.5 kB a step, where its images take 0.2 MB."""

    def __init__(
        self, replay: Replay, cell: CellSpec, encoder: Encoder, device: torch.device | str = "cpu"
    ) -> None:
        """Reads nothing yet; the encoder is on the device."""
        self._replay, self._cell, self._encoder = replay, cell, encoder
        self._device = torch.device(device)
        self._numbers = np.zeros(0, dtype=np.int64)  # of the steps with features, in order
        self._features = torch.zeros((0, FEATURES))
        self._nominal = self._residual = torch.zeros((0, 3))

    def add_new(self) -> int:
        """Compute features of the steps that came since the last call; returns how many.

        Steps that a full ring has overwritten are removed.
        """
        present = self._replay.present()
        present_rows = torch.from_numpy(np.isin(self._numbers, present))
        numbers, features, vectors = [], [], []
        for number in present[present > (self._numbers[-1] if self._numbers.size else 0)]:
            try:
                row = self._replay.bodies(np.array([number]))
            except InputError:  # overwritten since it was found
                continue
            view = (row["color"], row["depth"], row["camera"], row["tip"])
            with torch.no_grad():  # one by one: in a batch, the last bits depend on the others
                features.append(self._encoder(network_images(*view, self._cell, self._device))[0].cpu())
            vectors.append(np.stack([row["nominal"][0], row["residual"][0]]).astype(np.float32))
            numbers.append(number)
        if numbers:
            nominal, residual = torch.from_numpy(np.stack(vectors, axis=1))
            self._features = torch.cat([self._features[present_rows], torch.stack(features)])
            self._nominal = torch.cat([self._nominal[present_rows], nominal])
            self._residual = torch.cat([self._residual[present_rows], residual])
            self._numbers = np.concatenate([self._numbers[present_rows.numpy()], numbers])
        return len(numbers)

    def sample_batch(self, transitions: Transitions, size: int, generator: torch.Generator) -> Batch:
        """`size` transitions, sampled uniformly with replacement.

        Raises:
            InputError: the features of a step are missing, see `add_new`.
        """
        chosen = torch.randint(len(transitions), (size,), generator=generator).numpy()
        before, after = self._rows_of(transitions.start[chosen]), self._rows_of(transitions.after[chosen])

        def on_device(values: torch.Tensor) -> torch.Tensor:
            return values.to(self._device, torch.float32)

        return Batch(
            on_device(self._features[before]),
            on_device(self._nominal[before]),
            on_device(self._residual[before]),
            on_device(torch.from_numpy(transitions.reward[chosen])),
            on_device(torch.from_numpy(transitions.discount[chosen])),
            on_device(self._features[after]),
            on_device(self._nominal[after]),
            transitions.episodes,
        )

    def _rows_of(self, numbers: np.ndarray) -> np.ndarray:
        rows = np.searchsorted(self._numbers, numbers)
        if not self._numbers.size or (self._numbers[rows.clip(max=self._numbers.size - 1)] != numbers).any():
            raise InputError("a transition's step has no features yet; call `add_new` after each new step")
        return rows
