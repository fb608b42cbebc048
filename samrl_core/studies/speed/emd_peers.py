"""The exact distance of eq. 5 beside POT and GeomLoss: value, gradient and time."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from samrl_core.model.real2sim.emd import earth_movers_distance, farthest_points
from samrl_core.studies.speed.thread_scene import thread_scene
from samrl_core.studies.speed.timing import TimedCall, in_turn

SIZES = (64, 128, 256)
SHIFT = np.array([0.02, -0.01, 0.015])  # of the second cloud [m], beside noise of 2 mm


def clouds(size: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Evenly subsampled vertices of the benchmark's thread, and the same moved; float64 (N, 3) [m]."""
    points = thread_scene(44, 11).vertices.numpy()[4:]
    rng = np.random.default_rng(0)
    moved = points + SHIFT + 0.002 * rng.normal(size=points.shape)
    pick = rng.permutation(len(points))
    moved = moved[pick]
    one, other = (torch.from_numpy(x[farthest_points(x, size)]) for x in (points, moved))
    return one, other


def ours(first: torch.Tensor, second: torch.Tensor) -> tuple[float, torch.Tensor]:
    """Value and gradient through torch."""
    a = first.clone().requires_grad_(True)
    value = earth_movers_distance(a, second, len(first))
    (gradient,) = torch.autograd.grad(value, a)
    return float(value.detach()), gradient


def against_transport(size: int, rounds: int) -> dict[str, Any]:
    """One size of cloud."""
    from samrl_core.studies.speed.peers import transport

    first, second = clouds(size)
    ways = {"samrl": ours, "pot": transport.pot, "geomloss": transport.sinkhorn}
    jobs = [TimedCall(name, lambda way=way: way(first, second)) for name, way in ways.items()]
    timings = in_turn(jobs, rounds)
    found = {name: way(first, second) for name, way in ways.items()}
    value, gradient = found["samrl"]
    result: dict[str, Any] = {"points": size, "value_m": value, "samrl_ms": 1e3 * timings["samrl"].seconds}
    for name in ("pot", "geomloss"):
        other, other_gradient = found[name]
        result[f"{name}_ms"] = 1e3 * timings[name].seconds
        result[f"{name}_ratio"] = timings["samrl"].times_faster(timings[name])
        result[f"{name}_value_error"] = abs(other - value) / value
        result[f"{name}_gradient_cosine"] = float(
            (other_gradient * gradient).sum() / (other_gradient.norm() * gradient.norm())
        )
    return result
