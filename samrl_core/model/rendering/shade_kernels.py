"""Warp kernels of shading: what each pixel sees, and its adjoint back to the triangles and their corners.

Array shapes: B images, V vertices, F triangles, H x W pixels, s x s samples per pixel.
"""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.model.rendering.kernel_types import CHANNELS, Pixel
from samrl_core.model.rendering.raster_kernels import (
    DEPTH_SCALE,
    ID_BITS,
    ID_MASK,
    Pinhole,
    corner_value,
    triangle_of,
)

# Products and sums are rounded one by one, or a GPU would see another triangle at an edge than a CPU.
wp.set_module_options({"fuse_fp": False})


@wp.func
def slope_at(
    planes: wp.array2d(dtype=wp.mat33),
    faces: wp.array2d(dtype=wp.int32),
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    b: int,
    triangle: int,
    pixel: wp.vec3,
    g: Pixel,
):
    """Adjoint of `value_at` = sum w_i a_i / sum w_i, w = W (u, v, 1): dL/dw, and the shares w_i / sum w."""
    w = planes[b, triangle] * pixel
    z = 1.0 / (w[0] + w[1] + w[2])
    slope = wp.vec3(
        wp.dot(g, corner_value(attributes, brightness, b, triangle, 0, faces[triangle, 0])),
        wp.dot(g, corner_value(attributes, brightness, b, triangle, 1, faces[triangle, 1])),
        wp.dot(g, corner_value(attributes, brightness, b, triangle, 2, faces[triangle, 2])),
    )
    mean = wp.dot(slope, w) * z
    return (slope - wp.vec3(mean, mean, mean)) * z, w * z


@wp.func
def add_to_triangle(
    b: int,
    triangle: int,
    plane: wp.mat33,
    first: Pixel,
    second: Pixel,
    third: Pixel,
    planes_grad: wp.array2d(dtype=wp.mat33),
    corner_grad: wp.array3d(dtype=Pixel),
):
    """Adds what a run of pixels has gathered."""
    if triangle >= 0:
        wp.atomic_add(planes_grad, b, triangle, plane)
        wp.atomic_add(corner_grad, b, triangle, 0, first)
        wp.atomic_add(corner_grad, b, triangle, 1, second)
        wp.atomic_add(corner_grad, b, triangle, 2, third)


@wp.kernel(enable_backward=False)
def shade(
    run: int,  # pixels of a row that one thread takes
    planes: wp.array2d(dtype=wp.mat33),  # (B, F)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    brightness: wp.array2d(dtype=wp.vec3),  # (B, F), per corner; (B, 0) when nothing is lit
    face_label: wp.array(dtype=wp.int32),  # (F,)
    background: Pixel,
    samples: int,
    keys: wp.array3d(dtype=wp.int64),  # (B, H s, W s)
    image: wp.array3d(dtype=Pixel),  # (B, H, W) out
    depth: wp.array3d(dtype=wp.float32),  # (B, H, W) out [m]
    label: wp.array3d(dtype=wp.int32),  # (B, H, W) out
):
    """Mean over the samples; where all of them see one triangle, its value at the pixel's centre.

    Neighbouring pixels mostly see one triangle, whose value is a fraction of two linear functions of the
    place: they are found once. Taken from the first corner's value, so that a constant stays constant.
    """
    b, y, part = wp.tid()
    inverse = 1.0 / float(samples)
    known = int(-2)
    base = Pixel()
    by_u = Pixel()
    by_v = Pixel()
    rest = Pixel()
    over = wp.vec3()
    for x in range(part * run, wp.min((part + 1) * run, image.shape[2])):
        first = keys[b, y * samples, x * samples]
        nearest = first
        mixed = int(0)
        for row in range(y * samples, (y + 1) * samples):
            for column in range(x * samples, (x + 1) * samples):
                key = keys[b, row, column]
                nearest = wp.max(nearest, key)
                if (key & ID_MASK) != (first & ID_MASK):
                    mixed = 1
        count = int(1)
        if mixed == 1:
            count = samples * samples
        value = Pixel()
        for k in range(count):
            u = float(x) + 0.5
            v = float(y) + 0.5
            triangle = triangle_of(first)
            if mixed == 1:
                row = y * samples + k / samples
                column = x * samples + k % samples
                u = (float(column) + 0.5) * inverse
                v = (float(row) + 0.5) * inverse
                triangle = triangle_of(keys[b, row, column])
            if triangle != known:
                known = triangle
                if triangle >= 0:
                    m = planes[b, triangle]
                    base = corner_value(attributes, brightness, b, triangle, 0, faces[triangle, 0])
                    one = corner_value(attributes, brightness, b, triangle, 1, faces[triangle, 1]) - base
                    two = corner_value(attributes, brightness, b, triangle, 2, faces[triangle, 2]) - base
                    by_u = one * m[1, 0] + two * m[2, 0]
                    by_v = one * m[1, 1] + two * m[2, 1]
                    rest = one * m[1, 2] + two * m[2, 2]
                    over = m[0] + m[1] + m[2]
            if triangle >= 0:
                z = 1.0 / (over[0] * u + over[1] * v + over[2])
                value += base + (by_u * u + by_v * v + rest) * z
            else:
                value += background
        if mixed == 1:
            value = value * (inverse * inverse)
        image[b, y, x] = value
        front = triangle_of(nearest)
        if front >= 0:
            depth[b, y, x] = DEPTH_SCALE / wp.float32(nearest >> ID_BITS)
            label[b, y, x] = face_label[front]
        else:
            depth[b, y, x] = wp.inf
            label[b, y, x] = 0


