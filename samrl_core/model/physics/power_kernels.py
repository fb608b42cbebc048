"""Kernels of the backward pass: the multiplier of the solve, and one scalar whose adjoint is the gradient.

With r(v', x) = 0 the equation of the step and g the gradient with respect to v', the implicit function
theorem gives dL/dx = -lambda . dr/dx with (dr/dv')^T lambda = g. Here lambda . r is written as the power
of all forces on the virtual motion lambda, one outward pass over the tree, and Warp derives that.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from samrl_core.model.physics.distance_kernels import distance_functions
from samrl_core.model.physics.kernel_types import types
from samrl_core.model.physics.solve_kernels import solve_functions
from samrl_core.model.physics.tree_kernels import FREE, PRISMATIC, REVOLUTE, tree_functions


@cache
def power_kernels(double: bool) -> SimpleNamespace:
    """Kernels of one precision: `multiply`, `collect`, and the differentiable `link_power`, `touch_power`."""
    t = types(double)
    real, vec3, mat33, quat = t.real, t.vec3, t.mat33, t.quat
    Tree, Touch, Values, Motion, Solve, Power = t.Tree, t.Touch, t.Values, t.Motion, t.Solve, t.Power
    about_axis = tree_functions(double).about_axis
    distance, impulse = distance_functions(double).distance, distance_functions(double).impulse
    solve_transposed = solve_functions(double).solve_transposed
    zero, two = real(0.0), real(2.0)

    @wp.kernel(enable_backward=False, module="unique")
    def multiply(tree: Tree, motion: Motion, v_grad: wp.array3d(dtype=real), s: Solve, w: Power, k: int):
        """`multiplier` from the gradient of the velocity after the step."""
        e = wp.tid()
        for j in range(tree.dofs):
            w.after[e, j] = motion.v[k + 1, e, j]
            if tree.solved[j] >= 0:
                s.change[e, tree.solved[j]] = v_grad[k + 1, e, j]
        solve_transposed(s, k, e, tree.unknowns)
        for j in range(tree.dofs):
            w.multiplier[e, j] = zero
            if tree.solved[j] >= 0:
                w.multiplier[e, j] = s.change[e, tree.solved[j]]

    @wp.func
    def contact_power(tree: Tree, touch: Touch, par: Values, w: Power, e: int, c: int):
        la = touch.point_link[c] + 1
        lb = touch.solid_link[c] + 1
        i = touch.solid[c]
        p = touch.pair[c]
        point = w.place[e, la] + w.turn[e, la] * touch.point[c]
        turn = w.turn[e, lb] * touch.solid_turn[i]
        place = w.place[e, lb] + w.turn[e, lb] * touch.solid_offset[i]
        n, gap = distance(touch.solid_kind[i], touch.solid_numbers, i, wp.transpose(turn) * (point - place))
        n = turn * n
        at = point - n * touch.radius[c]
        ra = at - w.place[e, la]
        rb = at - w.place[e, lb]
        u = (
            w.new_move[e, la]
            - w.new_move[e, lb]
            + wp.cross(w.new_turn[e, la], ra)
            - wp.cross(w.new_turn[e, lb], rb)
        )
        y = (
            w.try_move[e, la]
            - w.try_move[e, lb]
            + wp.cross(w.try_turn[e, la], ra)
            - wp.cross(w.try_turn[e, lb], rb)
        )
        push = impulse(
            gap - touch.radius[c],
            n,
            u,
            par.contact_stiffness[e, p],
            par.dissipation[e, p],
            par.friction[e, p],
            tree.step,
            touch.slip_speed,
            touch.softness,
        )
        return wp.dot(y, push)

    # Arrays one by one, not in structs: the adjoint of a struct's member costs a copy at every access.
    @wp.kernel(module="unique")
    def link_power(
        links: int,
        h: real,
        gravity: vec3,
        parent: wp.array(dtype=wp.int32),
        kind: wp.array(dtype=wp.int32),
        offset: wp.array(dtype=vec3),
        joint_turn: wp.array(dtype=mat33),
        axis: wp.array(dtype=vec3),
        first_q: wp.array(dtype=wp.int32),
        first_v: wp.array(dtype=wp.int32),
        body: wp.array(dtype=wp.int32),
        mass: wp.array2d(dtype=real),
        com: wp.array2d(dtype=vec3),
        inertia: wp.array2d(dtype=mat33),
        stiffness: wp.array2d(dtype=real),
        damping: wp.array2d(dtype=real),
        rest: wp.array2d(dtype=real),
        position: wp.array3d(dtype=real),
        velocity: wp.array3d(dtype=real),
        wrench: wp.array3d(dtype=vec3),
        k: int,
        w_turn: wp.array2d(dtype=mat33),
        w_place: wp.array2d(dtype=vec3),
        w_spin: wp.array2d(dtype=vec3),
        w_spin_rate: wp.array2d(dtype=vec3),
        w_rate: wp.array2d(dtype=vec3),
        w_try_turn: wp.array2d(dtype=vec3),
        w_try_move: wp.array2d(dtype=vec3),
        w_new_turn: wp.array2d(dtype=vec3),
        w_new_move: wp.array2d(dtype=vec3),
        w_multiplier: wp.array2d(dtype=real),
        w_after: wp.array2d(dtype=real),
        total: wp.array(dtype=real),
    ):
        """Motion of the links, and minus the power of inertia, springs and wrenches added to `total`."""
        e = wp.tid()
        for l in range(links):
            a = parent[l] + 1
            of = kind[l]
            i = first_q[l]
            j = first_v[l]
            if of == FREE:
                w_place[e, l + 1] = vec3(position[k, e, i], position[k, e, i + 1], position[k, e, i + 2])
                w_turn[e, l + 1] = wp.quat_to_matrix(
                    quat(
                        position[k, e, i + 3],
                        position[k, e, i + 4],
                        position[k, e, i + 5],
                        position[k, e, i + 6],
                    )
                )
                w_spin[e, l + 1] = vec3(velocity[k, e, j + 3], velocity[k, e, j + 4], velocity[k, e, j + 5])
                new_move = vec3(w_after[e, j], w_after[e, j + 1], w_after[e, j + 2])
                new_turn = vec3(w_after[e, j + 3], w_after[e, j + 4], w_after[e, j + 5])
                try_move = vec3(w_multiplier[e, j], w_multiplier[e, j + 1], w_multiplier[e, j + 2])
                try_turn = vec3(w_multiplier[e, j + 3], w_multiplier[e, j + 4], w_multiplier[e, j + 5])
                old_move = vec3(velocity[k, e, j], velocity[k, e, j + 1], velocity[k, e, j + 2])
                w_rate[e, l + 1] = (new_move - old_move) / h - gravity
                w_spin_rate[e, l + 1] = (new_turn - w_spin[e, l + 1]) / h
                w_new_move[e, l + 1] = new_move
                w_new_turn[e, l + 1] = new_turn
                w_try_move[e, l + 1] = try_move
                w_try_turn[e, l + 1] = try_turn
                for m in range(6):
                    wp.atomic_add(
                        total, e, -h * (damping[e, j + m] * w_multiplier[e, j + m] * w_after[e, j + m])
                    )
            else:
                arm = w_turn[e, a] * offset[l]
                turn = w_turn[e, a] * joint_turn[l]
                along = turn * axis[l]
                spin = w_spin[e, a]
                if of == PRISMATIC:
                    arm = arm + along * position[k, e, i]
                rate = w_rate[e, a] + wp.cross(w_spin_rate[e, a], arm) + wp.cross(spin, wp.cross(spin, arm))
                new_move = w_new_move[e, a] + wp.cross(w_new_turn[e, a], arm)
                try_move = w_try_move[e, a] + wp.cross(w_try_turn[e, a], arm)
                if of == REVOLUTE:
                    v = velocity[k, e, j]
                    after = w_after[e, j]
                    w_turn[e, l + 1] = turn * about_axis(axis[l], position[k, e, i])
                    w_spin[e, l + 1] = spin + along * v
                    w_spin_rate[e, l + 1] = (
                        w_spin_rate[e, a] + along * ((after - v) / h) + wp.cross(spin, along * v)
                    )
                    w_new_turn[e, l + 1] = w_new_turn[e, a] + along * after
                    w_try_turn[e, l + 1] = w_try_turn[e, a] + along * w_multiplier[e, j]
                    w_rate[e, l + 1] = rate
                    w_new_move[e, l + 1] = new_move
                    w_try_move[e, l + 1] = try_move
                else:
                    w_turn[e, l + 1] = turn
                    w_spin[e, l + 1] = spin
                    w_spin_rate[e, l + 1] = w_spin_rate[e, a]
                    w_new_turn[e, l + 1] = w_new_turn[e, a]
                    w_try_turn[e, l + 1] = w_try_turn[e, a]
                    if of == PRISMATIC:
                        v = velocity[k, e, j]
                        after = w_after[e, j]
                        w_rate[e, l + 1] = (
                            rate + along * ((after - v) / h) + wp.cross(spin, along) * (two * v)
                        )
                        w_new_move[e, l + 1] = new_move + along * after
                        w_try_move[e, l + 1] = try_move + along * w_multiplier[e, j]
                    else:
                        w_rate[e, l + 1] = rate
                        w_new_move[e, l + 1] = new_move
                        w_try_move[e, l + 1] = try_move
                w_place[e, l + 1] = w_place[e, a] + arm
                if of == REVOLUTE or of == PRISMATIC:
                    spring = stiffness[e, j] * (rest[e, j] - position[k, e, i] - h * w_after[e, j])
                    wp.atomic_add(total, e, h * w_multiplier[e, j] * (spring - damping[e, j] * w_after[e, j]))
            b = body[l]
            if b >= 0:
                own = w_turn[e, l + 1]
                centre = own * com[e, b]
                own_spin = w_spin[e, l + 1]
                own_rate = w_spin_rate[e, l + 1]
                y = w_try_turn[e, l + 1]
                acc = (
                    w_rate[e, l + 1]
                    + wp.cross(own_rate, centre)
                    + wp.cross(own_spin, wp.cross(own_spin, centre))
                )
                back = wp.transpose(own)
                spin_in_body = back * own_spin
                torque = inertia[e, b] * (back * own_rate) + wp.cross(
                    spin_in_body, inertia[e, b] * spin_in_body
                )
                result = (
                    wp.dot(w_try_move[e, l + 1], wrench[k, e, 2 * b])
                    + wp.dot(y, wrench[k, e, 2 * b + 1])
                    - mass[e, b] * wp.dot(w_try_move[e, l + 1] + wp.cross(y, centre), acc)
                    - wp.dot(back * y, torque)
                )
                wp.atomic_add(total, e, h * result)

    @wp.kernel(module="unique")
    def touch_power(tree: Tree, touch: Touch, par: Values, s: Solve, w: Power, k: int):
        """The power of the contacts added to `total`, from the motion that `link_power` left."""
        e = wp.tid()
        for n in range(s.active_count[k, e]):
            wp.atomic_add(w.total, e, contact_power(tree, touch, par, w, e, s.active[k, e, n]))

    @wp.kernel(enable_backward=False, module="unique")
    def collect(
        tree: Tree,
        v_grad: wp.array3d(dtype=real),
        action_grad: wp.array3d(dtype=real),
        w: Power,
        w_grad: Power,
        k: int,
    ):
        """Gradient of the action; and the scratch's gradients to zero for the next step."""
        e = wp.tid()
        for j in range(tree.dofs):
            if tree.action[j] >= 0:
                action_grad[k, e, tree.action[j]] = v_grad[k + 1, e, j] + w_grad.after[e, j]
            w_grad.after[e, j] = zero
            w_grad.multiplier[e, j] = zero
        for l in range(tree.links + 1):
            w_grad.turn[e, l] = mat33()
            w_grad.place[e, l] = vec3()
            w_grad.spin[e, l] = vec3()
            w_grad.spin_rate[e, l] = vec3()
            w_grad.rate[e, l] = vec3()
            w_grad.try_turn[e, l] = vec3()
            w_grad.try_move[e, l] = vec3()
            w_grad.new_turn[e, l] = vec3()
            w_grad.new_move[e, l] = vec3()

    return SimpleNamespace(multiply=multiply, link_power=link_power, touch_power=touch_power, collect=collect)
