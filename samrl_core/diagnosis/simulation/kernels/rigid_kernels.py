"""Rigid-body dynamics of a tree of joints in world axes: bias, mass matrix, its solution, virtual power.

Composite-rigid-body algorithm and recursive Newton-Euler after R. Featherstone, Rigid Body Dynamics
Algorithms (2008), chapters 5 and 6, with every spatial vector taken about the world's origin.
"""

from __future__ import annotations

import warp as wp

from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, Bodies, H, Mat3, S, Vec3, f64

ZERO = wp.constant(f64(0.0))
ONE = wp.constant(f64(1.0))
Q = wp.constant(int(S.Q))
V = wp.constant(int(S.V))
TAU = wp.constant(int(H.TAU))
ADDED = wp.constant(int(H.ADDED))
OUTSIDE = wp.constant(int(H.OUTSIDE))


@wp.func
def skew(a: Vec3):
    """Matrix of the cross product with a."""
    return Mat3(ZERO, -a[2], a[1], a[2], ZERO, -a[0], -a[1], a[0], ZERO)


@wp.func
def joint_rotation(axis: Vec3, angle: f64):
    """Rodrigues' formula."""
    s = wp.sin(angle)
    c = ONE - wp.cos(angle)
    x = axis[0]
    y = axis[1]
    z = axis[2]
    return Mat3(
        ONE - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y,
        c * x * y + s * z, ONE - c * (x * x + z * z), c * y * z - s * x,
        c * x * z - s * y, c * y * z + s * x, ONE - c * (x * x + y * y),
    )  # fmt: skip


@wp.func
def moment_of(parameters: wp.array3d(dtype=f64), b: int, j: int):
    """First moment m c of a link in its own frame."""
    return Vec3(parameters[b, j, 1], parameters[b, j, 2], parameters[b, j, 3])


@wp.func
def inertia_of(parameters: wp.array3d(dtype=f64), b: int, j: int):
    """Pinocchio's order: Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joint's origin."""
    xy = parameters[b, j, 5]
    xz = parameters[b, j, 7]
    yz = parameters[b, j, 8]
    return Mat3(parameters[b, j, 4], xy, xz, xy, parameters[b, j, 6], yz, xz, yz, parameters[b, j, 9])


@wp.func
def gravity_torque(a: Arrays, b: int):
    """Nominal gravity torque at the measured position into `held`; the controller knows no mount."""
    g = a.nominal_gravity
    for j in range(a.mount, a.joints):
        k = a.parent[j]
        q = a.measured_q[b, j]
        rotation = a.rotation[j]
        origin = a.origin[j]
        if k >= a.mount:
            origin = a.g_origin[b, k] + a.g_rotation[b, k] * origin
            rotation = a.g_rotation[b, k] * rotation
        if a.prismatic[j] == 1:
            origin = origin + rotation * a.axis[j] * q
        else:
            rotation = rotation * joint_rotation(a.axis[j], q)
        a.g_rotation[b, j] = rotation
        a.g_origin[b, j] = origin
        m = a.nominal_inertia[j, 0]
        c = Vec3(a.nominal_inertia[j, 1], a.nominal_inertia[j, 2], a.nominal_inertia[j, 3])
        a.g_mass[b, j] = m
        a.g_moment[b, j] = origin * m + rotation * c
    for back in range(a.mount, a.joints):
        j = a.joints - 1 + a.mount - back
        k = a.parent[j]
        m = a.g_mass[b, j]
        h = a.g_moment[b, j]
        axis = a.g_rotation[b, j] * a.axis[j]
        if a.prismatic[j] == 1:
            a.held[b, j] = -m * wp.dot(axis, g)
        else:
            a.held[b, j] = -wp.dot(axis, wp.cross(h - a.g_origin[b, j] * m, g))
        if k >= a.mount:
            a.g_mass[b, k] += m
            a.g_moment[b, k] += h


