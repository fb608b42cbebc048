"""Equations of motion M(q) a + h(q, v) = effort of nine mechanisms, each written out by hand.

Lagrange's equations with the kinetic energy of bodies whose centre of mass lies on a line through their
joint; gravity is any vector, so that a leaning base is no special case. Sources: Spong, Hutchinson,
Vidyasagar 2006, section 7.3 (two links); the others by the same steps. A test compares each with its URDF
in a robot library.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.blind_test.servo_worlds.links import Link, Triple

Vector = list[float]
Motion = Callable[[Vector, Vector, np.ndarray], tuple[list[Vector], Vector]]  # (q, v, gravity) -> M, h
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_DOWN, _NONE = (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Mechanism:
    """Nominal links, their equations, and how far and fast the axes are moved."""

    name: str
    links: tuple[Link, ...]
    motion: Callable[[tuple[Link, ...]], Motion]
    reach: tuple[float, ...]  # amplitude of the motion per axis [rad or m]
    hangs: bool = False  # comes back by itself when nobody drives it


def _rod(mass: float, length: float, width: float, along: Triple) -> Triple:
    """Principal moments of a rod about its centre."""
    across, own = mass * (length**2 / 12 + width**2 / 12), mass * width**2 / 6
    x, y, z = (own if abs(a) > 0.5 else across for a in along)
    return x, y, z


def _slide(links: tuple[Link, ...]) -> Motion:
    (body,) = links
    axis = np.array(body.axis)

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        return [[body.mass]], [-body.mass * float(g @ axis)]

    return motion


def _pendulum(links: tuple[Link, ...]) -> Motion:
    (body,) = links
    weight, inertia = body.mass * body.reach, body.inertia[1] + body.mass * body.reach**2

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        return [[inertia]], [-weight * (-g[0] * math.cos(q[0]) + g[2] * math.sin(q[0]))]

    return motion


def _turntable(links: tuple[Link, ...]) -> Motion:
    (body,) = links
    weight, inertia = body.mass * body.reach, body.inertia[2] + body.mass * body.reach**2

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        return [[inertia]], [-weight * (-g[0] * math.sin(q[0]) + g[1] * math.cos(q[0]))]

    return motion


def _two_link(links: tuple[Link, ...]) -> Motion:
    one, two = links
    length = -two.origin[2]
    far = two.mass * length * two.reach

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        c2, s2 = math.cos(q[1]), math.sin(q[1])
        m22 = two.inertia[1] + two.mass * two.reach**2
        m12 = m22 + far * c2
        m11 = one.inertia[1] + one.mass * one.reach**2 + m22 + two.mass * length**2 + 2.0 * far * c2
        # d(position)/d(angle) of a point at one metre below a joint: (-cos, 0, sin)
        first = -g[0] * math.cos(q[0]) + g[2] * math.sin(q[0])
        both = -g[0] * math.cos(q[0] + q[1]) + g[2] * math.sin(q[0] + q[1])
        w2 = -two.mass * two.reach * both
        w1 = w2 - (one.mass * one.reach + two.mass * length) * first
        h1 = -far * s2 * (2.0 * v[0] * v[1] + v[1] ** 2) + w1
        return [[m11, m12], [m12, m22]], [h1, far * s2 * v[0] ** 2 + w2]

    return motion


def _gimbal(links: tuple[Link, ...]) -> Motion:
    pan, tilt = links
    far = tilt.mass * tilt.reach**2
    jx, jy, jz = tilt.inertia

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        c, s = math.cos(q[1]), math.sin(q[1])
        m11 = pan.inertia[2] + jx * s * s + (jz + far) * c * c
        slope = 2.0 * s * c * (jx - jz - far)
        radial, side = _turned(q[0], g)
        weight = tilt.mass * tilt.reach
        h1 = slope * v[0] * v[1] - weight * c * side
        h2 = -0.5 * slope * v[0] ** 2 - weight * (-s * radial - c * g[2])
        return [[m11, 0.0], [0.0, jy + far]], [h1, h2]

    return motion


def _turned(angle: float, g: np.ndarray) -> tuple[float, float]:
    """Gravity along and across a direction that was turned about z."""
    c, s = math.cos(angle), math.sin(angle)
    return float(g[0]) * c + float(g[1]) * s, -float(g[0]) * s + float(g[1]) * c


def _gantry(links: tuple[Link, ...]) -> Motion:
    bridge, carriage = links
    total = bridge.mass + carriage.mass

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        weights = [-total * float(g[0]), -carriage.mass * float(g[1])]
        return [[total, 0.0], [0.0, carriage.mass]], weights

    return motion


def _cart(links: tuple[Link, ...]) -> Motion:
    cart, rod = links
    weight, inertia = rod.mass * rod.reach, rod.inertia[1] + rod.mass * rod.reach**2
    total = cart.mass + rod.mass

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        c, s = math.cos(q[1]), math.sin(q[1])
        h1 = weight * s * v[1] ** 2 - total * float(g[0])
        h2 = -weight * (-float(g[0]) * c + float(g[2]) * s)
        return [[total, -weight * c], [-weight * c, inertia]], [h1, h2]

    return motion


def _cylindrical(links: tuple[Link, ...]) -> Motion:
    lift, column, ram = links
    total = lift.mass + column.mass + ram.mass

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        r = ram.origin[0] + q[2] + ram.reach
        radial, side = _turned(q[1], g)
        turning = column.inertia[2] + ram.inertia[2] + ram.mass * r * r
        h2 = 2.0 * ram.mass * r * v[2] * v[1] - ram.mass * r * side
        h3 = -ram.mass * r * v[1] ** 2 - ram.mass * radial
        m = [[total, 0.0, 0.0], [0.0, turning, 0.0], [0.0, 0.0, ram.mass]]
        return m, [-total * float(g[2]), h2, h3]

    return motion


def _pan_two_link(links: tuple[Link, ...]) -> Motion:
    pan, upper, fore = links
    length = fore.origin[0]
    far = fore.mass * length * fore.reach

    def motion(q: Vector, v: Vector, g: np.ndarray) -> tuple[list[Vector], Vector]:
        c2, s2, c3, s3 = math.cos(q[1]), math.sin(q[1]), math.cos(q[2]), math.sin(q[2])
        c23, s23 = math.cos(q[1] + q[2]), math.sin(q[1] + q[2])
        r2, r3 = upper.reach * c2, length * c2 + fore.reach * c23
        (x2, y2, z2), (x3, y3, z3) = upper.inertia, fore.inertia
        turning = x2 * s2**2 + z2 * c2**2 + x3 * s23**2 + z3 * c23**2
        m11 = pan.inertia[2] + turning + upper.mass * r2**2 + fore.mass * r3**2
        m33 = y3 + fore.mass * fore.reach**2
        m23 = m33 + far * c3
        m22 = y2 + upper.mass * upper.reach**2 + m33 + fore.mass * length**2 + 2.0 * far * c3
        d3 = 2.0 * s23 * c23 * (x3 - z3) - 2.0 * fore.mass * r3 * fore.reach * s23
        d2 = 2.0 * s2 * c2 * (x2 - z2) + 2.0 * s23 * c23 * (x3 - z3)
        d2 -= 2.0 * upper.mass * r2 * upper.reach * s2
        d2 -= 2.0 * fore.mass * r3 * (length * s2 + fore.reach * s23)
        radial, side = _turned(q[0], g)
        down2, down3 = -s2 * radial - c2 * float(g[2]), -s23 * radial - c23 * float(g[2])
        w3 = -fore.mass * fore.reach * down3
        w2 = w3 - (upper.mass * upper.reach + fore.mass * length) * down2
        w1 = -(upper.mass * r2 + fore.mass * r3) * side
        h1 = (d2 * v[1] + d3 * v[2]) * v[0] + w1
        h2 = -0.5 * d2 * v[0] ** 2 - far * s3 * (2.0 * v[1] * v[2] + v[2] ** 2) + w2
        h3 = -0.5 * d3 * v[0] ** 2 + far * s3 * v[1] ** 2 + w3
        return [[m11, 0.0, 0.0], [0.0, m22, m23], [0.0, m23, m33]], [h1, h2, h3]

    return motion


def mechanisms(rng: np.random.Generator) -> tuple[Mechanism, ...]:
    """All nine, with sizes that differ from world to world as machines do."""

    def size(low: float, high: float) -> float:
        return float(f"{rng.uniform(low, high):.3g}")  # as a data sheet states it

    def rod(name: str, joint: str, axis: Triple, origin: Triple, mass: float, along: Triple, length: float):
        inertia = _rod(mass, length, 0.06, along)
        return Link(name, joint, "revolute", axis, origin, mass, along, 0.5 * length, inertia)

    def block(name: str, joint: str, kind: str, axis: Triple, origin: Triple, mass: float) -> Link:
        moment = mass * 0.15**2 / 6
        return Link(name, joint, kind, axis, origin, mass, _X, 0.0, (moment, moment, moment))

    lean = size(0.2, 0.6)
    first, second, upper = size(0.2, 0.35), size(0.2, 0.35), size(0.25, 0.4)
    return (
        Mechanism(
            "slide",
            (
                block(
                    "carriage", "slide", "prismatic", (math.cos(lean), 0.0, math.sin(lean)), _NONE, size(2, 8)
                ),
            ),
            _slide,
            (0.15,),
        ),
        Mechanism(
            "pendulum",
            (rod("arm", "swing", _Y, _NONE, size(0.5, 2), _DOWN, size(0.25, 0.6)),),
            _pendulum,
            (0.8,),
            True,
        ),
        Mechanism(
            "turntable",
            (_off_axis(block("plate", "turn", "revolute", _Z, _NONE, size(2, 8)), 0.03),),
            _turntable,
            (1.2,),
            True,
        ),
        Mechanism(
            "two_link",
            (
                rod("upper", "shoulder", _Y, _NONE, size(0.8, 2), _DOWN, first),
                rod("lower", "elbow", _Y, (0.0, 0.0, -first), size(0.4, 1), _DOWN, second),
            ),
            _two_link,
            (0.6, 0.7),
            True,
        ),
        Mechanism(
            "gimbal",
            (
                block("yoke", "pan", "revolute", _Z, _NONE, size(0.5, 1.5)),
                rod("head", "tilt", _Y, (0.0, 0.0, 0.1), size(0.4, 1.2), _X, size(0.1, 0.25)),
            ),
            _gimbal,
            (1.0, 0.5),
        ),
        Mechanism(
            "gantry",
            (
                block("bridge", "x", "prismatic", _X, _NONE, size(4, 9)),
                block("carriage", "y", "prismatic", _Y, (0.0, 0.0, 0.2), size(1, 4)),
            ),
            _gantry,
            (0.15, 0.15),
        ),
        Mechanism(
            "cart",
            (
                block("cart", "x", "prismatic", _X, _NONE, size(1, 4)),
                rod("rod", "swing", _Y, _NONE, size(0.3, 1.0), _DOWN, size(0.3, 0.6)),
            ),
            _cart,
            (0.12, 0.6),
        ),
        Mechanism(
            "cylindrical",
            (
                block("lift", "z", "prismatic", _Z, _NONE, size(1, 3)),
                block("column", "turn", "revolute", _Z, _NONE, size(1, 3)),
                block("ram", "reach", "prismatic", _X, (size(0.25, 0.4), 0.0, 0.0), size(0.5, 1.5)),
            ),
            _cylindrical,
            (0.08, 0.8, 0.1),
        ),
        Mechanism(
            "pan_two_link",
            (
                block("waist", "pan", "revolute", _Z, _NONE, size(1, 2)),
                rod("upper", "shoulder", _Y, (0.0, 0.0, 0.1), size(0.6, 1.4), _X, upper),
                rod("fore", "elbow", _Y, (upper, 0.0, 0.0), size(0.3, 0.9), _X, size(0.2, 0.3)),
            ),
            _pan_two_link,
            (0.8, 0.5, 0.6),
        ),
    )


def _off_axis(link: Link, reach: float) -> Link:
    """The link with its centre of mass off the axis."""
    return replace(link, reach=reach)
