"""Scalar-dependent types of the kernels: one set for float32, one for float64.

Kernels are made by functions that take such a set, so that the same source runs in both precisions: the
float64 build is the reference for the gradients of the float32 build.
"""
# Annotations are evaluated where they stand (no `annotations` import): Warp has to see the closure's types.

from functools import cache
from types import SimpleNamespace

import warp as wp


@cache
def types(double: bool) -> SimpleNamespace:
    """Scalar, vector and matrix types and the kernels' structs for one precision.

    Shapes: B environments, L links, D velocities, U of them solved for, N bodies, C contact points,
    S solids, P pairs, T steps. Link arrays of `Power` have the world in front.
    """
    real = wp.float64 if double else wp.float32
    vec3 = wp.vec3d if double else wp.vec3f
    mat33 = wp.mat33d if double else wp.mat33f
    quat = wp.quatd if double else wp.quatf

    @wp.struct
    class Tree:
        links: wp.int32
        dofs: wp.int32
        unknowns: wp.int32
        parent: wp.array(dtype=wp.int32)
        kind: wp.array(dtype=wp.int32)
        offset: wp.array(dtype=vec3)
        turn: wp.array(dtype=mat33)
        axis: wp.array(dtype=vec3)
        first_q: wp.array(dtype=wp.int32)
        first_v: wp.array(dtype=wp.int32)
        body: wp.array(dtype=wp.int32)
        link_of_v: wp.array(dtype=wp.int32)
        q_of_v: wp.array(dtype=wp.int32)
        before: wp.array(dtype=wp.int32)
        solved: wp.array(dtype=wp.int32)
        action: wp.array(dtype=wp.int32)
        gravity: vec3
        step: real  # [s]

    @wp.struct
    class Touch:
        count: wp.int32
        pair: wp.array(dtype=wp.int32)
        point_link: wp.array(dtype=wp.int32)
        point: wp.array(dtype=vec3)
        radius: wp.array(dtype=real)
        solid_link: wp.array(dtype=wp.int32)
        solid: wp.array(dtype=wp.int32)
        solid_kind: wp.array(dtype=wp.int32)
        solid_turn: wp.array(dtype=mat33)
        solid_offset: wp.array(dtype=vec3)
        solid_numbers: wp.array2d(dtype=real)
        slip_speed: real  # [m/s]
        softness: real  # [m]
        margin: real  # [m]

    @wp.struct
    class Values:
        """Parameters, (B, ...)."""

        mass: wp.array2d(dtype=real)
        com: wp.array2d(dtype=vec3)
        inertia: wp.array2d(dtype=mat33)
        stiffness: wp.array2d(dtype=real)
        damping: wp.array2d(dtype=real)
        rest: wp.array2d(dtype=real)
        friction: wp.array2d(dtype=real)
        contact_stiffness: wp.array2d(dtype=real)
        dissipation: wp.array2d(dtype=real)

    @wp.struct
    class Motion:
        """A rollout, (T, B, ...); states have T + 1."""

        q: wp.array3d(dtype=real)
        v: wp.array3d(dtype=real)
        action: wp.array3d(dtype=real)
        wrench: wp.array3d(dtype=vec3)  # force and torque of each body in turn

    @wp.struct
    class Links:
        """Scratch of the forward step, (B, L)."""

        turn: wp.array2d(dtype=mat33)
        place: wp.array2d(dtype=vec3)
        spin: wp.array2d(dtype=vec3)
        spin_rate: wp.array2d(dtype=vec3)
        rate: wp.array2d(dtype=vec3)
        force: wp.array2d(dtype=vec3)
        torque: wp.array2d(dtype=vec3)
        mass: wp.array2d(dtype=real)
        first: wp.array2d(dtype=vec3)  # mass times centre, from the link's origin
        inertia: wp.array2d(dtype=mat33)  # about the link's origin
        s_turn: wp.array2d(dtype=vec3)  # (B, D) unit motion of each velocity
        s_move: wp.array2d(dtype=vec3)

    @wp.struct
    class Solve:
        """Scratch of the solver and what the backward pass needs of it."""

        matrix: wp.array3d(dtype=real)  # (B, U, D) mass, damping and stiffness
        right: wp.array2d(dtype=real)  # (B, U) impulse of forces, then what residuals are compared with
        linear: wp.array2d(dtype=real)  # (B, U) residual without contact
        residual: wp.array2d(dtype=real)  # (B, U)
        change: wp.array2d(dtype=real)  # (B, U)
        pushed: wp.array2d(dtype=real)  # (B, U)
        size: wp.array2d(dtype=real)  # (B, U) impulses of contact, added by amount
        jacobian: wp.array3d(dtype=vec3)  # (B, C, D)
        normal: wp.array2d(dtype=vec3)  # (B, C)
        gap: wp.array2d(dtype=real)  # (B, C)
        slip: wp.array2d(dtype=vec3)  # (B, C) relative velocity
        slip_change: wp.array2d(dtype=vec3)  # (B, C)
        factor: wp.array4d(dtype=real)  # (T, B, U, U)
        pivot: wp.array3d(dtype=wp.int32)  # (T, B, U)
        active: wp.array3d(dtype=wp.int32)  # (T, B, C) points near enough
        active_count: wp.array2d(dtype=wp.int32)  # (T, B)
        error: wp.array2d(dtype=real)  # (T, B) what is left of the residual, relative

    @wp.struct
    class Power:
        """Differentiated scratch, (B, L + 1), with the world as link 0."""

        turn: wp.array2d(dtype=mat33)
        place: wp.array2d(dtype=vec3)
        spin: wp.array2d(dtype=vec3)
        spin_rate: wp.array2d(dtype=vec3)
        rate: wp.array2d(dtype=vec3)
        try_turn: wp.array2d(dtype=vec3)
        try_move: wp.array2d(dtype=vec3)
        new_turn: wp.array2d(dtype=vec3)
        new_move: wp.array2d(dtype=vec3)
        multiplier: wp.array2d(dtype=real)  # (B, D)
        after: wp.array2d(dtype=real)  # (B, D) velocity after the step
        total: wp.array(dtype=real)  # (B,)

    return SimpleNamespace(
        double=double,
        real=real,
        vec3=vec3,
        mat33=mat33,
        quat=quat,
        Tree=Tree,
        Touch=Touch,
        Values=Values,
        Motion=Motion,
        Links=Links,
        Solve=Solve,
        Power=Power,
    )