@wp.func
def bias_and_matrix(a: Arrays, s: Bodies, b: int, slot: int):
    """Outward and inward pass: `acceleration` gets minus the bias torque, `matrix` the mass matrix."""
    n = a.joints
    for j in range(n):
        k = a.parent[j]
        q = a.state[slot, b, j, Q]
        dq = a.state[slot, b, j, V]
        rotation = a.rotation[j]
        origin = a.origin[j]
        w = Vec3()
        v = Vec3()
        aw = Vec3()
        av = -a.gravity[b]
        if k >= 0:
            origin = s.origin[b, k] + s.rotation[b, k] * origin
            rotation = s.rotation[b, k] * rotation
            w = s.w[b, k]
            v = s.v[b, k]
            aw = s.aw[b, k]
            av = s.av[b, k]
        axis = rotation * a.axis[j]
        sw = axis
        if a.prismatic[j] == 1:
            origin = origin + axis * q
            sw = Vec3()
            sv = axis
        else:
            rotation = rotation * joint_rotation(a.axis[j], q)
            sv = wp.cross(origin, axis)
        aw = aw + wp.cross(w, sw) * dq
        av = av + (wp.cross(w, sv) + wp.cross(v, sw)) * dq
        w = w + sw * dq
        v = v + sv * dq
        s.rotation[b, j] = rotation
        s.origin[b, j] = origin
        s.w[b, j] = w
        s.v[b, j] = v
        s.aw[b, j] = aw
        s.av[b, j] = av
        s.sw[b, j] = sw
        s.sv[b, j] = sv
        m = a.inertia[b, j, 0]
        c = rotation * moment_of(a.inertia, b, j)
        h = c + origin * m
        # about the world's origin: R I R' - m [p][p] - [p][c] - [c][p]
        po = wp.outer(origin, h) + wp.outer(c, origin)
        inertia = rotation * inertia_of(a.inertia, b, j) * wp.transpose(rotation) - po
        trace = wp.dot(origin, h) + wp.dot(c, origin)
        inertia = inertia + Mat3(trace, ZERO, ZERO, ZERO, trace, ZERO, ZERO, ZERO, trace)
        s.mass[b, j] = m
        s.moment[b, j] = h
        s.inertia[b, j] = inertia
        angular = inertia * w + wp.cross(h, v)
        linear = v * m - wp.cross(h, w)
        s.fw[b, j] = inertia * aw + wp.cross(h, av) + wp.cross(w, angular) + wp.cross(v, linear)
        s.fv[b, j] = av * m - wp.cross(h, aw) + wp.cross(w, linear)
    for back in range(n):
        j = n - 1 - back
        k = a.parent[j]
        sw = s.sw[b, j]
        sv = s.sv[b, j]
        fw = s.fw[b, j]
        fv = s.fv[b, j]
        m = s.mass[b, j]
        h = s.moment[b, j]
        inertia = s.inertia[b, j]
        a.acceleration[b, j] = -(wp.dot(sw, fw) + wp.dot(sv, fv))
        if k >= 0:
            s.fw[b, k] = s.fw[b, k] + fw
            s.fv[b, k] = s.fv[b, k] + fv
            s.mass[b, k] = s.mass[b, k] + m
            s.moment[b, k] = s.moment[b, k] + h
            s.inertia[b, k] = s.inertia[b, k] + inertia
        angular = inertia * sw + wp.cross(h, sv)
        linear = sv * m - wp.cross(h, sw)
        for i in range(j):
            s.matrix[b, j, i] = ZERO
        i = j
        while i >= 0:
            s.matrix[b, j, i] = wp.dot(s.sw[b, i], angular) + wp.dot(s.sv[b, i], linear)
            i = a.parent[i]


@wp.func
def factorise(a: Arrays, s: Bodies, b: int):
    """Cholesky factor of the mass matrix with what the drives add; the diagonal keeps its inverse."""
    for j in range(a.joints):
        for k in range(j):
            t = s.matrix[b, j, k]
            for i in range(k):
                t -= s.matrix[b, j, i] * s.matrix[b, k, i]
            s.matrix[b, j, k] = t * s.matrix[b, k, k]
        t = s.matrix[b, j, j] + a.hand[b, j, ADDED]
        for i in range(j):
            t -= s.matrix[b, j, i] * s.matrix[b, j, i]
        s.matrix[b, j, j] = ONE / wp.sqrt(t)


