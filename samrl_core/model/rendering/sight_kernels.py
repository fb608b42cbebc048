"""What a sample of the z-buffer says of an edge that passes by: whether its triangle hides the edge.

Functions for Warp kernels, no kernel of their own.
"""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.model.rendering.raster_kernels import triangle_of

# Relative depth by which something must lie in front to hide an edge; 0.5 mm at 0.5 m. Less would
# drop edges that touch what they stand on, from rounding.
HIDE = wp.constant(wp.float32(1.0e-3))
WALK = wp.constant(24)  # triangles to walk over until the one that a line really crosses
OUTSIDE = wp.constant(wp.float32(1.0e-4))  # how negative a barycentric weight may be by rounding


@wp.func
def inverse_depth(m: wp.mat33, u: float, v: float):
    """1/z of a triangle's plane at a pixel."""
    w = m * wp.vec3(u, v, 1.0)
    return w[0] + w[1] + w[2]


@wp.func
def way_out(m: wp.mat33, p: wp.vec3):
    """Corner opposite the side through which p lies outside a triangle, -1 where it is inside."""
    w = m * p
    limit = -OUTSIDE * wp.abs(w[0] + w[1] + w[2])
    if w[0] < limit and w[0] <= w[1] and w[0] <= w[2]:
        return 0
    if w[1] < limit and w[1] <= w[2]:
        return 1
    if w[2] < limit:
        return 2
    return -1


@wp.func
def is_hidden(
    planes: wp.array2d(dtype=wp.mat33),
    neighbors: wp.array2d(dtype=wp.int32),
    face_part: wp.array(dtype=wp.int32),
    keys: wp.array3d(dtype=wp.int64),
    b: int,
    sx: int,
    sy: int,
    u: float,
    v: float,
    s: float,
    edge_iz: float,
    face_a: int,
    face_b: int,
):
    """Whether what a sample sees lies in front of an edge that passes by.

    face_b is the other face of a crease, -1 on the open side of a silhouette. On its other side it is
    face_a: there only a face of the same part that covers the edge itself hides it.

    Hidden only if in front both at the sample and at the edge: a table under an edge that stands on it
    is nearer at the sample, a plane seen at a grazing angle nearer at the edge. Of a round body the
    sample may see a facet some way up the bulge: that hides a crease only if there is no way from it to
    the crease over facets that face the camera alike. And the front of a thin body may be nearer than its
    back by less than what is allowed for rounding; it hides creases of the back.
    """
    triangle = triangle_of(keys[b, sy, sx])
    if triangle < 0:
        return False
    m = planes[b, triangle]
    iz_sample = inverse_depth(m, (float(sx) + 0.5) / s, (float(sy) + 0.5) / s)
    nearest = wp.min(iz_sample, inverse_depth(m, u, v))
    in_front = nearest > edge_iz * (1.0 + HIDE)
    if face_b < 0:
        return in_front
    if face_part[triangle] != face_part[face_a]:
        return in_front and face_b != face_a
    facing = wp.determinant(planes[b, face_a])
    if wp.determinant(m) * facing < 0.0:
        return nearest > edge_iz * (1.0 + 0.1 * HIDE)  # more than rounding: coincident faces turned over
    if in_front:
        at = wp.vec3(u, v, 1.0)
        going = int(1)
        for _k in range(WALK):
            if going == 1:
                if triangle == face_a or triangle == face_b:
                    in_front = False
                    going = 0
                else:
                    side = way_out(planes[b, triangle], at)
                    if side < 0:
                        going = 0
                    else:
                        triangle = neighbors[triangle, side]
                        if triangle < 0:
                            going = 0
                        elif wp.determinant(planes[b, triangle]) * facing <= 0.0:
                            going = 0
                        if going == 0 and face_a == face_b:
                            in_front = False
        if going == 1 and face_a == face_b:
            in_front = False
    return in_front
