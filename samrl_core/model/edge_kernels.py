"""Warp kernel of the edge integral: what the image gains when an edge moves across it.

Rasterising is piecewise constant in the positions of edges, so the derivative of a pixel's mean has a
second part: along every visible edge, (value on one side - value on the other side) times the speed
of the edge normal to itself (Li et al. 2018, eq. 7). The integral is taken by fixed steps along the
edge, not by random samples: no noise, and equal inputs give equal gradients.

Two kinds of edges carry a jump: a silhouette (both faces on one screen side, or one face only), whose
other side is read from the z-buffer, and a crease, whose two faces have different colours.
"""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)
# pyright: basic, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportOperatorIssue=false, reportAttributeAccessIssue=false, reportInvalidTypeForm=false
# pyright: reportGeneralTypeIssues=false, reportAssignmentType=false, reportRedeclaration=false, reportOptionalOperand=false

from __future__ import annotations

import warp as wp

from samrl_core.model.kernel_types import EdgeRow, Pixel
from samrl_core.model.raster_kernels import Lens, interpolate, triangle_of

# Relative depth by which something must lie in front to hide an edge; 0.5 mm at 0.5 m. Less would
# drop edges that touch what they stand on, from rounding.
HIDE = wp.constant(wp.float32(1.0e-3))
# Distance from the edge to the sample beyond it, in samples: more than half a diagonal (0.707), so
# that the sample's centre is certainly outside.
BEYOND = wp.constant(wp.float32(0.75))


@wp.func
def inverse_depth(m: wp.mat33, u: float, v: float):
    """1/z of a triangle's plane at a pixel."""
    w = m * wp.vec3(u, v, 1.0)
    return w[0] + w[1] + w[2]


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


@wp.kernel(enable_backward=False)
def integrate_edges(
    points: wp.array2d(dtype=wp.vec3),  # (B, V) camera coordinates [m]
    planes: wp.array2d(dtype=wp.mat33),  # (B, F)
    faces: wp.array2d(dtype=wp.int32),  # (F, 3)
    attributes: wp.array2d(dtype=Pixel),  # (B, V)
    edges: wp.array(dtype=EdgeRow),  # (E,) face a: two ends, opposite vertex, face; the same of face b or -1
    background: Pixel,
    lens: Lens,
    samples: int,
    step: float,  # [px] longest step along an edge
    keys: wp.array3d(dtype=wp.int64),  # (B, H s, W s)
    image_grad: wp.array3d(dtype=Pixel),  # (B, H, W)
    points_grad: wp.array2d(dtype=wp.vec3),  # (B, V) out, added
):
    """Adds dL/dpoints of all jumps along visible edges."""
    b, e = wp.tid()
    row = edges[e]
    face = row[3]
    i0 = row[0]
    i1 = row[1]
    j0 = row[4]
    j1 = row[5]
    c0 = points[b, i0]
    c1 = points[b, i1]
    if c0[2] < lens.near and c1[2] < lens.near:
        return
    # Plane through the eye and the edge: its trace is the edge's image, its sign the side.
    n = wp.cross(c0, c1 - c0)
    side_a = wp.dot(n, points[b, row[2]] - c0)
    crease = int(0)
    swap = int(0)
    if row[7] >= 0:
        side_b = wp.dot(n, points[b, row[6]] - c0)
        if side_a * side_b <= 0.0:
            crease = 1
            jump0 = attributes[b, i0] - attributes[b, j0]
            jump1 = attributes[b, i1] - attributes[b, j1]
            if wp.dot(jump0, jump0) + wp.dot(jump1, jump1) == 0.0:
                return
        else:
            swap = 1  # decided below: of the two faces on one side, the nearer one is seen
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
    nu = dv / length
    nv = -du / length
    # Outwards: away from face a. The line's gradient on the screen is (n_x / fx, n_y / fy).
    if (n[0] / lens.fx * nu + n[1] / lens.fy * nv) * side_a > 0.0:
        nu = -nu
        nv = -nv
    if swap == 1:
        mu = u0 + 0.5 * (t[0] + t[1]) * du - 0.1 * nu
        mv = v0 + 0.5 * (t[0] + t[1]) * dv - 0.1 * nv
        if inverse_depth(planes[b, row[7]], mu, mv) > inverse_depth(planes[b, face], mu, mv):
            face = row[7]
            i0 = row[4]
            i1 = row[5]
    a0 = attributes[b, i0]
    a1 = attributes[b, i1]
    s = float(samples)
    steps = int(wp.ceil((t[1] - t[0]) * length / step))
    dt = (t[1] - t[0]) / float(steps)
    g0 = wp.vec3()
    g1 = wp.vec3()
    for k in range(steps):
        tk = t[0] + (float(k) + 0.5) * dt
        u = u0 + tk * du
        v = v0 + tk * dv
        ix = wp.clamp(int(wp.floor(u)), 0, width - 1)
        iy = wp.clamp(int(wp.floor(v)), 0, height - 1)
        inside_iz = (1.0 - tk) / pz + tk / qz
        depth = 1.0 / inside_iz
        tau = lo + (hi - lo) * (tk / qz) * depth  # fraction along the edge in space
        inside = a0 * (1.0 - tau) + a1 * tau
        sx = wp.clamp(int(wp.floor((u + nu * BEYOND / s) * s)), 0, keys.shape[2] - 1)
        sy = wp.clamp(int(wp.floor((v + nv * BEYOND / s) * s)), 0, keys.shape[1] - 1)
        triangle = triangle_of(keys[b, sy, sx])
        outside = background
        if triangle >= 0:
            m = planes[b, triangle]
            cu = (float(sx) + 0.5) / s
            cv = (float(sy) + 0.5) / s
            iz_sample = inverse_depth(m, cu, cv)
            iz_edge = inverse_depth(m, u, v)
            # Hidden only if in front both at the sample and at the edge: a table under an edge that
            # stands on it is nearer at the sample, a plane seen at a grazing angle nearer at the edge.
            if wp.min(iz_sample, iz_edge) > inside_iz * (1.0 + HIDE):
                continue
            if iz_edge > inside_iz * (1.0 + HIDE) or iz_edge < 0.5 * iz_sample:
                u_read = cu
                v_read = cv
            else:
                u_read = u
                v_read = v
            outside = interpolate(
                m * wp.vec3(u_read, v_read, 1.0),
                attributes[b, faces[triangle, 0]],
                attributes[b, faces[triangle, 1]],
                attributes[b, faces[triangle, 2]],
            )
        if crease == 1:
            outside = attributes[b, j0] * (1.0 - tau) + attributes[b, j1] * tau
        gain = wp.dot(inside - outside, image_grad[b, iy, ix]) * length * dt
        # Normal speed of the edge's image when a point c of it moves by dc: n . J dc, J the projection's.
        cx = u - lens.cx
        cy = v - lens.cy
        motion = wp.vec3(nu * lens.fx, nv * lens.fy, -(nu * cx + nv * cy)) * (inside_iz * gain)
        g0 += motion * (1.0 - tau)
        g1 += motion * tau
    wp.atomic_add(points_grad, b, i0, g0)
    wp.atomic_add(points_grad, b, i1, g1)