@wp.func
def back_substitute(s: Bodies, n: int, b: int, x: wp.array2d(dtype=f64)):
    """Solve in place with the factor of `factorise`."""
    for j in range(n):
        t = x[b, j]
        for i in range(j):
            t -= s.matrix[b, j, i] * x[b, i]
        x[b, j] = t * s.matrix[b, j, j]
    for back in range(n):
        j = n - 1 - back
        t = x[b, j]
        for i in range(j + 1, n):
            t -= s.matrix[b, i, j] * x[b, i]
        x[b, j] = t * s.matrix[b, j, j]


@wp.func
def solve(a: Arrays, s: Bodies, b: int, slot: int):
    """Acceleration of the links: (M + added) acceleration = torque - bias."""
    bias_and_matrix(a, s, b, slot)
    factorise(a, s, b)
    for j in range(a.joints):
        a.acceleration[b, j] = a.acceleration[b, j] + a.hand[b, j, TAU] + a.hand[b, j, OUTSIDE]
    back_substitute(s, a.joints, b, a.acceleration)


@wp.struct
class RigidMotion:
    """One outward pass for the virtual power; slot 0 of every array is the fixed base."""

    rotation: wp.array2d(dtype=Mat3)
    origin: wp.array2d(dtype=Vec3)
    w: wp.array2d(dtype=Vec3)
    v: wp.array2d(dtype=Vec3)
    aw: wp.array2d(dtype=Vec3)
    av: wp.array2d(dtype=Vec3)
    yw: wp.array2d(dtype=Vec3)
    yv: wp.array2d(dtype=Vec3)
    acceleration: wp.array2d(dtype=f64)
    direction: wp.array2d(dtype=f64)
    power: wp.array(dtype=f64)


@wp.func
def virtual_power(a: Arrays, m: RigidMotion, b: int, slot: int):
    """Minus the power of the inverse dynamics under virtual velocities: written once, so differentiable."""
    m.av[b, 0] = -a.gravity[b]
    for j in range(a.joints):
        k = a.parent[j] + 1
        q = a.state[slot, b, j, Q]
        dq = a.state[slot, b, j, V]
        ddq = m.acceleration[b, j]
        y = m.direction[b, j]
        frame = m.rotation[b, k] * a.rotation[j]
        origin = m.origin[b, k] + m.rotation[b, k] * a.origin[j]
        axis = frame * a.axis[j]
        turn = f64(1 - a.prismatic[j])
        slide = f64(a.prismatic[j])
        place = origin + axis * (slide * q)
        rotation = frame * joint_rotation(a.axis[j], turn * q)
        sw = axis * turn
        sv = wp.cross(place, axis) * turn + axis * slide
        w0 = m.w[b, k]
        v0 = m.v[b, k]
        w = w0 + sw * dq
        v = v0 + sv * dq
        aw = m.aw[b, k] + sw * ddq + wp.cross(w0, sw) * dq
        av = m.av[b, k] + sv * ddq + (wp.cross(w0, sv) + wp.cross(v0, sw)) * dq
        yw = m.yw[b, k] + sw * y
        yv = m.yv[b, k] + sv * y
        m.rotation[b, j + 1] = rotation
        m.origin[b, j + 1] = place
        m.w[b, j + 1] = w
        m.v[b, j + 1] = v
        m.aw[b, j + 1] = aw
        m.av[b, j + 1] = av
        m.yw[b, j + 1] = yw
        m.yv[b, j + 1] = yv
        back = wp.transpose(rotation)
        wb = back * w
        vb = back * (v + wp.cross(w, place))
        awb = back * aw
        avb = back * (av + wp.cross(aw, place))
        ywb = back * yw
        yvb = back * (yv + wp.cross(yw, place))
        mass = a.inertia[b, j, 0]
        h = moment_of(a.inertia, b, j)
        inertia = inertia_of(a.inertia, b, j)
        angular = inertia * wb + wp.cross(h, vb)
        linear = vb * mass - wp.cross(h, wb)
        fw = inertia * awb + wp.cross(h, avb) + wp.cross(wb, angular) + wp.cross(vb, linear)
        fv = avb * mass - wp.cross(h, awb) + wp.cross(wb, linear)
        wp.atomic_add(m.power, b, -(wp.dot(ywb, fw) + wp.dot(yvb, fv)))
