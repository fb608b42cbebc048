"""Warp kernel of the edge integral: what the image gains when an edge moves across it.

Rasterising is piecewise constant in the positions of edges, so the derivative of a pixel's mean has a
second part: along every visible edge, (value on one side - value on the other side) times the speed
of the edge normal to itself (Li et al. 2018, eq. 7). The integral is taken by steps along the edge that
end at the borders of pixels, not by random samples: no noise, and equal inputs give equal gradients.

Two kinds of edges carry a jump: a silhouette (both faces on one screen side, or one face only), whose
other side is read from the z-buffer, and a crease, whose two faces have different colours.
"""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.model.rendering.kernel_types import EdgeUse, Pixel
from samrl_core.model.rendering.raster_kernels import Pinhole, corner_value, triangle_of, value_at
from samrl_core.model.rendering.sight_kernels import HIDE, inverse_depth, is_hidden

# Products and sums are rounded one by one, or a GPU would see another triangle at an edge than a CPU.
wp.set_module_options({"fuse_fp": False})

# Distance from the edge to the sample beyond it, in samples: more than half a diagonal (0.707), so
# that the sample's centre is certainly outside.
BEYOND = wp.constant(wp.float32(0.75))

NEARER = wp.constant(wp.float32(1.00001))  # less is rounding: coincident faces


@wp.func
def clip_interval(t: wp.vec2, start: float, delta: float, lo: float, hi: float):
    """Part of t where lo <= start + t delta <= hi (Liang and Barsky 1984)."""
    a = t[0]
    b = t[1]
    if wp.abs(delta) < 1.0e-9:
        if start < lo or start > hi:
            b = a - 1.0
    else:
        p = (lo - start) / delta
        q = (hi - start) / delta
        a = wp.max(a, wp.min(p, q))
        b = wp.min(b, wp.max(p, q))
    return wp.vec2(a, b)


@wp.func
def way_to_border(u: float, du: float):
    """Distance to the next pixel border in the direction of du, more than 0 [px]."""
    if du > 0.0:
        return wp.floor(u) + 1.0 - u
    return u - wp.ceil(u) + 1.0


@wp.func
def claim(
    claims: wp.array3d(dtype=wp.uint8),
    b: int,
    u: float,
    v: float,
    nu: float,
    nv: float,
    piece: float,
    s: float,
):
    """Marks the samples next to a piece of an edge, so that its jump is not counted as an intersection."""
    along = int(wp.ceil(piece * s))
    for k in range(4 * along):
        away = (0.5 * float(k % 4) - 0.75) / s
        forth = ((float(k / 4) + 0.5) / float(along) - 0.5) * piece
        x = int(wp.floor((u + nu * away + nv * forth) * s))
        y = int(wp.floor((v + nv * away - nu * forth) * s))
        if x >= 0 and y >= 0 and x < claims.shape[2] and y < claims.shape[1]:
            claims[b, y, x] = wp.uint8(1)


@wp.func
def value_at_end(
    faces: wp.array2d(dtype=wp.int32),
    attributes: wp.array2d(dtype=Pixel),
    brightness: wp.array2d(dtype=wp.vec3),
    b: int,
    face: int,
    vertex: int,
):
    """Value of a face at the corner that is this vertex."""
    k = int(0)
    if faces[face, 1] == vertex:
        k = 1
    elif faces[face, 2] == vertex:
        k = 2
    return corner_value(attributes, brightness, b, face, k, vertex)


