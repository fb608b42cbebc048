"""Earth Mover's Distance of two equal clouds by POT (exact) and by GeomLoss (Sinkhorn), with gradients."""
# The library's stubs lack or misstate these.

from __future__ import annotations

import geomloss
import ot
import torch

Result = tuple[float, torch.Tensor]  # mean distance [m], its gradient (N, 3) by the first cloud


def pot(first: torch.Tensor, second: torch.Tensor) -> Result:
    """Network simplex on the matrix of distances."""
    a = first.clone().requires_grad_(True)
    share = torch.full((len(a),), 1.0 / len(a), dtype=a.dtype)
    value = ot.emd2(share, share, torch.cdist(a, second))
    (gradient,) = torch.autograd.grad(value, a)
    return float(value.detach()), gradient


def sinkhorn(first: torch.Tensor, second: torch.Tensor, blur: float = 0.003, scaling: float = 0.9) -> Result:
    """Entropic, without debiasing, which would change the number; `blur` [m]."""
    a = first.clone().requires_grad_(True)
    loss = geomloss.SamplesLoss(
        "sinkhorn", p=1, blur=blur, scaling=scaling, debias=False, backend="tensorized"
    )
    value = loss(a, second)
    (gradient,) = torch.autograd.grad(value, a)
    return float(value.detach()), gradient
