"""Warp kernels of the z-buffer: triangle planes, rasterising, and the value of a triangle at a place.

A triangle is held as the matrix W that gives, at pixel (u, v), w = W (u, v, 1): barycentric weights
divided by depth, so that their sum is 1/z (homogeneous rasterising, Olano and Greer 1997). W is
linear in the pixel and exists for triangles that reach behind the camera, so that the near plane
costs one comparison instead of new triangles.

Array shapes: B images, V vertices, F triangles, H x W pixels, s x s samples per pixel.
"""
# ruff: noqa: UP018  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.model.rendering.kernel_types import Pixel

# Products and sums are rounded one by one, or a GPU would see another triangle at an edge than a CPU.
wp.set_module_options({"fuse_fp": False})

DEPTH_SCALE = wp.constant(wp.float32(4294967296.0))  # 1/z in units of 2^-32 / m: exact to float32
ID_BITS = wp.constant(wp.int64(24))
ID_MASK = wp.constant(wp.int64(0xFFFFFF))
DILATE = wp.constant(wp.float32(1.0e-4))  # [px] rounding of W may open cracks between neighbours

MAX_FACES = 0xFFFFFF
MIN_NEAR = 2.0**-7  # [m] keeps the key positive: 2^7 * 2^32 * 2^24 = 2^63


@wp.struct
class Pinhole:
    """Pinhole parameters and the near plane."""

    fx: wp.float32
    fy: wp.float32
    cx: wp.float32
    cy: wp.float32
    near: wp.float32


@wp.func
def triangle_of(key: wp.int64):
    """Index of the triangle in a z-buffer key, -1 where nothing was drawn."""
    if key == wp.int64(0):
        return -1
    return int(ID_MASK - (key & ID_MASK))


@wp.func
def interpolate(w: wp.vec3, a0: Pixel, a1: Pixel, a2: Pixel):
    """Perspective-correct value from weights over depth."""
    z = 1.0 / (w[0] + w[1] + w[2])
    return a0 * (w[0] * z) + a1 * (w[1] * z) + a2 * (w[2] * z)


@wp.func
def corner_value(
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    b: int,
    triangle: int,
    k: int,
    vertex: int,
):
    """Value of a triangle at its k-th corner: the vertex's, its colour times the light there."""
    a = attributes[b, vertex]
    if brightness.shape[1] > 0:
        lit = brightness[b, triangle][k]
        a[0] = a[0] * lit
        a[1] = a[1] * lit
        a[2] = a[2] * lit
    return a


@wp.func
def value_at(
    planes: wp.array2d(dtype=wp.mat33),
    faces: wp.array2d(dtype=wp.int32),
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    background: Pixel,
    b: int,
    triangle: int,
    u: float,
    v: float,
):
    """Value of a triangle at a place in the image, the background's where there is none."""
    if triangle < 0:
        return background
    return interpolate(
        planes[b, triangle] * wp.vec3(u, v, 1.0),
        corner_value(attributes, brightness, b, triangle, 0, faces[triangle, 0]),
        corner_value(attributes, brightness, b, triangle, 1, faces[triangle, 1]),
        corner_value(attributes, brightness, b, triangle, 2, faces[triangle, 2]),
    )


