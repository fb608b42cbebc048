"""Kernels of the backward pass: the multiplier of the solve, and one scalar whose adjoint is the gradient.

With r(v', x) = 0 the equation of the step and g the gradient with respect to v', the implicit function
theorem gives dL/dx = -lambda . dr/dx with (dr/dv')^T lambda = g. Here lambda . r is written as the power
of all forces on the virtual motion lambda, one outward pass over the tree, and Warp derives that.
"""

# pyright: basic, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportOperatorIssue=false, reportAttributeAccessIssue=false, reportInvalidTypeForm=false
# pyright: reportGeneralTypeIssues=false, reportAssignmentType=false, reportRedeclaration=false, reportOptionalOperand=false

from functools import cache
from types import SimpleNamespace

import warp as wp

from samrl_core.model.physics.distance_kernels import distance_functions
from samrl_core.model.physics.kernel_types import types
from samrl_core.model.physics.solve_kernels import solve_functions
from samrl_core.model.physics.tree_kernels import FREE, PRISMATIC, REVOLUTE, tree_functions


@cache
def power_kernels(double: bool) -> SimpleNamespace:
    """Kernels of one precision: `multiply`, `power` (differentiable), `collect`."""
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
    def link_power(tree: Tree, par: Values, motion: Motion, w: Power, k: int, e: int, l: int):
        """Motion of one link; returns minus the power of its inertia plus that of its wrench and joint."""
        a = tree.parent[l] + 1
        kind = tree.kind[l]
        i = tree.first_q[l]
        j = tree.first_v[l]
        h = tree.step
        result = zero
        if kind == FREE:
            w.place[e, l + 1] = vec3(motion.q[k, e, i], motion.q[k, e, i + 1], motion.q[k, e, i + 2])
            w.turn[e, l + 1] = wp.quat_to_matrix(
                quat(
                    motion.q[k, e, i + 3], motion.q[k, e, i + 4], motion.q[k, e, i + 5], motion.q[k, e, i + 6]
                )
            )
            w.spin[e, l + 1] = vec3(motion.v[k, e, j + 3], motion.v[k, e, j + 4], motion.v[k, e, j + 5])
            new_move = vec3(w.after[e, j], w.after[e, j + 1], w.after[e, j + 2])
            new_turn = vec3(w.after[e, j + 3], w.after[e, j + 4], w.after[e, j + 5])
            try_move = vec3(w.multiplier[e, j], w.multiplier[e, j + 1], w.multiplier[e, j + 2])
            try_turn = vec3(w.multiplier[e, j + 3], w.multiplier[e, j + 4], w.multiplier[e, j + 5])
            old_move = vec3(motion.v[k, e, j], motion.v[k, e, j + 1], motion.v[k, e, j + 2])
            w.rate[e, l + 1] = (new_move - old_move) / h - tree.gravity
            w.spin_rate[e, l + 1] = (new_turn - w.spin[e, l + 1]) / h
            w.new_move[e, l + 1] = new_move
            w.new_turn[e, l + 1] = new_turn
            w.try_move[e, l + 1] = try_move
            w.try_turn[e, l + 1] = try_turn
            for c in range(6):
                result -= par.damping[e, j + c] * w.multiplier[e, j + c] * w.after[e, j + c]
        else:
            arm = w.turn[e, a] * tree.offset[l]
            turn = w.turn[e, a] * tree.turn[l]
            axis = turn * tree.axis[l]
            spin = w.spin[e, a]
            if kind == PRISMATIC:
                arm = arm + axis * motion.q[k, e, i]
            rate = w.rate[e, a] + wp.cross(w.spin_rate[e, a], arm) + wp.cross(spin, wp.cross(spin, arm))
            new_move = w.new_move[e, a] + wp.cross(w.new_turn[e, a], arm)
            try_move = w.try_move[e, a] + wp.cross(w.try_turn[e, a], arm)
            if kind == REVOLUTE:
                v = motion.v[k, e, j]
                after = w.after[e, j]
                w.turn[e, l + 1] = turn * about_axis(tree.axis[l], motion.q[k, e, i])
                w.spin[e, l + 1] = spin + axis * v
                w.spin_rate[e, l + 1] = (
                    w.spin_rate[e, a] + axis * ((after - v) / h) + wp.cross(spin, axis * v)
                )
                w.new_turn[e, l + 1] = w.new_turn[e, a] + axis * after
                w.try_turn[e, l + 1] = w.try_turn[e, a] + axis * w.multiplier[e, j]
                w.rate[e, l + 1] = rate
                w.new_move[e, l + 1] = new_move
                w.try_move[e, l + 1] = try_move
            else:
                w.turn[e, l + 1] = turn
                w.spin[e, l + 1] = spin
                w.spin_rate[e, l + 1] = w.spin_rate[e, a]
                w.new_turn[e, l + 1] = w.new_turn[e, a]
                w.try_turn[e, l + 1] = w.try_turn[e, a]
                if kind == PRISMATIC:
                    v = motion.v[k, e, j]
                    after = w.after[e, j]
                    w.rate[e, l + 1] = rate + axis * ((after - v) / h) + wp.cross(spin, axis) * (two * v)
                    w.new_move[e, l + 1] = new_move + axis * after
                    w.try_move[e, l + 1] = try_move + axis * w.multiplier[e, j]
                else:
                    w.rate[e, l + 1] = rate
                    w.new_move[e, l + 1] = new_move
                    w.try_move[e, l + 1] = try_move
            w.place[e, l + 1] = w.place[e, a] + arm
            if kind == REVOLUTE or kind == PRISMATIC:
                spring = par.stiffness[e, j] * (par.rest[e, j] - motion.q[k, e, i] - h * w.after[e, j])
                result = w.multiplier[e, j] * (spring - par.damping[e, j] * w.after[e, j])
        return result * h

    @wp.func
    def body_power(par: Values, motion: Motion, w: Power, k: int, e: int, l: int, b: int):
        turn = w.turn[e, l + 1]
        c = turn * par.com[e, b]
        spin = w.spin[e, l + 1]
        spin_rate = w.spin_rate[e, l + 1]
        y = w.try_turn[e, l + 1]
        rate = w.rate[e, l + 1] + wp.cross(spin_rate, c) + wp.cross(spin, wp.cross(spin, c))
        back = wp.transpose(turn)
        s = back * spin
        torque = par.inertia[e, b] * (back * spin_rate) + wp.cross(s, par.inertia[e, b] * s)
        return (
            wp.dot(w.try_move[e, l + 1], motion.wrench[k, e, 2 * b])
            + wp.dot(y, motion.wrench[k, e, 2 * b + 1])
            - par.mass[e, b] * wp.dot(w.try_move[e, l + 1] + wp.cross(y, c), rate)
            - wp.dot(back * y, torque)
        )

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

    @wp.kernel(module="unique")
    def power(tree: Tree, touch: Touch, par: Values, motion: Motion, s: Solve, w: Power, k: int):
        """`total` = -lambda . r."""
        e = wp.tid()
        for l in range(tree.links):
            wp.atomic_add(w.total, e, link_power(tree, par, motion, w, k, e, l))
            b = tree.body[l]
            if b >= 0:
                wp.atomic_add(w.total, e, tree.step * body_power(par, motion, w, k, e, l, b))
        for a in range(s.active_count[k, e]):
            wp.atomic_add(w.total, e, contact_power(tree, touch, par, w, e, s.active[k, e, a]))

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

    return SimpleNamespace(multiply=multiply, power=power, collect=collect)