@wp.kernel(enable_backward=False)
def mark_weighted(
    run: int,  # pixels of a row that one thread takes
    image_grad: wp.array3d(dtype=Pixel),  # (B, H, W)
    weighted: wp.array3d(dtype=wp.uint8),  # (B, H, W) out, 1 where a pixel or one beside it has a gradient
):
    """Where an adjoint has anything to carry: most losses look at a part of the image only."""
    b, y, part = wp.tid()
    for x in range(part * run, wp.min((part + 1) * run, image_grad.shape[2])):
        size = float(0.0)
        for channel in range(wp.static(CHANNELS)):
            size += wp.abs(image_grad[b, y, x][channel])
        if size != 0.0:
            for row in range(wp.max(y - 1, 0), wp.min(y + 2, image_grad.shape[1])):
                for column in range(wp.max(x - 1, 0), wp.min(x + 2, image_grad.shape[2])):
                    weighted[b, row, column] = wp.uint8(1)


@wp.kernel(enable_backward=False)
def shade_adjoint(
    run: int,  # pixels of a row that one thread takes
    planes: wp.array2d(dtype=wp.mat33),  # (B, F)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    brightness: wp.array2d(dtype=wp.vec3),  # (B, F), per corner; (B, 0) when nothing is lit
    samples: int,
    keys: wp.array3d(dtype=wp.int64),  # (B, H s, W s)
    image_grad: wp.array3d(dtype=Pixel),  # (B, H, W)
    weighted: wp.array3d(dtype=wp.uint8),  # (B, H, W), 0 where no gradient is within a pixel
    planes_grad: wp.array2d(dtype=wp.mat33),  # (B, F) out, added
    corner_grad: wp.array3d(dtype=Pixel),  # (B, F, 3) out, added
):
    """Adjoint of `shade` with respect to W and to the values at the corners of each triangle.

    Neighbouring pixels mostly see one triangle: their sum is added once, for additions to one place wait
    for each other.
    """
    b, y, part = wp.tid()
    inverse = 1.0 / float(samples)
    seen = int(-1)
    plane = wp.mat33()
    one = Pixel()
    two = Pixel()
    three = Pixel()
    for x in range(part * run, wp.min((part + 1) * run, image_grad.shape[2])):
        if weighted[b, y, x] == wp.uint8(0):
            continue
        first = keys[b, y * samples, x * samples]
        mixed = int(0)
        for row in range(y * samples, (y + 1) * samples):
            for column in range(x * samples, (x + 1) * samples):
                if (keys[b, row, column] & ID_MASK) != (first & ID_MASK):
                    mixed = 1
        g = image_grad[b, y, x]
        count = int(1)
        if mixed == 1:
            g = g * (inverse * inverse)
            count = samples * samples
        for k in range(count):
            at = wp.vec3(float(x) + 0.5, float(y) + 0.5, 1.0)
            triangle = triangle_of(first)
            if mixed == 1:
                row = y * samples + k / samples
                column = x * samples + k % samples
                at = wp.vec3((float(column) + 0.5) * inverse, (float(row) + 0.5) * inverse, 1.0)
                triangle = triangle_of(keys[b, row, column])
            if triangle != seen:
                add_to_triangle(b, seen, plane, one, two, three, planes_grad, corner_grad)
                seen = triangle
                plane = wp.mat33()
                one = Pixel()
                two = Pixel()
                three = Pixel()
            if triangle >= 0:
                dw, share = slope_at(planes, faces, attributes, brightness, b, triangle, at, g)
                plane += wp.outer(dw, at)
                one += g * share[0]
                two += g * share[1]
                three += g * share[2]
    add_to_triangle(b, seen, plane, one, two, three, planes_grad, corner_grad)


