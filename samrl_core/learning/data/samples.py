"""What a regression learns from: numbered samples that come in batches."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch

IMAGE = "image"  # (B, 6, H, W), see `network_image`
ACTION = "action"  # (B, 3) [m]
RETURN = "return_"  # (B,) 0..1


class RegressionSamples(Protocol):
    """Read-only samples; the same indices give the same batch, so that a resumed training sees the same."""

    def __len__(self) -> int:
        """How many there are."""
        ...

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        """Samples (B,) int on a device, by names as above, any float type; samples lie in the first axis."""
        ...