@wp.kernel(enable_backward=False)
def integrate_edges(
    points: wp.array2d(dtype=wp.vec3),  # (B, V) camera coordinates [m]
    planes: wp.array2d(dtype=wp.mat33),  # (B, F)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    face_part: wp.array(dtype=wp.int32),  # (F,)
    neighbors: wp.array2d(dtype=wp.int32),  # (F, 3)
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    brightness: wp.array2d(dtype=wp.vec3),  # (B, F), per corner; (B, 0) when nothing is lit
    edge_start: wp.array(dtype=wp.int32),  # (E + 1,) into edge_uses
    edge_uses: wp.array(dtype=EdgeUse),  # (U,) two ends, opposite vertex, face
    background: Pixel,
    lens: Pinhole,
    samples: int,
    step: float,  # [px] longest step along an edge
    keys: wp.array3d(dtype=wp.int64),  # (B, H s, W s)
    image_grad: wp.array3d(dtype=Pixel),  # (B, H, W)
    weighted: wp.array3d(dtype=wp.uint8),  # (B, H, W), 0 where no gradient is within a pixel
    points_grad: wp.array2d(dtype=wp.vec3),  # (B, V) out, added
    claims: wp.array3d(dtype=wp.uint8),  # (B, H s, W s) out, 1 where an edge lies on another part
):
    """Adds dL/dpoints of all jumps along visible edges."""
    b, e = wp.tid()
    first = edge_start[e]
    last = edge_start[e + 1]
    use = edge_uses[first]
    c0 = points[b, use[0]]
    c1 = points[b, use[1]]
    if c0[2] < lens.near and c1[2] < lens.near:
        return
    # Plane through the eye and the edge: its trace is the edge's image, its sign the side of a face.
    n = wp.cross(c0, c1 - c0)
    left = int(-1)  # first use on the positive side, then the nearest there
    right = int(-1)
    crowded = int(0)
    for k in range(first, last):
        if wp.dot(n, points[b, edge_uses[k][2]] - c0) > 0.0:
            if left >= 0:
                crowded = 1
            else:
                left = k
        else:
            if right >= 0:
                crowded = 1
            else:
                right = k
    crease = int(0)
    if left >= 0 and right >= 0:
        crease = 1
        if crowded == 0:
            p_use = edge_uses[left]
            q_use = edge_uses[right]
            jump0 = value_at_end(faces, attributes, brightness, b, p_use[3], p_use[0]) - value_at_end(
                faces, attributes, brightness, b, q_use[3], q_use[0]
            )
            jump1 = value_at_end(faces, attributes, brightness, b, p_use[3], p_use[1]) - value_at_end(
                faces, attributes, brightness, b, q_use[3], q_use[1]
            )
            if wp.dot(jump0, jump0) + wp.dot(jump1, jump1) == 0.0:
                return
    # Part of the edge in front of the near plane, as a fraction of its length in space.
    lo = float(0.0)
    hi = float(1.0)
    if c0[2] < lens.near:
        lo = (lens.near - c0[2]) / (c1[2] - c0[2])
    if c1[2] < lens.near:
        hi = (lens.near - c0[2]) / (c1[2] - c0[2])
    p = c0 + (c1 - c0) * lo
    q = c0 + (c1 - c0) * hi
    pz = wp.max(p[2], 0.999 * lens.near)
    qz = wp.max(q[2], 0.999 * lens.near)
    u0 = lens.fx * p[0] / pz + lens.cx
    v0 = lens.fy * p[1] / pz + lens.cy
    du = lens.fx * q[0] / qz + lens.cx - u0
    dv = lens.fy * q[1] / qz + lens.cy - v0
    length = wp.sqrt(du * du + dv * dv)
    if length < 1.0e-6:
        return
    height = image_grad.shape[1]
    width = image_grad.shape[2]
    t = clip_interval(wp.vec2(0.0, 1.0), u0, du, 0.0, float(width))
    t = clip_interval(t, v0, dv, 0.0, float(height))
    if t[1] <= t[0]:
        return
    # Normal on the screen, pointing to the negative side: the line's gradient is (n_x / fx, n_y / fy).
    nu = dv / length
    nv = -du / length
    if n[0] / lens.fx * nu + n[1] / lens.fy * nv > 0.0:
        nu = -nu
        nv = -nv
    if crowded == 1:  # of several faces on one side the nearest is seen; of equals the first, as drawn
        mu = u0 + 0.5 * (t[0] + t[1]) * du
        mv = v0 + 0.5 * (t[0] + t[1]) * dv
        for k in range(first, last):
            face = edge_uses[k][3]
            if wp.dot(n, points[b, edge_uses[k][2]] - c0) > 0.0:
                au = mu - 0.1 * nu
                av = mv - 0.1 * nv
                best = edge_uses[left][3]
                if inverse_depth(planes[b, face], au, av) > inverse_depth(planes[b, best], au, av) * NEARER:
                    left = k
            else:
                au = mu + 0.1 * nu
                av = mv + 0.1 * nv
                best = edge_uses[right][3]
                if inverse_depth(planes[b, face], au, av) > inverse_depth(planes[b, best], au, av) * NEARER:
                    right = k
    if left < 0:  # inside is always the side that has a face
        left = right
        right = -1
        nu = -nu
        nv = -nv
    use = edge_uses[left]
    i0 = use[0]
    i1 = use[1]
    face = use[3]
    a0 = value_at_end(faces, attributes, brightness, b, face, i0)
    a1 = value_at_end(faces, attributes, brightness, b, face, i1)
    b0 = a0
    b1 = a1
    other = face
    beyond = int(-1)
    if crease == 1:
        q_use = edge_uses[right]
        other = q_use[3]
        beyond = other
        b0 = value_at_end(faces, attributes, brightness, b, q_use[3], q_use[0])
        b1 = value_at_end(faces, attributes, brightness, b, q_use[3], q_use[1])
    s = float(samples)
    # Cut where the image gradient jumps: at the borders of pixels. Next border to come, and their spacing.
    every_u = 1.0 / wp.max(wp.abs(du), 1.0e-9)
    every_v = 1.0 / wp.max(wp.abs(dv), 1.0e-9)
    border_u = t[0] + every_u * way_to_border(u0 + t[0] * du, du)
    border_v = t[0] + every_v * way_to_border(v0 + t[0] * dv, dv)
    longest = step / length
    end = float(t[0])
    g0 = wp.vec3()
    g1 = wp.vec3()
    while end < t[1]:
        start = end
        end = wp.min(wp.min(border_u, border_v), wp.min(start + longest, t[1]))
        if border_u <= end:
            border_u += every_u
        if border_v <= end:
            border_v += every_v
        dt = end - start
        if dt <= 0.0:
            end = start
            continue
        tk = start + 0.5 * dt
        u = u0 + tk * du
        v = v0 + tk * dv
        ix = wp.clamp(int(wp.floor(u)), 0, width - 1)
        iy = wp.clamp(int(wp.floor(v)), 0, height - 1)
        if weighted[b, iy, ix] == wp.uint8(0):  # claims reach no further than the pixel beside
            continue
        inside_iz = (1.0 - tk) / pz + tk / qz
        depth = 1.0 / inside_iz
        tau = lo + (hi - lo) * (tk / qz) * depth  # fraction along the edge in space
        inside = a0 * (1.0 - tau) + a1 * tau
        sx = wp.clamp(int(wp.floor((u + nu * BEYOND / s) * s)), 0, keys.shape[2] - 1)
        sy = wp.clamp(int(wp.floor((v + nv * BEYOND / s) * s)), 0, keys.shape[1] - 1)
        if is_hidden(planes, neighbors, face_part, keys, b, sx, sy, u, v, s, inside_iz, face, beyond):
            continue
        # The other side too: of two outlines less than a sample apart only the outer one has free sight.
        rx = wp.clamp(int(wp.floor((u - nu * BEYOND / s) * s)), 0, keys.shape[2] - 1)
        ry = wp.clamp(int(wp.floor((v - nv * BEYOND / s) * s)), 0, keys.shape[1] - 1)
        if is_hidden(planes, neighbors, face_part, keys, b, rx, ry, u, v, s, inside_iz, face, other):
            continue
        outside = background
        if crease == 1:
            outside = b0 * (1.0 - tau) + b1 * tau
        else:
            triangle = triangle_of(keys[b, sy, sx])
            if triangle >= 0:
                m = planes[b, triangle]
                cu = (float(sx) + 0.5) / s
                cv = (float(sy) + 0.5) / s
                iz_edge = inverse_depth(m, u, v)
                if wp.abs(iz_edge - inside_iz) < inside_iz * HIDE and face_part[triangle] != face_part[face]:
                    claim(claims, b, u, v, nu, nv, dt * length, s)
                # Extrapolated to the edge, unless the plane is seen at too grazing an angle for that.
                if iz_edge <= inside_iz * (1.0 + HIDE) and iz_edge >= 0.5 * inverse_depth(m, cu, cv):
                    cu = u
                    cv = v
                outside = value_at(planes, faces, attributes, brightness, background, b, triangle, cu, cv)
        gain = wp.dot(inside - outside, image_grad[b, iy, ix]) * length * dt
        # Normal speed of the edge's image when a point c of it moves by dc: n . J dc, J the projection's.
        cx = u - lens.cx
        cy = v - lens.cy
        motion = wp.vec3(nu * lens.fx, nv * lens.fy, -(nu * cx + nv * cy)) * (inside_iz * gain)
        g0 += motion * (1.0 - tau)
        g1 += motion * tau
    wp.atomic_add(points_grad, b, i0, g0)
    wp.atomic_add(points_grad, b, i1, g1)
