"""Images of a replay's steps as the networks see them, made once and kept where the networks are."""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.errors import InputError
from samrl_core.learn.packed_images import network_images
from samrl_core.learn.replay import Replay
from samrl_core.learn.transitions import Batch, Transitions
from samrl_core.robots.robot import CellSpec

_AT_ONCE = 64  # steps


class StepImages:
    """Batches without reading the replay again: 0.2 MB a step at 128x128 px, in half precision.

    Where memory is scarce, `draw_batch` makes each batch from the replay instead.
    """

    def __init__(self, replay: Replay, cell: CellSpec, device: torch.device | str = "cpu") -> None:
        self._replay, self._cell, self._device = replay, cell, torch.device(device)
        self._numbers = np.zeros(0, dtype=np.int64)  # of the steps that are here, in order
        self._images: list[torch.Tensor] = []  # (6, H, W) float16 each
        self._nominal = self._residual = torch.zeros((0, 3))

    def take_in(self) -> int:
        """Steps that came since the last time; returns how many."""
        present = self._replay.present()
        new = present[present > (self._numbers[-1] if self._numbers.size else 0)]
        vectors = []
        for first in range(0, new.size, _AT_ONCE):
            rows = self._replay.bodies(new[first : first + _AT_ONCE])
            look = (rows["color"], rows["depth"], rows["camera"], rows["tip"])
            self._images += list(network_images(*look, self._cell, self._device).half())
            vectors.append(np.stack([rows["nominal"], rows["residual"]]).astype(np.float32))
        if vectors:
            both = torch.from_numpy(np.concatenate(vectors, axis=1))
            self._nominal = torch.cat([self._nominal, both[0]])
            self._residual = torch.cat([self._residual, both[1]])
        self._numbers = np.concatenate([self._numbers, new])
        return int(new.size)

    def batch(self, transitions: Transitions, size: int, generator: torch.Generator) -> Batch:
        """`size` transitions, drawn uniformly with replacement; the same ones as `draw_batch` draws.

        Raises:
            InputError: of a step that was not taken in.
        """
        chosen = torch.randint(len(transitions), (size,), generator=generator).numpy()
        before, after = self._places(transitions.start[chosen]), self._places(transitions.after[chosen])

        def images(places: np.ndarray) -> torch.Tensor:
            return torch.stack([self._images[place] for place in places]).float()

        def there(values: torch.Tensor) -> torch.Tensor:
            return values.to(self._device, torch.float32)

        return Batch(
            images(before),
            there(self._nominal[before]),
            there(self._residual[before]),
            there(torch.from_numpy(transitions.reward[chosen])),
            there(torch.from_numpy(transitions.discount[chosen])),
            images(after),
            there(self._nominal[after]),
        )

    def _places(self, numbers: np.ndarray) -> np.ndarray:
        places = np.searchsorted(self._numbers, numbers)
        if (
            not self._numbers.size
            or (self._numbers[places.clip(max=self._numbers.size - 1)] != numbers).any()
        ):
            raise InputError("a transition's step is not here; call `take_in` after each new step")
        return places
