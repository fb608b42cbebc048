"""Features of a replay's steps under the nominal policy's encoder, worked out once and kept."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError
from samrl_core.learning.images.packed_images import network_images
from samrl_core.learning.residual.replay import Replay
from samrl_core.learning.residual.transitions import Batch, Transitions
from samrl_core.policy.networks.networks import FEATURES, Encoder, SimActor
from samrl_core.policy.networks.weights import load_weights, weights_file


def nominal_encoder(task: str, cell: CellSpec, folder: Path | None = None) -> Encoder:
    """The encoder of a task's `sim_actor`: from a folder, or from the package.

    Raises:
        InputError: the file is missing or does not fit; see `load_weights`.
    """
    actor, _ = load_weights(weights_file(task, "sim_actor", folder), "sim_actor", task, cell)
    assert isinstance(actor, SimActor)
    return actor.encoder.requires_grad_(False)


def fingerprint(encoder: Encoder) -> str:
    """Hexadecimal SHA-256 of its weights in half precision, as files keep them."""
    found = hashlib.sha256()
    for name, value in sorted(encoder.state_dict().items()):
        found.update(name.encode() + value.detach().to("cpu", torch.float16).contiguous().numpy().tobytes())
    return found.hexdigest()


class StepFeatures:
    """What batches are made of: 0.5 kB a step, where its images take 0.2 MB."""

    def __init__(
        self, replay: Replay, cell: CellSpec, encoder: Encoder, device: torch.device | str = "cpu"
    ) -> None:
        """Reads nothing yet; the encoder is on the device."""
        self._replay, self._cell, self._encoder = replay, cell, encoder
        self._device = torch.device(device)
        self._numbers = np.zeros(0, dtype=np.int64)  # of the steps that are here, in order
        self._features = torch.zeros((0, FEATURES))
        self._nominal = self._residual = torch.zeros((0, 3))

    def take_in(self) -> int:
        """Steps that came since the last time; returns how many. Those that a full ring lost go."""
        present = self._replay.present()
        kept = torch.from_numpy(np.isin(self._numbers, present))
        numbers, features, vectors = [], [], []
        for number in present[present > (self._numbers[-1] if self._numbers.size else 0)]:
            try:
                row = self._replay.bodies(np.array([number]))
            except InputError:  # written over since it was found
                continue
            look = (row["color"], row["depth"], row["camera"], row["tip"])
            with torch.no_grad():  # each by itself: in a batch, the last bits depend on the others
                features.append(self._encoder(network_images(*look, self._cell, self._device))[0].cpu())
            vectors.append(np.stack([row["nominal"][0], row["residual"][0]]).astype(np.float32))
            numbers.append(number)
        if numbers:
            nominal, residual = torch.from_numpy(np.stack(vectors, axis=1))
            self._features = torch.cat([self._features[kept], torch.stack(features)])
            self._nominal = torch.cat([self._nominal[kept], nominal])
            self._residual = torch.cat([self._residual[kept], residual])
            self._numbers = np.concatenate([self._numbers[kept.numpy()], numbers])
        return len(numbers)

    def batch(self, transitions: Transitions, size: int, generator: torch.Generator) -> Batch:
        """`size` transitions, drawn uniformly with replacement.

        Raises:
            InputError: of a step that was not taken in.
        """
        chosen = torch.randint(len(transitions), (size,), generator=generator).numpy()
        before, after = self._places(transitions.start[chosen]), self._places(transitions.after[chosen])

        def there(values: torch.Tensor) -> torch.Tensor:
            return values.to(self._device, torch.float32)

        return Batch(
            there(self._features[before]),
            there(self._nominal[before]),
            there(self._residual[before]),
            there(torch.from_numpy(transitions.reward[chosen])),
            there(torch.from_numpy(transitions.discount[chosen])),
            there(self._features[after]),
            there(self._nominal[after]),
            transitions.episodes,
        )

    def _places(self, numbers: np.ndarray) -> np.ndarray:
        places = np.searchsorted(self._numbers, numbers)
        if (
            not self._numbers.size
            or (self._numbers[places.clip(max=self._numbers.size - 1)] != numbers).any()
        ):
            raise InputError("a transition's step is not here; call `take_in` after each new step")
        return places