@wp.kernel(enable_backward=False)
def triangles_adjoint(
    points: wp.array2d(dtype=wp.vec3),  # (B, V) camera coordinates [m]
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    brightness: wp.array2d(dtype=wp.vec3),  # (B, F), per corner; (B, 0) when nothing is lit
    lens: Pinhole,
    planes_grad: wp.array2d(dtype=wp.mat33),  # (B, F)
    corner_grad: wp.array3d(dtype=Pixel),  # (B, F, 3)
    points_grad: wp.array2d(dtype=wp.vec3),  # (B, V) out, added
    attributes_grad: wp.array2d(dtype=Pixel),  # (B, V) out, added
    brightness_grad: wp.array2d(dtype=wp.vec3),  # (B, F) out, starts at zero
):
    """From triangles to vertices: W is the inverse of (c0 c1 c2), so dL/dc = -W^T (dL/dW) W^T."""
    b, f = wp.tid()
    g = planes_grad[b, f]
    size = float(wp.ddot(g, g))
    for k in range(3):  # one corner's may cancel where the others' do not
        size += wp.dot(corner_grad[b, f, k], corner_grad[b, f, k])
    if size == 0.0:
        return
    lit_grad = wp.vec3()
    for k in range(3):
        corner = corner_grad[b, f, k]
        if brightness.shape[1] > 0:
            lit = brightness[b, f][k]
            a = attributes[b, faces[f, k]]
            lit_grad[k] = a[0] * corner[0] + a[1] * corner[1] + a[2] * corner[2]
            corner[0] = corner[0] * lit
            corner[1] = corner[1] * lit
            corner[2] = corner[2] * lit
        wp.atomic_add(attributes_grad, b, faces[f, k], corner)
    if brightness.shape[1] > 0:
        brightness_grad[b, f] = lit_grad
    c0 = points[b, faces[f, 0]]
    c1 = points[b, faces[f, 1]]
    c2 = points[b, faces[f, 2]]
    d0 = wp.vec3d(wp.float64(c0[0]), wp.float64(c0[1]), wp.float64(c0[2]))
    e1 = wp.vec3d(wp.float64(c1[0]), wp.float64(c1[1]), wp.float64(c1[2])) - d0
    e2 = wp.vec3d(wp.float64(c2[0]), wp.float64(c2[1]), wp.float64(c2[2])) - d0
    n = wp.cross(e1, e2)
    volume = wp.dot(d0, n)
    if volume == wp.float64(0.0):
        return
    r1 = wp.cross(e2, d0) / volume
    r2 = wp.cross(d0, e1) / volume
    r0 = n / volume - r1 - r2
    w = wp.matrix_from_rows(r0, r1, r2)
    ax = wp.float64(1.0) / wp.float64(lens.fx)
    ay = wp.float64(1.0) / wp.float64(lens.fy)
    ox = wp.float64(lens.cx) * ax
    oy = wp.float64(lens.cy) * ay
    h = wp.mat33d()
    for k in range(3):
        gu = wp.float64(g[k, 0])
        gv = wp.float64(g[k, 1])
        gw = wp.float64(g[k, 2])
        h[k, 0] = gu * ax - gw * ox
        h[k, 1] = gv * ay - gw * oy
        h[k, 2] = gw
    wt = wp.transpose(w)
    dm = -(wt * h * wt)
    for k in range(3):
        wp.atomic_add(
            points_grad,
            b,
            faces[f, k],
            wp.vec3(wp.float32(dm[0, k]), wp.float32(dm[1, k]), wp.float32(dm[2, k])),
        )
