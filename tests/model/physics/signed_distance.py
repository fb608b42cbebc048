"""Signed distance of points to a solid by the kernels' own function, outside of any simulation."""

from functools import cache

import numpy as np
import warp as wp

from samrl_core.common.errors import InputError
from samrl_core.common.warp_runtime import start
from samrl_core.model.physics.distance_kernels import distance_functions
from samrl_core.model.physics.shapes import Shape


@cache
def _kernel():
    distance = distance_functions(True).distance

    @wp.kernel(enable_backward=False, module="unique")
    def distances(
        kind: int,
        numbers: wp.array2d(dtype=wp.float64),
        points: wp.array(dtype=wp.vec3d),
        value: wp.array(dtype=wp.float64),
        normal: wp.array(dtype=wp.vec3d),
    ):
        i = wp.tid()
        n, d = distance(kind, numbers, 0, points[i])
        value[i] = d
        normal[i] = n

    return distances


def signed_distance(shape: Shape, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance and outward normal of a solid, by the kernels' own functions in float64.

    Args:
        shape: the solid.
        points: (K, 3) in the frame of the solid's body [m].

    Returns:
        distances (K,) [m], negative inside, and unit normals (K, 3) in the body's frame.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise InputError(f"points have shape {points.shape}, must be finite and (K, 3)")
    start()
    local = shape.shape_in_body.inverse().apply(points)
    value = wp.zeros(len(points), dtype=wp.float64, device="cpu")
    normal = wp.zeros(len(points), dtype=wp.vec3d, device="cpu")
    numbers = wp.array(shape.numbers[None], dtype=wp.float64, device="cpu")
    where = wp.array(local, dtype=wp.vec3d, device="cpu")
    inputs = [int(shape.kind), numbers, where, value, normal]
    wp.launch(_kernel(), dim=len(points), inputs=inputs, device="cpu", record_tape=False)
    return value.numpy().copy(), normal.numpy() @ shape.shape_in_body.rotation.T
