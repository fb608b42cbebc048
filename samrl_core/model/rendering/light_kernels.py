"""Warp kernels of Lambert's law: brightness of every corner of every triangle, and its adjoint.

brightness = ambient + intensity max(0, n . l) with the unit normal n and the unit direction l towards
the light, both in world (Lambert 1760). A normal is the mean of the faces that share it, weighted by
area. It counts as turned to the viewer: the back of an open surface, or the inside of a body seen from
within, is lit as its front would be from there. Shadows are not cast.

Array shapes: B images, V vertices, F triangles, N shared normals.
"""
# ruff: noqa: UP018  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.model.rendering.kernel_types import LightRow, Pixel

# Products and sums are rounded one by one, or a GPU would see another triangle at an edge than a CPU.
wp.set_module_options({"fuse_fp": False})


@wp.func
def world_point(attributes: wp.array2d(dtype=Pixel), b: int, vertex: int):
    """Position of a vertex in world [m]."""
    a = attributes[b, vertex]
    return wp.vec3(a[3], a[4], a[5])


@wp.func
def turned(points: wp.array2d(dtype=wp.vec3), faces: wp.array2d(dtype=wp.int32), b: int, f: int):
    """-1 for a face whose winding shows its back to the camera, else 1."""
    c0 = points[b, faces[f, 0]]
    if wp.dot(c0, wp.cross(points[b, faces[f, 1]] - c0, points[b, faces[f, 2]] - c0)) > 0.0:
        return float(-1.0)
    return float(1.0)


@wp.kernel(enable_backward=False)
def face_areas(
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    areas: wp.array2d(dtype=wp.vec3),  # (B, F) out: normal, twice the area long [m2]
):
    """Area vectors of all faces, in world."""
    b, f = wp.tid()
    x0 = world_point(attributes, b, faces[f, 0])
    x1 = world_point(attributes, b, faces[f, 1])
    x2 = world_point(attributes, b, faces[f, 2])
    areas[b, f] = wp.cross(x1 - x0, x2 - x0)


@wp.kernel(enable_backward=False)
def average_normals(
    areas: wp.array2d(dtype=wp.vec3),  # (B, F)
    normal_start: wp.array(dtype=wp.int32),  # (N + 1,)
    normal_faces: wp.array(dtype=wp.int32),  # (3F,)
    normals: wp.array2d(dtype=wp.vec3),  # (B, N) out, not yet of unit length
):
    """Sums the areas of the faces that share a normal."""
    b, i = wp.tid()
    total = wp.vec3()
    for k in range(normal_start[i], normal_start[i + 1]):
        total += areas[b, normal_faces[k]]
    normals[b, i] = total


@wp.kernel(enable_backward=False)
def brighten(
    points: wp.array2d(dtype=wp.vec3),  # (B, V) camera coordinates [m]
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    corner_normal: wp.array2d(dtype=wp.int32),  # (F, 3)
    normals: wp.array2d(dtype=wp.vec3),  # (B, N)
    light: wp.array(dtype=LightRow),  # (B,) unit direction, intensity, ambient
    brightness: wp.array2d(dtype=wp.vec3),  # (B, F) out, per corner
):
    """Lambert's law at the corners; a face without area has the ambient light alone."""
    b, f = wp.tid()
    row = light[b]
    towards = wp.vec3(row[0], row[1], row[2]) * turned(points, faces, b, f)
    result = wp.vec3()
    for k in range(3):
        normal = wp.normalize(normals[b, corner_normal[f, k]])
        result[k] = row[4] + row[3] * wp.max(wp.dot(normal, towards), 0.0)
    brightness[b, f] = result


@wp.kernel(enable_backward=False)
def brighten_adjoint(
    points: wp.array2d(dtype=wp.vec3),  # (B, V) camera coordinates [m]
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    corner_normal: wp.array2d(dtype=wp.int32),  # (F, 3)
    normals: wp.array2d(dtype=wp.vec3),  # (B, N)
    light: wp.array(dtype=LightRow),  # (B,)
    brightness_grad: wp.array2d(dtype=wp.vec3),  # (B, F)
    normals_grad: wp.array2d(dtype=wp.vec3),  # (B, N) out, added
    light_grad: wp.array2d(dtype=LightRow),  # (B, F) out: each face's share
):
    """Adjoint of `brighten` with respect to the summed normals and the light."""
    b, f = wp.tid()
    row = light[b]
    side = turned(points, faces, b, f)
    towards = wp.vec3(row[0], row[1], row[2]) * side
    share = LightRow()
    for k in range(3):
        g = brightness_grad[b, f][k]
        if g == 0.0:
            continue
        share[4] = share[4] + g
        total = normals[b, corner_normal[f, k]]
        size = wp.length(total)
        if size == 0.0:
            continue
        normal = total / size
        cosine = wp.dot(normal, towards)
        if cosine > 0.0:
            share[3] = share[3] + g * cosine
            slope = g * row[3]
            for c in range(3):
                share[c] = share[c] + slope * side * normal[c]
            wp.atomic_add(normals_grad, b, corner_normal[f, k], (towards - normal * cosine) * (slope / size))
    light_grad[b, f] = share


@wp.kernel(enable_backward=False)
def face_areas_adjoint(
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    corner_normal: wp.array2d(dtype=wp.int32),  # (F, 3)
    normals_grad: wp.array2d(dtype=wp.vec3),  # (B, N)
    attributes_grad: wp.array2d(dtype=Pixel),  # (B, V) out, added
):
    """Adjoint of `average_normals` after `face_areas`: a face stands once per corner in its normals."""
    b, f = wp.tid()
    g = normals_grad[b, corner_normal[f, 0]]
    g += normals_grad[b, corner_normal[f, 1]]
    g += normals_grad[b, corner_normal[f, 2]]
    if g[0] == 0.0 and g[1] == 0.0 and g[2] == 0.0:
        return
    x0 = world_point(attributes, b, faces[f, 0])
    d1 = wp.cross(world_point(attributes, b, faces[f, 2]) - x0, g)
    d2 = wp.cross(g, world_point(attributes, b, faces[f, 1]) - x0)
    d0 = -(d1 + d2)
    wp.atomic_add(attributes_grad, b, faces[f, 0], Pixel(0.0, 0.0, 0.0, d0[0], d0[1], d0[2], 0.0))
    wp.atomic_add(attributes_grad, b, faces[f, 1], Pixel(0.0, 0.0, 0.0, d1[0], d1[1], d1[2], 0.0))
    wp.atomic_add(attributes_grad, b, faces[f, 2], Pixel(0.0, 0.0, 0.0, d2[0], d2[1], d2[2], 0.0))
