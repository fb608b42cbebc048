"""The light of a scene: one direction and ambient, as tensors that gradients reach."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class Light:
    """Lambert's law: a colour is multiplied by ambient + intensity max(0, normal . direction)."""

    towards: torch.Tensor  # (3,) or (B, 3) in world, of any length but 0
    intensity: torch.Tensor  # () or (B,) of the directional part, at least 0
    ambient: torch.Tensor  # () or (B,) at least 0

    @staticmethod
    def of(towards: tuple[float, float, float], intensity: float, ambient: float) -> Light:
        """A light from plain numbers."""
        return Light(*(torch.tensor(v, dtype=torch.float64) for v in (towards, intensity, ambient)))

    @property
    def batch(self) -> tuple[int, ...]:
        """() or (B,), the widest of its fields.

        Raises:
            InputError: a field has another shape than documented, or two of them differ in B.
        """
        shapes = (self.towards.shape[:-1], self.intensity.shape, self.ambient.shape)
        sizes = {tuple(s) for s in shapes if len(s) > 0}
        if self.towards.shape[-1:] != (3,) or any(len(s) > 1 for s in shapes) or len(sizes) > 1:
            raise InputError(
                f"light has shapes {tuple(self.towards.shape)}, {tuple(self.intensity.shape)}, "
                f"{tuple(self.ambient.shape)}; must be (3,), (), (), each with the same B in front or none"
            )
        return sizes.pop() if sizes else ()

    def rows(self, batch: int, device: torch.device) -> torch.Tensor:
        """Unit direction, intensity and ambient of B images, (B, 5) float32.

        Raises:
            InputError: not finite, negative, or a direction of no length.
        """
        towards, intensity, ambient = (
            t.to(device, torch.float64) for t in (self.towards, self.intensity, self.ambient)
        )
        length = torch.linalg.vector_norm(towards, dim=-1, keepdim=True)
        with torch.no_grad():
            good = (length > 0).all() & (length < torch.inf).all()
            for value in (intensity, ambient):
                good &= (value >= 0).all() & (value < torch.inf).all()
        if not bool(good):
            raise InputError(
                f"light towards {self.towards.tolist()}, intensity {self.intensity.tolist()}, ambient "
                f"{self.ambient.tolist()}: must be finite, not negative, the direction of some length"
            )
        parts = [
            (towards / length).expand(batch, 3),
            intensity.reshape(-1, 1).expand(batch, 1),
            ambient.reshape(-1, 1).expand(batch, 1),
        ]
        return torch.cat(parts, dim=1).to(torch.float32)
