"""Smooth displacements of a mesh's vertices: a step in u moves the vertices by (I + stiffness L)^-1 u.

Gradients of an image by single vertices are noisy and tear the surface; taken through this field they move
patches (Nicolet, Jacobson and Jakob, "Large Steps in Inverse Rendering of Geometry", 2021, eq. 11). L is the
combinatorial Laplacian. Unlike a penalty on the surface's own curvature it does not shrink the surface.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy.sparse import coo_array, csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from samrl_core.common.errors import InputError


def laplacian(faces: np.ndarray, count: int) -> csc_array:
    """Degree less adjacency (V, V) of the mesh's edges."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    i, j = np.unique(np.sort(ends, axis=1), axis=0).T
    ones = np.ones(len(i))
    half = coo_array((ones, (i, j)), shape=(count, count))
    adjacent = csc_array(half + half.T)
    return csc_array(diags_array(np.asarray(adjacent.sum(axis=0))) - adjacent)


class SmoothField:
    """The field of one mesh, factored once."""

    def __init__(self, faces: np.ndarray, count: int, stiffness: float) -> None:
        """Of `count` vertices; a bump of one vertex is spread over some sqrt(stiffness) edges.

        Raises:
            InputError: the stiffness is negative or not finite.
        """
        if not (np.isfinite(stiffness) and stiffness >= 0):
            raise InputError(f"stiffness of the displacements is {stiffness}, must be at least 0")
        self._factors = splu(csc_array(eye_array(count) + stiffness * laplacian(faces, count)))

    def __call__(self, u: torch.Tensor) -> torch.Tensor:
        """Displacements (V, 3) of u (V, 3) float64, differentiable."""
        result = _Solve.apply(u, self._factors)
        assert isinstance(result, torch.Tensor)
        return result


class _Solve(torch.autograd.Function):
    """A symmetric system: its gradient is the solution of the same one."""

    @staticmethod
    def forward(ctx, u: torch.Tensor, factors) -> torch.Tensor:
        ctx.factors = factors
        return torch.from_numpy(factors.solve(u.detach().numpy()))

    @staticmethod
    def backward(ctx, *grad_outputs: torch.Tensor) -> tuple[torch.Tensor, None]:
        return torch.from_numpy(ctx.factors.solve(grad_outputs[0].numpy())), None
