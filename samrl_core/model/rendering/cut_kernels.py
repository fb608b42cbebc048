"""Warp kernel of the jumps that are no mesh edges: where two parts run through each other, and where the
near plane cuts a part open.

Inverse depth is linear on the screen: a . (u, v, 1), a the sum of the rows of a triangle's W. So the
curve in which triangles A and B meet is the line g = (a_B - a_A) . (u, v, 1) = 0, and the near plane cuts
A in g = a_A . (u, v, 1) - 1 / near = 0; A is seen where g < 0. Each such line is found between
neighbouring samples that see different triangles, and integrated by its crossings with the rows or the
columns of samples, whichever it crosses more steeply. When W changes the line moves by -dg / |grad g|, so
the gradient goes to W and the triangles' adjoint carries it on to the vertices.

Parts whose surfaces touch along an edge (a box on a table) have that jump already in the edge integral;
`edge_kernels` claims those samples.
"""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.model.rendering.kernel_types import Pixel
from samrl_core.model.rendering.raster_kernels import ID_MASK, triangle_of, value_at
from samrl_core.model.rendering.sight_kernels import WALK, way_out

# Products and sums are rounded one by one, or a GPU would see another triangle at an edge than a CPU.
wp.set_module_options({"fuse_fp": False})

# Slope of g per sample, relative to 1/z, below which surfaces are one and the same: rounding decides.
PARALLEL = wp.constant(wp.float32(1.0e-5))


@wp.func
def row_sum(m: wp.mat33):
    """a with 1/z = a . (u, v, 1)."""
    return m[0] + m[1] + m[2]


@wp.func
def crossing(g: wp.vec3, p: wp.vec3, q: wp.vec3):
    """Fraction of the way from p to q at which g . (u, v, 1) rises through 0, -1 where it does not."""
    start = wp.dot(g, p)
    rise = wp.dot(g, q) - start
    if rise <= 0.0:
        return float(-1.0)
    return -start / rise


@wp.func
def owns_axis(g: wp.vec3, axis: int):
    """Whether this line is integrated by its crossings along this axis."""
    if axis == 0:
        return wp.abs(g[0]) >= wp.abs(g[1])
    return wp.abs(g[1]) > wp.abs(g[0])


@wp.func
def weight(
    jump: Pixel,
    image_grad: wp.array3d(dtype=Pixel),
    b: int,
    p: wp.vec3,
    g: wp.vec3,
    axis: int,
    spacing: float,
):
    """dL/dg of one crossing, but for its sign."""
    x = wp.clamp(int(wp.floor(p[0])), 0, image_grad.shape[2] - 1)
    y = wp.clamp(int(wp.floor(p[1])), 0, image_grad.shape[1] - 1)
    return wp.dot(jump, image_grad[b, y, x]) * spacing / wp.abs(g[axis])


@wp.func
def add_to_rows(planes_grad: wp.array2d(dtype=wp.mat33), b: int, triangle: int, p: wp.vec3, gain: float):
    """Adds gain times the derivative of a . p by W."""
    wp.atomic_add(planes_grad, b, triangle, wp.outer(wp.vec3(gain, gain, gain), p))


@wp.func
def near_cut(
    planes: wp.array2d(dtype=wp.mat33),
    faces: wp.array2d(dtype=wp.int32),
    neighbors: wp.array2d(dtype=wp.int32),
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    background: Pixel,
    near: float,
    b: int,
    seen: int,
    behind: int,
    p: wp.vec3,
    q: wp.vec3,
    axis: int,
    spacing: float,
    image_grad: wp.array3d(dtype=Pixel),
    planes_grad: wp.array2d(dtype=wp.mat33),
):
    """The near plane's cut of the triangle seen at p; at q one looks through to what is behind."""
    if seen < 0:
        return
    triangle = seen
    g = row_sum(planes[b, triangle]) - wp.vec3(0.0, 0.0, 1.0 / near)
    if wp.dot(g, p) > 0.0 or wp.dot(g, q) <= 0.0:
        return
    at = p
    found = int(0)
    for _k in range(WALK):
        if found == 0:
            g = row_sum(planes[b, triangle]) - wp.vec3(0.0, 0.0, 1.0 / near)
            t = crossing(g, p, q)
            if t < 0.0 or t > 1.0:
                return
            at = p + (q - p) * t
            side = way_out(planes[b, triangle], at)
            if side < 0:
                found = 1
            else:
                triangle = neighbors[triangle, side]
                if triangle < 0:
                    return
    if found == 0 or not owns_axis(g, axis):
        return
    look = at
    if behind >= 0:
        rows = row_sum(planes[b, behind])
        if wp.dot(rows, at) < 0.5 * wp.dot(rows, q):
            look = q
    jump = value_at(planes, faces, attributes, brightness, background, b, triangle, at[0], at[1])
    jump -= value_at(planes, faces, attributes, brightness, background, b, behind, look[0], look[1])
    add_to_rows(planes_grad, b, triangle, at, -weight(jump, image_grad, b, at, g, axis, spacing))


