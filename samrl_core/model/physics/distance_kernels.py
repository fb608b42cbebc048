"""Signed distance and outward normal of each solid, and the impulse of one contact point."""
# ruff: noqa: UP018, RUF046  (Warp: only int(...) may change in a loop, a bare literal may not)

from functools import cache
from types import SimpleNamespace

import warp as wp

from samrl_core.model.physics.kernel_types import types
from samrl_core.model.physics.shapes import PROFILE_CORNERS, ShapeKind

BOX = wp.constant(int(ShapeKind.BOX))
CAPSULE = wp.constant(int(ShapeKind.CAPSULE))
REVOLVED = wp.constant(int(ShapeKind.REVOLVED))
CORNERS = wp.constant(PROFILE_CORNERS)


@cache
def distance_functions(double: bool) -> SimpleNamespace:
    """Functions of one precision: `distance`, `ramp`, `ramp_slope`, `impulse`."""
    t = types(double)
    real, vec3 = t.real, t.vec3
    tiny = real(1.0e-30)

    @wp.func
    def box_distance(p: vec3, half: vec3):
        """Normal, and distance to the sharp core."""
        a = vec3(wp.abs(p[0]) - half[0], wp.abs(p[1]) - half[1], wp.abs(p[2]) - half[2])
        s = vec3(wp.sign(p[0]), wp.sign(p[1]), wp.sign(p[2]))
        n = vec3()
        d = real(0.0)
        if wp.max(a) > real(0.0):
            o = vec3(wp.max(a[0], real(0.0)), wp.max(a[1], real(0.0)), wp.max(a[2], real(0.0)))
            d = wp.sqrt(wp.dot(o, o))
            n = wp.cw_mul(s, o) / d
        elif a[0] >= a[1] and a[0] >= a[2]:
            n = vec3(s[0], real(0.0), real(0.0))
            d = a[0]
        elif a[1] >= a[2]:
            n = vec3(real(0.0), s[1], real(0.0))
            d = a[1]
        else:
            n = vec3(real(0.0), real(0.0), s[2])
            d = a[2]
        return n, d

    @wp.func
    def corner_x(numbers: wp.array2d(dtype=real), solid: int, i: int):
        return numbers[solid, 4 + 2 * (i % CORNERS)]

    @wp.func
    def corner_z(numbers: wp.array2d(dtype=real), solid: int, i: int):
        return numbers[solid, 5 + 2 * (i % CORNERS)]

    @wp.func
    def nearest_feature(numbers: wp.array2d(dtype=real), solid: int, x: real, z: real):
        """Edge 0..5 of the convex profile, or 6 + corner; only whole numbers leave, so nothing to derive."""
        face = int(0)
        deepest = real(-1.0e30)
        feature = int(0)
        nearest = real(1.0e30)
        for i in range(CORNERS):
            ax = corner_x(numbers, solid, i)
            az = corner_z(numbers, solid, i)
            ex = corner_x(numbers, solid, i + 1) - ax
            ez = corner_z(numbers, solid, i + 1) - az
            e2 = ex * ex + ez * ez
            if e2 > tiny:
                out = ((x - ax) * ez - (z - az) * ex) / wp.sqrt(e2)
                if out > deepest:
                    deepest = out
                    face = i
                u = ((x - ax) * ex + (z - az) * ez) / e2
                code = i
                if u <= real(0.0):
                    u = real(0.0)
                    code = CORNERS + i
                if u >= real(1.0):
                    u = real(1.0)
                    code = CORNERS + (i + 1) % CORNERS
                dx = x - ax - u * ex
                dz = z - az - u * ez
                if dx * dx + dz * dz < nearest:
                    nearest = dx * dx + dz * dz
                    feature = code
        if deepest <= real(0.0):
            feature = face
        return feature

    @wp.func
    def profile_distance(numbers: wp.array2d(dtype=real), solid: int, p: vec3):
        """Normal, and distance to the sharp core of a solid of revolution."""
        rho = wp.sqrt(p[0] * p[0] + p[1] * p[1] + tiny)
        i = nearest_feature(numbers, solid, rho, p[2])
        nx = real(0.0)
        nz = real(0.0)
        d = real(0.0)
        if i >= CORNERS:
            dx = rho - corner_x(numbers, solid, i)
            dz = p[2] - corner_z(numbers, solid, i)
            d = wp.sqrt(dx * dx + dz * dz + tiny)
            nx = dx / d
            nz = dz / d
        else:
            ax = corner_x(numbers, solid, i)
            az = corner_z(numbers, solid, i)
            ex = corner_x(numbers, solid, i + 1) - ax
            ez = corner_z(numbers, solid, i + 1) - az
            length = wp.sqrt(ex * ex + ez * ez)
            nx = ez / length
            nz = -ex / length
            d = (rho - ax) * nx + (p[2] - az) * nz
        return vec3(nx * p[0] / rho, nx * p[1] / rho, nz), d

    @wp.func
    def distance(kind: int, numbers: wp.array2d(dtype=real), solid: int, p: vec3):
        """Outward normal and signed distance [m] of a point in the solid's frame."""
        rounding = numbers[solid, 0]
        half = vec3(numbers[solid, 1], numbers[solid, 2], numbers[solid, 3])
        n = vec3(real(0.0), real(0.0), real(1.0))  # of a plane
        d = p[2]
        if kind == BOX:
            n, d = box_distance(p, half)
        elif kind == CAPSULE:
            o = vec3(p[0], p[1], p[2] - wp.clamp(p[2], -half[2], half[2]))
            d = wp.sqrt(wp.dot(o, o) + tiny)
            n = o / d
        elif kind == REVOLVED:
            n, d = profile_distance(numbers, solid, p)
        return n, d - rounding

    @wp.func
    def ramp(x: real, width: real):
        """0 below -width, x above width, a parabola between: zero is reached, not only approached."""
        if x <= -width:
            return real(0.0)
        if x >= width:
            return x
        return (x + width) * (x + width) / (real(4.0) * width)

    @wp.func
    def ramp_slope(x: real, width: real):
        if x <= -width:
            return real(0.0)
        if x >= width:
            return real(1.0)
        return (x + width) / (real(2.0) * width)

    @wp.func
    def impulse(
        gap: real,
        n: vec3,
        u: vec3,
        stiffness: real,
        dissipation: real,
        friction: real,
        step: real,
        slip_speed: real,
        softness: real,
    ):
        """What the solid gives to the point in one step [N s], from the gap before and the velocity after."""
        un = wp.dot(n, u)
        ut = u - n * un
        press = (
            step
            * stiffness
            * ramp(-gap - step * un, softness)
            * ramp(real(1.0) - dissipation * un, real(0.1))
        )
        return n * press - ut * (friction * press / wp.sqrt(wp.dot(ut, ut) + slip_speed * slip_speed))

    return SimpleNamespace(distance=distance, ramp=ramp, ramp_slope=ramp_slope, impulse=impulse)
