"""Kinematics, bias forces and mass matrix of a tree of links, forward only.

Everything of a link is taken about its own origin and in world axes (classical, not spatial,
accelerations): about the world's origin, float32 would lose the inertia of a light link far away.
Composite inertia: Featherstone, Rigid Body Dynamics Algorithms (2008), table 6.2; bias forces: table 5.1.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from samrl_core.model.physics.kernel_types import types
from samrl_core.model.physics.scene import JointKind

REVOLUTE = wp.constant(int(JointKind.REVOLUTE))
PRISMATIC = wp.constant(int(JointKind.PRISMATIC))
FREE = wp.constant(int(JointKind.FREE))


@cache
def tree_functions(double: bool) -> SimpleNamespace:
    """Functions of one precision: `skew`, `about_axis`, `integrate`, `kinematics`, `mass_matrix`."""
    t = types(double)
    real, vec3, mat33, quat = t.real, t.vec3, t.mat33, t.quat
    Tree, Values, Motion, Links, Solve = t.Tree, t.Values, t.Motion, t.Links, t.Solve
    one, zero = real(1.0), real(0.0)

    @wp.func
    def skew(a: vec3):
        return mat33(zero, -a[2], a[1], a[2], zero, -a[0], -a[1], a[0], zero)

    @wp.func
    def about_axis(a: vec3, angle: real):
        """Rotation matrix, Rodrigues' formula."""
        k = skew(a)
        return wp.identity(n=3, dtype=real) + k * wp.sin(angle) + (k * k) * (one - wp.cos(angle))

    @wp.func
    def unit_axis(i: int):
        return vec3(wp.where(i == 0, one, zero), wp.where(i == 1, one, zero), wp.where(i == 2, one, zero))

    @wp.func
    def integrate(tree: Tree, motion: Motion, k: int, e: int, link: int):
        """Coordinates of one joint after the step, from its velocity after the step."""
        kind = tree.kind[link]
        i = tree.first_q[link]
        j = tree.first_v[link]
        h = tree.step
        if kind == FREE:
            for n in range(3):
                motion.q[k + 1, e, i + n] = motion.q[k, e, i + n] + h * motion.v[k + 1, e, j + n]
            w = vec3(motion.v[k + 1, e, j + 3], motion.v[k + 1, e, j + 4], motion.v[k + 1, e, j + 5]) * h
            angle2 = wp.dot(w, w)
            # sin(x/2)/x and cos(x/2); their series where the quotient would lose its slope
            s = real(0.5) - angle2 / real(48.0)
            c = one - angle2 / real(8.0)
            if angle2 > real(1.0e-4):
                x = wp.sqrt(angle2)
                s = wp.sin(real(0.5) * x) / x
                c = wp.cos(real(0.5) * x)
            old = quat(
                motion.q[k, e, i + 3], motion.q[k, e, i + 4], motion.q[k, e, i + 5], motion.q[k, e, i + 6]
            )
            new = wp.normalize(quat(w[0] * s, w[1] * s, w[2] * s, c) * old)
            motion.q[k + 1, e, i + 3] = new[0]
            motion.q[k + 1, e, i + 4] = new[1]
            motion.q[k + 1, e, i + 5] = new[2]
            motion.q[k + 1, e, i + 6] = new[3]
        elif kind == REVOLUTE or kind == PRISMATIC:
            motion.q[k + 1, e, i] = motion.q[k, e, i] + h * motion.v[k + 1, e, j]

    @wp.func
    def kinematics(tree: Tree, par: Values, motion: Motion, links: Links, k: int, e: int):
        """Poses, unit motions, composite inertia of single links, and forces without joint acceleration."""
        for l in range(tree.links):
            parent = tree.parent[l]
            kind = tree.kind[l]
            i = tree.first_q[l]
            j = tree.first_v[l]
            turn = wp.identity(n=3, dtype=real)
            place = vec3()
            spin = vec3()
            spin_rate = vec3()
            rate = -tree.gravity
            if parent >= 0:
                turn = links.turn[e, parent]
                place = links.place[e, parent]
                spin = links.spin[e, parent]
                spin_rate = links.spin_rate[e, parent]
                rate = links.rate[e, parent]
            if kind == FREE:
                place = vec3(motion.q[k, e, i], motion.q[k, e, i + 1], motion.q[k, e, i + 2])
                turn = wp.quat_to_matrix(
                    quat(
                        motion.q[k, e, i + 3],
                        motion.q[k, e, i + 4],
                        motion.q[k, e, i + 5],
                        motion.q[k, e, i + 6],
                    )
                )
                spin = vec3(motion.v[k, e, j + 3], motion.v[k, e, j + 4], motion.v[k, e, j + 5])
                for n in range(3):
                    links.s_turn[e, j + n] = vec3()
                    links.s_move[e, j + n] = unit_axis(n)
                    links.s_turn[e, j + 3 + n] = unit_axis(n)
                    links.s_move[e, j + 3 + n] = vec3()
            else:
                arm = turn * tree.offset[l]
                turn = turn * tree.turn[l]
                axis = turn * tree.axis[l]
                if kind == PRISMATIC:
                    arm = arm + axis * motion.q[k, e, i]
                place = place + arm
                rate = rate + wp.cross(spin_rate, arm) + wp.cross(spin, wp.cross(spin, arm))
                if kind == PRISMATIC:
                    rate = rate + wp.cross(spin, axis) * (real(2.0) * motion.v[k, e, j])
                    links.s_turn[e, j] = vec3()
                    links.s_move[e, j] = axis
                elif kind == REVOLUTE:
                    turn = turn * about_axis(tree.axis[l], motion.q[k, e, i])
                    relative = axis * motion.v[k, e, j]
                    spin_rate = spin_rate + wp.cross(spin, relative)
                    spin = spin + relative
                    links.s_turn[e, j] = axis
                    links.s_move[e, j] = vec3()
            links.turn[e, l] = turn
            links.place[e, l] = place
            links.spin[e, l] = spin
            links.spin_rate[e, l] = spin_rate
            links.rate[e, l] = rate
            links.mass[e, l] = zero
            links.first[e, l] = vec3()
            links.inertia[e, l] = mat33()
            links.force[e, l] = vec3()
            links.torque[e, l] = vec3()
            b = tree.body[l]
            if b >= 0:
                m = par.mass[e, b]
                c = turn * par.com[e, b]
                inertia = turn * par.inertia[e, b] * wp.transpose(turn)
                cx = skew(c)
                f = (rate + wp.cross(spin_rate, c) + wp.cross(spin, wp.cross(spin, c))) * m
                links.mass[e, l] = m
                links.first[e, l] = c * m
                links.inertia[e, l] = inertia - cx * cx * m
                links.force[e, l] = f - motion.wrench[k, e, 2 * b]
                links.torque[e, l] = (
                    wp.cross(c, f)
                    + inertia * spin_rate
                    + wp.cross(spin, inertia * spin)
                    - motion.wrench[k, e, 2 * b + 1]
                )

    @wp.func
    def velocities(kind: int):
        return wp.where(kind == FREE, 6, wp.where(kind == REVOLUTE or kind == PRISMATIC, 1, 0))

    @wp.func
    def mass_matrix(tree: Tree, par: Values, motion: Motion, links: Links, solve: Solve, k: int, e: int):
        """Rows of the free velocities, and the residual without contact while these are as before the step.

        Written in the change of velocity: the difference of two momenta would lose digits.
        """
        h = tree.step
        for i in range(tree.unknowns):
            for j in range(tree.dofs):
                solve.matrix[e, i, j] = zero
        for back in range(tree.links):
            l = tree.links - 1 - back  # children have higher numbers: this composite is complete
            for c in range(velocities(tree.kind[l])):
                j = tree.first_v[l] + c
                row = tree.solved[j]
                s_turn = links.s_turn[e, j]
                s_move = links.s_move[e, j]
                if row >= 0:
                    bias = wp.dot(s_turn, links.torque[e, l]) + wp.dot(s_move, links.force[e, l])
                    spring = zero
                    if tree.q_of_v[j] >= 0:
                        spring = par.stiffness[e, j] * (par.rest[e, j] - motion.q[k, e, tree.q_of_v[j]])
                    solve.right[e, row] = h * (spring - bias)
                push = s_move * links.mass[e, l] + wp.cross(s_turn, links.first[e, l])
                twist = links.inertia[e, l] * s_turn + wp.cross(links.first[e, l], s_move)
                at = int(l)
                other = int(j)
                while other >= 0:  # this velocity and all before it on the way to the world
                    below = at
                    at = tree.link_of_v[other]
                    if at != below:
                        twist = twist + wp.cross(links.place[e, below] - links.place[e, at], push)
                    value = wp.dot(links.s_turn[e, other], twist) + wp.dot(links.s_move[e, other], push)
                    if row >= 0:
                        solve.matrix[e, row, other] = value
                    if tree.solved[other] >= 0:
                        solve.matrix[e, tree.solved[other], j] = value
                    other = tree.before[other]
            up = tree.parent[l]
            if up >= 0:  # the link becomes part of its parent
                r = links.place[e, l] - links.place[e, up]
                m = links.mass[e, l]
                first = links.first[e, l]
                rx = skew(r)
                fx = skew(first)
                rf = rx * fx
                links.inertia[e, up] = (
                    links.inertia[e, up] + links.inertia[e, l] - rf - wp.transpose(rf) - rx * rx * m
                )
                links.first[e, up] = links.first[e, up] + first + r * m
                links.mass[e, up] = links.mass[e, up] + m
                force = links.force[e, l]
                links.force[e, up] = links.force[e, up] + force
                links.torque[e, up] = links.torque[e, up] + links.torque[e, l] + wp.cross(r, force)
        for j in range(tree.dofs):
            row = tree.solved[j]
            if row >= 0:
                extra = h * par.damping[e, j]
                if tree.q_of_v[j] >= 0:
                    extra = extra + h * h * par.stiffness[e, j]
                v = motion.v[k, e, j]
                given = solve.right[e, row]
                solve.right[e, row] = wp.abs(given) + solve.matrix[e, row, j] * wp.abs(v)
                solve.matrix[e, row, j] = solve.matrix[e, row, j] + extra
                solve.linear[e, row] = extra * v - given
        for j in range(tree.dofs):
            if tree.action[j] >= 0:
                v = motion.action[k, e, tree.action[j]] - motion.v[k, e, j]
                for row in range(tree.unknowns):
                    solve.linear[e, row] = solve.linear[e, row] + solve.matrix[e, row, j] * v

    return SimpleNamespace(
        skew=skew,
        about_axis=about_axis,
        velocities=velocities,
        integrate=integrate,
        kinematics=kinematics,
        mass_matrix=mass_matrix,
    )