@wp.kernel(enable_backward=False)
def set_up_triangles(
    points: wp.array2d(dtype=wp.vec3),  # (B, V) camera coordinates [m]
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    lens: Pinhole,
    width: int,
    height: int,
    planes: wp.array2d(dtype=wp.mat33),  # (B, F) out
    boxes: wp.array2d(dtype=wp.vec4),  # (B, F) out: u, v lower, u, v upper [px]; empty when lower > upper
):
    """W of every triangle in double precision (thin triangles cancel in single), and its image box."""
    b, f = wp.tid()
    boxes[b, f] = wp.vec4(1.0, 1.0, 0.0, 0.0)
    c0 = points[b, faces[f, 0]]
    c1 = points[b, faces[f, 1]]
    c2 = points[b, faces[f, 2]]
    if c0[2] < lens.near and c1[2] < lens.near and c2[2] < lens.near:
        return
    d0 = wp.vec3d(wp.float64(c0[0]), wp.float64(c0[1]), wp.float64(c0[2]))
    e1 = wp.vec3d(wp.float64(c1[0]), wp.float64(c1[1]), wp.float64(c1[2])) - d0
    e2 = wp.vec3d(wp.float64(c2[0]), wp.float64(c2[1]), wp.float64(c2[2])) - d0
    n = wp.cross(e1, e2)
    volume = wp.dot(d0, n)
    if wp.abs(volume) <= wp.float64(1.0e-7) * wp.length(d0) * wp.length(n):
        return  # seen edge-on: covers no sample
    r1 = wp.cross(e2, d0) / volume
    r2 = wp.cross(d0, e1) / volume
    r0 = n / volume - r1 - r2
    ax = wp.float64(1.0) / wp.float64(lens.fx)
    ay = wp.float64(1.0) / wp.float64(lens.fy)
    ox = wp.float64(lens.cx) * ax
    oy = wp.float64(lens.cy) * ay
    planes[b, f] = wp.mat33(
        wp.float32(r0[0] * ax), wp.float32(r0[1] * ay), wp.float32(r0[2] - r0[0] * ox - r0[1] * oy),
        wp.float32(r1[0] * ax), wp.float32(r1[1] * ay), wp.float32(r1[2] - r1[0] * ox - r1[1] * oy),
        wp.float32(r2[0] * ax), wp.float32(r2[1] * ay), wp.float32(r2[2] - r2[0] * ox - r2[1] * oy),
    )  # fmt: skip
    lo_u = float(1.0e9)
    lo_v = float(1.0e9)
    hi_u = float(-1.0e9)
    hi_v = float(-1.0e9)
    for k in range(3):
        p = points[b, faces[f, k]]
        q = points[b, faces[f, (k + 1) % 3]]
        if p[2] < lens.near and q[2] < lens.near:
            continue
        if p[2] < lens.near:
            p = p + (q - p) * ((lens.near - p[2]) / (q[2] - p[2]))
        elif q[2] < lens.near:
            q = q + (p - q) * ((lens.near - q[2]) / (p[2] - q[2]))
        pu = lens.fx * p[0] / p[2] + lens.cx
        pv = lens.fy * p[1] / p[2] + lens.cy
        qu = lens.fx * q[0] / q[2] + lens.cx
        qv = lens.fy * q[1] / q[2] + lens.cy
        lo_u = wp.min(lo_u, wp.min(pu, qu))
        lo_v = wp.min(lo_v, wp.min(pv, qv))
        hi_u = wp.max(hi_u, wp.max(pu, qu))
        hi_v = wp.max(hi_v, wp.max(pv, qv))
    boxes[b, f] = wp.vec4(
        wp.clamp(lo_u - DILATE, -1.0, float(width) + 1.0),
        wp.clamp(lo_v - DILATE, -1.0, float(height) + 1.0),
        wp.clamp(hi_u + DILATE, -1.0, float(width) + 1.0),
        wp.clamp(hi_v + DILATE, -1.0, float(height) + 1.0),
    )


@wp.kernel(enable_backward=False)
def rasterize(
    planes: wp.array2d(dtype=wp.mat33),  # (B, F)
    boxes: wp.array2d(dtype=wp.vec4),  # (B, F)
    near: float,
    samples: int,
    strips: int,  # threads that share a triangle, row by row
    keys: wp.array3d(dtype=wp.int64),  # (B, H s, W s), zero where empty
):
    """Nearest triangle per sample; of equals the lowest index wins, in any order of execution."""
    b, f, strip = wp.tid()
    box = boxes[b, f]
    if box[0] > box[2]:
        return
    s = float(samples)
    first_row = wp.max(int(wp.ceil(box[1] * s - 0.5)), 0)
    last_row = wp.min(int(wp.floor(box[3] * s - 0.5)), keys.shape[1] - 1)
    m = planes[b, f]
    du = m[0, 0] + m[1, 0] + m[2, 0]
    low = wp.int64(0xFFFFFF) - wp.int64(f)
    for row in range(first_row + strip, last_row + 1, strips):
        v = (float(row) + 0.5) / s
        lo = box[0]
        hi = box[2]
        total = float(0.0)
        for k in range(3):
            a = m[k, 0]
            q = m[k, 1] * v + m[k, 2]
            total += q
            q += DILATE * (wp.abs(a) + wp.abs(m[k, 1]))
            if a > 0.0:
                lo = wp.max(lo, -q / a)
            elif a < 0.0:
                hi = wp.min(hi, -q / a)
            elif q < 0.0:
                hi = lo - 1.0
        first = wp.max(int(wp.ceil(lo * s - 0.5)), 0)
        last = wp.min(int(wp.floor(hi * s - 0.5)), keys.shape[2] - 1)
        for column in range(first, last + 1):
            inverse_depth = total + du * ((float(column) + 0.5) / s)
            if inverse_depth > 0.0 and inverse_depth * near <= 1.0:
                key = (wp.int64(inverse_depth * DEPTH_SCALE) << ID_BITS) | low
                wp.atomic_max(keys, b, row, column, key)
