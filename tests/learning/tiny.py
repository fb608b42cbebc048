"""A problem that is learnt in seconds: where is the bright spot? Also a training process to be killed.

Run as a program: folder, seconds to sleep per batch. It trains the actor there.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import torch

from samrl_core.learning.data.fit import ACTION, IMAGE, RETURN, FitSettings
from samrl_core.learning.sim.regressions import fit_actor
from samrl_core.policy.networks.network_image import XYZ_UNIT

LIMIT = 0.05  # [m]
SIZE = 32  # [px]
SETTINGS = FitSettings(epochs=4, batch_size=16, learning_rate=2e-3, seed=3, checkpoint_every=2)


class Spots:
    """Images of a plane with one bright spot; the action points from the tip, in the middle, to the spot."""

    def __init__(self, count: int, seed: int, wait_s: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        place = np.linspace(-0.06, 0.06, SIZE)
        y, x = np.meshgrid(place, place, indexing="ij")
        spot = rng.uniform(-0.03, 0.03, (count, 2))
        near = (x - spot[:, :1, None]) ** 2 + (y - spot[:, 1:, None]) ** 2 < 0.010**2
        images = np.zeros((count, 6, SIZE, SIZE), dtype=np.float32)
        images[:, 0] = np.where(near, 2.0, -2.0)
        images[:, 3], images[:, 4], images[:, 5] = x / XYZ_UNIT, y / XYZ_UNIT, -0.5
        self.image = torch.from_numpy(images)
        self.action = torch.from_numpy(np.concatenate([spot, np.full((count, 1), -0.01)], axis=1)).float()
        self.wait_s = wait_s

    def __len__(self) -> int:
        return len(self.image)

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        time.sleep(self.wait_s)
        image, action = self.image[indices], self.action[indices]
        # An action's return: whether it points to the right, where the spot is.
        found = {IMAGE: image, ACTION: action, RETURN: (action[:, 0] > 0).float()}
        return {name: value.to(device) for name, value in found.items()}


def main(folder: Path, wait_s: float) -> None:
    torch.set_num_threads(1)
    fit_actor(Spots(160, 1, wait_s), Spots(32, 2), LIMIT, SETTINGS, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]))