@wp.func
def intersection(
    planes: wp.array2d(dtype=wp.mat33),
    faces: wp.array2d(dtype=wp.int32),
    neighbors: wp.array2d(dtype=wp.int32),
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    background: Pixel,
    b: int,
    at_p: int,
    at_q: int,
    p: wp.vec3,
    q: wp.vec3,
    axis: int,
    spacing: float,
    image_grad: wp.array3d(dtype=Pixel),
    planes_grad: wp.array2d(dtype=wp.mat33),
):
    """The line between p and q in which one part comes out of another."""
    first = at_p
    second = at_q
    g = row_sum(planes[b, second]) - row_sum(planes[b, first])
    at = p
    found = int(0)
    for _k in range(WALK):
        if found == 0:
            g = row_sum(planes[b, second]) - row_sum(planes[b, first])
            t = crossing(g, p, q)
            if t < -0.5 or t > 1.5:  # the triangles walked over next may shift it a little
                return
            at = p + (q - p) * t
            side = way_out(planes[b, first], at)
            if side >= 0:
                first = neighbors[first, side]
            else:
                side = way_out(planes[b, second], at)
                if side >= 0:
                    second = neighbors[second, side]
                elif t < 0.0 or t > 1.0:
                    return
                else:
                    found = 1
            if first < 0 or second < 0:
                return
    if found == 0 or not owns_axis(g, axis):
        return
    if wp.abs(g[axis]) * spacing < PARALLEL * wp.dot(row_sum(planes[b, first]), at):
        return
    jump = value_at(planes, faces, attributes, brightness, background, b, first, at[0], at[1])
    jump -= value_at(planes, faces, attributes, brightness, background, b, second, at[0], at[1])
    gain = weight(jump, image_grad, b, at, g, axis, spacing)
    add_to_rows(planes_grad, b, first, at, gain)
    add_to_rows(planes_grad, b, second, at, -gain)


@wp.func
def cuts_of_sample(
    planes: wp.array2d(dtype=wp.mat33),
    faces: wp.array2d(dtype=wp.int32),
    face_part: wp.array(dtype=wp.int32),
    neighbors: wp.array2d(dtype=wp.int32),
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    background: Pixel,
    near: float,
    samples: int,
    keys: wp.array3d(dtype=wp.int64),
    claims: wp.array3d(dtype=wp.uint8),
    image_grad: wp.array3d(dtype=Pixel),
    planes_grad: wp.array2d(dtype=wp.mat33),
    b: int,
    y: int,
    x: int,
):
    """Intersections and near cuts between a sample and its right and lower neighbour."""
    spacing = 1.0 / float(samples)
    here = triangle_of(keys[b, y, x])
    p = wp.vec3((float(x) + 0.5) * spacing, (float(y) + 0.5) * spacing, 1.0)
    for axis in range(2):
        x2 = x + 1 - axis
        y2 = y + axis
        if x2 >= keys.shape[2] or y2 >= keys.shape[1]:
            continue
        there = triangle_of(keys[b, y2, x2])
        if there == here:
            continue
        q = wp.vec3((float(x2) + 0.5) * spacing, (float(y2) + 0.5) * spacing, 1.0)
        near_cut(
            planes, faces, neighbors, attributes, brightness, background, near, b, here, there, p, q, axis,
            spacing, image_grad, planes_grad,
        )  # fmt: skip
        near_cut(
            planes, faces, neighbors, attributes, brightness, background, near, b, there, here, q, p, axis,
            spacing, image_grad, planes_grad,
        )  # fmt: skip
        if here < 0 or there < 0:
            continue
        if face_part[here] == face_part[there]:
            continue
        if claims[b, y, x] != wp.uint8(0) or claims[b, y2, x2] != wp.uint8(0):
            continue
        intersection(
            planes, faces, neighbors, attributes, brightness, background, b, here, there, p, q, axis, spacing,
            image_grad, planes_grad,
        )  # fmt: skip


@wp.kernel(enable_backward=False)
def integrate_cuts(
    run: int,  # samples of a row that one thread takes
    planes: wp.array2d(dtype=wp.mat33),  # (B, F)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    face_part: wp.array(dtype=wp.int32),  # (F,)
    neighbors: wp.array2d(dtype=wp.int32),  # (F, 3)
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    brightness: wp.array2d(dtype=wp.vec3),  # (B, F), per corner; (B, 0) when nothing is lit
    background: Pixel,
    near: float,
    samples: int,
    keys: wp.array3d(dtype=wp.int64),  # (B, H s, W s)
    claims: wp.array3d(dtype=wp.uint8),  # (B, H s, W s)
    image_grad: wp.array3d(dtype=Pixel),  # (B, H, W)
    weighted: wp.array3d(dtype=wp.uint8),  # (B, H, W), 0 where no gradient is within a pixel
    planes_grad: wp.array2d(dtype=wp.mat33),  # (B, F) out, added
):
    """Adds dL/dW of all intersections and near cuts."""
    b, y, part = wp.tid()
    for x in range(part * run, wp.min((part + 1) * run, keys.shape[2])):
        if weighted[b, y / samples, x / samples] == wp.uint8(0):
            continue
        seen = keys[b, y, x] & ID_MASK
        same = int(1)
        if x + 1 < keys.shape[2]:
            if (keys[b, y, x + 1] & ID_MASK) != seen:
                same = 0
        if y + 1 < keys.shape[1]:
            if (keys[b, y + 1, x] & ID_MASK) != seen:
                same = 0
        if same == 0:
            cuts_of_sample(
                planes, faces, face_part, neighbors, attributes, brightness, background, near, samples, keys,
                claims, image_grad, planes_grad, b, y, x,
            )  # fmt: skip
