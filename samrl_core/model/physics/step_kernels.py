"""The kernel of one forward step.

Solved for the velocity v' after the step, with everything geometric taken at its start:

    (M + h D + h^2 K) v' = M v + h (tau - c - K (q - rest)) + sum_i J_i^T p_i(J_i v')

where the contact impulses p see the depth that v' leads to (implicit). Driven velocities are given.
"""
# ruff: noqa: UP018, RUF046, B007  (Warp: only int(...) may change in a loop, a bare literal may not)

from functools import cache
from types import SimpleNamespace

import warp as wp

from samrl_core.model.physics.distance_kernels import distance_functions
from samrl_core.model.physics.kernel_types import types
from samrl_core.model.physics.solve_kernels import solve_functions
from samrl_core.model.physics.tree_kernels import tree_functions


@cache
def step_kernels(double: bool) -> SimpleNamespace:
    """Kernels of one precision: `step` and the differentiable `integrate`."""
    t = types(double)
    real, vec3 = t.real, t.vec3
    Tree, Touch, Values, Motion, Links, Solve = t.Tree, t.Touch, t.Values, t.Motion, t.Links, t.Solve
    tree_f, d, f = tree_functions(double), distance_functions(double), solve_functions(double)
    kinematics, mass_matrix, integrate_joint = tree_f.kinematics, tree_f.mass_matrix, tree_f.integrate
    velocities, distance = tree_f.velocities, d.distance
    factorise, factorise_symmetric, solve_for = f.factorise, f.factorise_symmetric, f.solve
    contact_residual, contact_slope = f.contact_residual, f.contact_slope
    zero, one = real(0.0), real(1.0)
    accurate = real(1.0e-22 if double else 2.0e-12)  # square of the relative residual that ends the search
    tiny = real(1.0e-30)

    @wp.func
    def fill_jacobian(tree: Tree, links: Links, s: Solve, e: int, a: int, link: int, at: vec3, sign: real):
        l = int(link)
        while l >= 0:
            r = at - links.place[e, l]
            for c in range(velocities(tree.kind[l])):
                j = tree.first_v[l] + c
                column = links.s_move[e, j] + wp.cross(links.s_turn[e, j], r)
                s.jacobian[e, a, j] = s.jacobian[e, a, j] + column * sign
            l = tree.parent[l]

    @wp.func
    def find_contacts(tree: Tree, touch: Touch, links: Links, s: Solve, k: int, e: int):
        """Gap, normal and Jacobian of each point that is near its solid."""
        count = int(0)
        for c in range(touch.count):
            la = touch.point_link[c]
            lb = touch.solid_link[c]
            i = touch.solid[c]
            point = links.place[e, la] + links.turn[e, la] * touch.point[c]
            turn = touch.solid_turn[i]
            place = touch.solid_offset[i]
            if lb >= 0:
                turn = links.turn[e, lb] * turn
                place = links.place[e, lb] + links.turn[e, lb] * place
            n, gap = distance(
                touch.solid_kind[i], touch.solid_numbers, i, wp.transpose(turn) * (point - place)
            )
            gap = gap - touch.radius[c]
            if gap < touch.margin:
                n = turn * n
                at = point - n * touch.radius[c]
                s.active[k, e, count] = c
                s.gap[e, count] = gap
                s.normal[e, count] = n
                for j in range(tree.dofs):
                    s.jacobian[e, count, j] = vec3()
                fill_jacobian(tree, links, s, e, count, la, at, one)
                fill_jacobian(tree, links, s, e, count, lb, at, -one)
                count += 1
        s.active_count[k, e] = count

    @wp.func
    def start_slip(tree: Tree, motion: Motion, s: Solve, k: int, e: int):
        """Relative velocities of the contacts."""
        after = motion.v[k + 1, e]
        for a in range(s.active_count[k, e]):
            u = vec3()
            for j in range(tree.dofs):
                u += s.jacobian[e, a, j] * after[j]
            s.slip[e, a] = u

    @wp.func
    def apply_change(tree: Tree, s: Solve, k: int, e: int):
        for i in range(tree.unknowns):
            total = zero
            for j in range(tree.dofs):
                if tree.solved[j] >= 0:
                    total += s.matrix[e, i, j] * s.change[e, tree.solved[j]]
            s.pushed[e, i] = total
        for a in range(s.active_count[k, e]):
            u = vec3()
            for j in range(tree.dofs):
                if tree.solved[j] >= 0:
                    u += s.jacobian[e, a, j] * s.change[e, tree.solved[j]]
            s.slip_change[e, a] = u

    @wp.func
    def merit(tree: Tree, s: Solve, e: int):
        """Square of the residual, each impulse weighed by its own inertia."""
        total = zero
        for j in range(tree.dofs):
            i = tree.solved[j]
            if i >= 0:
                total += s.residual[e, i] * s.residual[e, i] / s.matrix[e, i, j]
        return total

    @wp.func
    def magnitude(tree: Tree, s: Solve, e: int):
        """What the merit is compared with: the square of all impulses added without sign."""
        total = tiny
        for j in range(tree.dofs):
            i = tree.solved[j]
            if i >= 0:
                x = wp.abs(s.right[e, i]) + s.size[e, i]
                total += x * x / s.matrix[e, i, j]
        return total

    @wp.func
    def clear_change(tree: Tree, s: Solve, k: int, e: int):
        for i in range(tree.unknowns):
            s.change[e, i] = zero
            s.pushed[e, i] = zero
        for a in range(s.active_count[k, e]):
            s.slip_change[e, a] = vec3()

    @wp.func
    def copy_matrix(tree: Tree, s: Solve, k: int, e: int):
        f = s.factor[k, e]
        for i in range(tree.unknowns):
            row = s.matrix[e, i]
            for j in range(tree.dofs):
                if tree.solved[j] >= 0:
                    f[i, tree.solved[j]] = row[j]

    @wp.func
    def take_change(tree: Tree, motion: Motion, s: Solve, k: int, e: int, share: real):
        for j in range(tree.dofs):
            if tree.solved[j] >= 0:
                motion.v[k + 1, e, j] = motion.v[k + 1, e, j] + share * s.change[e, tree.solved[j]]

    @wp.func
    def take_rest(tree: Tree, s: Solve, k: int, e: int, share: real):
        """What goes along with a change of velocity: the residual's linear part, the contacts' motion."""
        for i in range(tree.unknowns):
            s.linear[e, i] = s.linear[e, i] + share * s.pushed[e, i]
        for a in range(s.active_count[k, e]):
            s.slip[e, a] = s.slip[e, a] + s.slip_change[e, a] * share

    @wp.func
    def newton(tree: Tree, touch: Touch, par: Values, motion: Motion, s: Solve, k: int, e: int, most: int):
        """Newton's method with halving of steps that do not lower the merit."""
        n = tree.unknowns
        done = int(0)
        start_slip(tree, motion, s, k, e)
        for trial in range(most + 1):
            if done == 0:
                clear_change(tree, s, k, e)
                contact_residual(tree, touch, par, s, k, e, zero)
                before = merit(tree, s, e)
                scale = magnitude(tree, s, e)
                s.error[k, e] = wp.sqrt(before / scale)
                # The factor is wanted at the solution too: the backward pass solves with it.
                copy_matrix(tree, s, k, e)
                contact_slope(tree, touch, par, s, k, e)
                factorise(s, k, e, n)
                if before <= accurate * scale or trial == most:
                    done = 1
                else:
                    for i in range(n):
                        s.change[e, i] = -s.residual[e, i]
                    solve_for(s, k, e, n)
                    apply_change(tree, s, k, e)
                    share = one
                    found = int(0)
                    for halving in range(20):
                        if found == 0:
                            contact_residual(tree, touch, par, s, k, e, share)
                            if merit(tree, s, e) < before:
                                found = 1
                            else:
                                share = share * real(0.5)
                    if found == 1:
                        take_change(tree, motion, s, k, e, share)
                        take_rest(tree, s, k, e, share)
                    else:
                        done = 1

    @wp.kernel(enable_backward=False, module="unique")
    def step(
        tree: Tree, touch: Touch, par: Values, motion: Motion, links: Links, s: Solve, k: int, most: int
    ):
        e = wp.tid()
        kinematics(tree, par, motion, links, k, e)
        mass_matrix(tree, par, motion, links, s, k, e)
        find_contacts(tree, touch, links, s, k, e)
        for j in range(tree.dofs):
            motion.v[k + 1, e, j] = motion.v[k, e, j]
            if tree.action[j] >= 0:
                motion.v[k + 1, e, j] = motion.action[k, e, tree.action[j]]
        if s.active_count[k, e] == 0:  # linear and symmetric
            copy_matrix(tree, s, k, e)
            factorise_symmetric(s, k, e, tree.unknowns)
            for i in range(tree.unknowns):
                s.change[e, i] = -s.linear[e, i]
            solve_for(s, k, e, tree.unknowns)
            take_change(tree, motion, s, k, e, one)
            s.error[k, e] = zero
        else:
            newton(tree, touch, par, motion, s, k, e, most)
        for l in range(tree.links):
            integrate_joint(tree, motion, k, e, l)

    @wp.kernel(module="unique")
    def integrate(tree: Tree, motion: Motion, k: int):
        l, e = wp.tid()
        integrate_joint(tree, motion, k, e, l)

    return SimpleNamespace(step=step, integrate=integrate)
