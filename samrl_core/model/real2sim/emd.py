"""Earth Mover's Distance between two point clouds, exact, with its gradient (eq. 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment

from samrl_core.common.errors import InputError

# Exact assignment takes 3 ms for 256 points and 150 ms for 1024, measured on one core; above this size
# the distance costs more than the rendering.
MAX_POINTS = 256


@dataclass(frozen=True, eq=False)
class EarthMovers:
    """The distance and what it pulls at."""

    value: float  # mean distance of matched points [m]
    gradient: np.ndarray  # (N, 3) of `value` by the first cloud's points [-]; zero where not sampled
    matched: np.ndarray  # (M, 2) index into the first and the second cloud


def _checked(points: np.ndarray, which: str) -> np.ndarray:
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3:
        raise InputError(f"{which} cloud has shape {p.shape}, must be (N, 3)")
    if p.shape[0] == 0:
        raise InputError(f"{which} cloud is empty; is the target in the image, and does its depth exist?")
    if not np.isfinite(p).all():
        raise InputError(
            f"{which} cloud has {int((~np.isfinite(p)).sum())} non-finite numbers; drop them first"
        )
    return p


def farthest_points(points: np.ndarray, count: int) -> np.ndarray:
    """Index of `count` points that spread evenly, the one farthest from the centre first.

    Args:
        points: cloud (N, 3) [m].
        count: how many, at most N.

    Raises:
        InputError: the cloud is empty, not finite, or smaller than `count`.

    Source: Gonzalez 1985, "Clustering to minimize the maximum intercluster distance". Starting at the
    farthest from the centre instead of at a random point makes it deterministic.
    """
    p = _checked(points, "sampled")
    if not 1 <= count <= p.shape[0]:
        raise InputError(f"cannot take {count} of {p.shape[0]} points")
    # Float32 coordinates halve the memory traffic; resolution 0.1 um at 1 m. Three flat arrays beat (N, 3).
    x, y, z = np.ascontiguousarray((p - p.mean(axis=0)).T, dtype=np.float32)
    chosen = np.empty(count, dtype=np.int64)
    chosen[0] = int(np.argmax(x * x + y * y + z * z))
    nearest = np.full(p.shape[0], np.inf, dtype=np.float32)
    for k in range(1, count):
        last = chosen[k - 1]
        np.minimum(nearest, (x - x[last]) ** 2 + (y - y[last]) ** 2 + (z - z[last]) ** 2, out=nearest)
        chosen[k] = int(np.argmax(nearest))
    return chosen


def earth_movers(first: np.ndarray, second: np.ndarray, max_points: int = MAX_POINTS) -> EarthMovers:
    """Mean distance of the cheapest one-to-one matching, after both are subsampled to equal size.

    Args:
        first: cloud (N, 3) [m], the one that moves.
        second: cloud (K, 3) [m].
        max_points: both are subsampled to min(N, K, max_points) by farthest-point sampling.

    Raises:
        InputError: a cloud is empty, of wrong shape or not finite.

    Source: eq. 5; Hungarian matching as in Crouse 2016 (SciPy's `linear_sum_assignment`).
    """
    a, b = _checked(first, "first"), _checked(second, "second")
    size = min(a.shape[0], b.shape[0], max_points)
    ia, ib = (farthest_points(p, size) if size < len(p) else np.arange(size) for p in (a, b))
    offset = a[ia][:, None, :] - b[ib][None, :, :]
    cost = np.sqrt(np.einsum("ijk,ijk->ij", offset, offset))
    row, column = linear_sum_assignment(cost)
    distance = cost[row, column]
    # The optimal matching stays the same for small moves, so the gradient is that of the matched sum.
    safe = np.where(distance > 0.0, distance, 1.0)
    gradient = np.zeros_like(a)
    gradient[ia[row]] = offset[row, column] / safe[:, None] / size
    return EarthMovers(float(distance.mean()), gradient, np.stack([ia[row], ib[column]], axis=1))


class _EarthMoversFunction(torch.autograd.Function):
    """Carries the matched gradient into torch."""

    @staticmethod
    def forward(ctx, first: torch.Tensor, second: torch.Tensor, max_points: int) -> torch.Tensor:
        a, b = first.detach().cpu().numpy(), second.detach().cpu().numpy()
        result = earth_movers(a, b, max_points)
        pull = result.gradient[result.matched[:, 0]]
        other = np.zeros(b.shape)
        other[result.matched[:, 1]] = -pull
        ctx.save_for_backward(first.new_tensor(result.gradient), second.new_tensor(other))
        return first.new_tensor(result.value)

    @staticmethod
    def backward(ctx, *grad_outputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, None]:
        first, second = ctx.saved_tensors
        return grad_outputs[0] * first, grad_outputs[0] * second, None


def earth_movers_distance(
    first: torch.Tensor, second: torch.Tensor, max_points: int = MAX_POINTS
) -> torch.Tensor:
    """`earth_movers` as a scalar [m] in torch's graph, differentiable in both clouds (N, 3), (K, 3) [m].

    Raises:
        InputError: a cloud is empty, of wrong shape or not finite.
    """
    value = _EarthMoversFunction.apply(first, second, max_points)
    assert isinstance(value, torch.Tensor)
    return value
