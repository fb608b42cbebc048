"""Friction of one joint, linear in the next velocity, and how implicit a spring has to be."""

from __future__ import annotations

import warp as wp

from samrl_core.diagnosis.simulation.kernels.kernel_slots import (
    BRISTLED,
    FRICTION_WAVE,
    ONE,
    P_COULOMB,
    P_COULOMB_VELOCITY,
    P_FRICTION_ASYMMETRY,
    P_FRICTION_HARMONIC_AMPLITUDE,
    P_FRICTION_HARMONIC_ORDER,
    P_FRICTION_HARMONIC_PHASE,
    P_LOAD_FRICTION,
    P_PRESLIDING_STIFFNESS,
    P_STRIBECK_DROP,
    P_STRIBECK_EXPONENT,
    P_STRIBECK_VELOCITY,
    P_THERMAL_OFFSET,
    P_THERMAL_RATIO,
    P_THERMAL_TIME,
    P_VISCOUS,
    SOFT,
    STRIBECK,
    THERMAL,
    TINY,
    ZERO,
)
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, f64


@wp.func
def left_of_drop(v: f64, vs: f64, d: f64):
    """Share of Stribeck's drop that is left at a velocity, and its derivative.

    exp(-|v / vs|^d), or 1 / (1 + (v / vs)^2) where d is 0 (Hess and Soom 1990). What is fitted with one
    exponent must not be simulated with another: how steeply friction falls from rest decides where it sticks.
    """
    if d == ZERO:
        share = ONE / (ONE + v * v / (vs * vs))
        return wp.vec2d(share, -f64(2.0) * v / (vs * vs) * share * share)
    x = wp.abs(v) / vs + TINY
    power = wp.pow(x, d)
    share = wp.exp(-power)
    return wp.vec2d(share, -d * power / x * share / vs * wp.sign(v))


@wp.func
def friction(
    a: Arrays, b: int, k: int, j: int, v: f64, q: f64, load: f64, bristle: f64, free: f64, inertia: f64
):
    """Friction as constant + slope x next velocity, and the next bristle in the same form.

    `free` is the next velocity were there no friction, `inertia` what the joint then feels.

    Level: Fc + drop exp(-|v / vs|^d) + Kl |load| + A sin(N q + phase), times the warm-up's factor.
    Dry: level tanh(v / vc) + asymmetry tanh^2(v / vc). Bristle: dz/dt = v - s0 |v| z / level, F = s0 z
    (C. Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995, with s1 = 0). Then viscous x v.
    """
    h = a.step
    flags = a.flags[b, j]
    warm = ONE
    if (flags & THERMAL) != 0:
        age = h * f64(k) + a.params[b, j, P_THERMAL_OFFSET]
        warm = ONE + a.params[b, j, P_THERMAL_RATIO] * wp.exp(-age / a.params[b, j, P_THERMAL_TIME])
    level = a.params[b, j, P_COULOMB] + a.params[b, j, P_LOAD_FRICTION] * wp.abs(load)
    if (flags & FRICTION_WAVE) != 0:
        level = level + a.params[b, j, P_FRICTION_HARMONIC_AMPLITUDE] * wp.sin(
            a.params[b, j, P_FRICTION_HARMONIC_ORDER] * q + a.params[b, j, P_FRICTION_HARMONIC_PHASE]
        )
    drop = a.params[b, j, P_STRIBECK_DROP]
    vs = a.params[b, j, P_STRIBECK_VELOCITY]
    vc = a.params[b, j, P_COULOMB_VELOCITY]
    # The next velocity under dry friction of this level, close enough to linearise there: `free` less
    # what friction takes, or creeping where it takes all.
    there = level
    if (flags & STRIBECK) != 0:
        there = there + drop * left_of_drop(v, vs, a.params[b, j, P_STRIBECK_EXPONENT])[0]
    take = h * warm * wp.abs(there) / inertia
    beyond = wp.max(wp.abs(free) - take, ZERO)
    x = free / (ONE + take / wp.sqrt(vc * vc + beyond * beyond))
    if (flags & BRISTLED) != 0:
        x = v  # a bristle holds without creeping, so only motion that is there may wear it
    viscous = warm * a.params[b, j, P_VISCOUS]
    fall = ZERO
    if (flags & STRIBECK) != 0:
        left = left_of_drop(x, vs, a.params[b, j, P_STRIBECK_EXPONENT])
        level = level + drop * left[0]
        fall = drop * left[1]
    s = wp.tanh(x / vc)
    steep = (ONE - s * s) / vc
    asymmetry = a.params[b, j, P_FRICTION_ASYMMETRY]
    constant = warm * asymmetry * s * s
    slope = viscous
    z_constant = ZERO
    z_slope = ZERO
    if (flags & BRISTLED) != 0:
        stiff = a.params[b, j, P_PRESLIDING_STIFFNESS]
        strength = wp.max(warm * level, ZERO)
        share = strength / (strength + h * stiff * wp.abs(x) + TINY)
        z_constant = share * bristle
        z_slope = share * h
        constant = constant + stiff * z_constant
        slope = slope + stiff * z_slope
    else:
        force = warm * (level * s + asymmetry * s * s)
        tangent = wp.max(warm * (level * steep + f64(2.0) * asymmetry * s * steep + fall * s), ZERO)
        constant = force - tangent * x
        slope = slope + tangent
    return wp.vec4d(constant, slope, z_constant, z_slope)


@wp.func
def spring_blend(stiffness: f64, inertia: f64, h: f64):
    """How implicit a spring is: 0 keeps a slow one undamped, 1 keeps one faster than the step stable."""
    x = h * h * stiffness / (inertia + TINY)
    return x * x / (x * x + SOFT)
