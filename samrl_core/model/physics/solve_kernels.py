"""Dense factorisation and Newton's method for the velocity after a step, one thread per environment."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from samrl_core.model.physics.distance_kernels import distance_functions
from samrl_core.model.physics.kernel_types import types

CHOLESKY = wp.constant(-1)  # in the first pivot: the factor is symmetric


@cache
def solve_functions(double: bool) -> SimpleNamespace:
    """Functions of one precision: factors, solves, and the contacts' share of residual and slope."""
    t = types(double)
    real = t.real
    Tree, Touch, Values, Solve = t.Tree, t.Touch, t.Values, t.Solve
    d = distance_functions(double)
    ramp, ramp_slope, impulse = d.ramp, d.ramp_slope, d.impulse
    zero, one = real(0.0), real(1.0)

    @wp.func
    def factorise_symmetric(s: Solve, k: int, e: int, n: int):
        """A = L L^T in place, four rows at a time: four sums that do not wait for each other."""
        f = s.factor[k, e]
        for block in range(n // 4):
            j = 4 * block
            for c in range(j + 4):
                t0 = f[j, c]
                t1 = f[j + 1, c]
                t2 = f[j + 2, c]
                t3 = f[j + 3, c]
                for i in range(c):
                    x = f[c, i]
                    t0 -= f[j, i] * x
                    t1 -= f[j + 1, i] * x
                    t2 -= f[j + 2, i] * x
                    t3 -= f[j + 3, i] * x
                if c < j:
                    inverse = one / f[c, c]
                    f[j, c] = t0 * inverse
                    f[j + 1, c] = t1 * inverse
                    f[j + 2, c] = t2 * inverse
                    f[j + 3, c] = t3 * inverse
                elif c == j:
                    root = wp.sqrt(t0)
                    f[j, c] = root
                    f[j + 1, c] = t1 / root
                    f[j + 2, c] = t2 / root
                    f[j + 3, c] = t3 / root
                elif c == j + 1:
                    root = wp.sqrt(t1)
                    f[j + 1, c] = root
                    f[j + 2, c] = t2 / root
                    f[j + 3, c] = t3 / root
                elif c == j + 2:
                    root = wp.sqrt(t2)
                    f[j + 2, c] = root
                    f[j + 3, c] = t3 / root
                else:
                    f[j + 3, c] = wp.sqrt(t3)
        for j in range(4 * (n // 4), n):
            for c in range(j):
                total = f[j, c]
                for i in range(c):
                    total -= f[j, i] * f[c, i]
                f[j, c] = total / f[c, c]
            total = f[j, j]
            for i in range(j):
                total -= f[j, i] * f[j, i]
            f[j, j] = wp.sqrt(total)
        s.pivot[k, e, 0] = CHOLESKY

    @wp.func
    def factorise(s: Solve, k: int, e: int, n: int):
        """P A = L U in place, with row pivots: friction makes the matrix unsymmetric."""
        f = s.factor[k, e]
        for c in range(n):
            best = int(c)
            for i in range(c + 1, n):
                if wp.abs(f[i, c]) > wp.abs(f[best, c]):
                    best = i
            s.pivot[k, e, c] = best
            if best != c:
                for j in range(n):
                    kept = f[c, j]
                    f[c, j] = f[best, j]
                    f[best, j] = kept
            inverse = one / f[c, c]
            for i in range(c + 1, n):
                share = f[i, c] * inverse
                f[i, c] = share
                if share != zero:
                    for j in range(c + 1, n):
                        f[i, j] = f[i, j] - share * f[c, j]

    @wp.func
    def solve(s: Solve, k: int, e: int, n: int):
        """Solves in place for `change`."""
        f = s.factor[k, e]
        x = s.change[e]
        if s.pivot[k, e, 0] == CHOLESKY:
            solve_symmetric(s, k, e, n)
        else:
            for c in range(n):
                p = s.pivot[k, e, c]
                kept = x[p]
                x[p] = x[c]
                x[c] = kept
            for i in range(n):
                total = x[i]
                for j in range(i):
                    total -= f[i, j] * x[j]
                x[i] = total
            for back in range(n):
                i = n - 1 - back
                total = x[i]
                for j in range(i + 1, n):
                    total -= f[i, j] * x[j]
                x[i] = total / f[i, i]

    @wp.func
    def solve_symmetric(s: Solve, k: int, e: int, n: int):
        f = s.factor[k, e]
        x = s.change[e]
        for i in range(n):
            total = x[i]
            for j in range(i):
                total -= f[i, j] * x[j]
            x[i] = total / f[i, i]
        for back in range(n):
            i = n - 1 - back
            value = x[i] / f[i, i]
            x[i] = value
            for j in range(i):
                x[j] = x[j] - f[i, j] * value

    @wp.func
    def solve_transposed(s: Solve, k: int, e: int, n: int):
        """Solves the transposed system in place for `change`."""
        f = s.factor[k, e]
        x = s.change[e]
        if s.pivot[k, e, 0] == CHOLESKY:
            solve_symmetric(s, k, e, n)
        else:
            for i in range(n):
                total = x[i]
                for j in range(i):
                    total -= f[j, i] * x[j]
                x[i] = total / f[i, i]
            for back in range(n):
                i = n - 1 - back
                total = x[i]
                for j in range(i + 1, n):
                    total -= f[j, i] * x[j]
                x[i] = total
            for back in range(n):
                c = n - 1 - back
                p = s.pivot[k, e, c]
                kept = x[p]
                x[p] = x[c]
                x[c] = kept

    @wp.func
    def contact_residual(tree: Tree, touch: Touch, par: Values, s: Solve, k: int, e: int, share: real):
        """`residual` at a share of `change`, and `size`, the impulses added without sign."""
        for i in range(tree.unknowns):
            s.residual[e, i] = s.linear[e, i] + share * s.pushed[e, i]
            s.size[e, i] = zero
        for a in range(s.active_count[k, e]):
            c = s.active[k, e, a]
            p = touch.pair[c]
            f = impulse(
                s.gap[e, a],
                s.normal[e, a],
                s.slip[e, a] + s.slip_change[e, a] * share,
                par.contact_stiffness[e, p],
                par.dissipation[e, p],
                par.friction[e, p],
                tree.step,
                touch.slip_speed,
                touch.softness,
            )
            if wp.dot(f, f) > zero:
                for j in range(tree.dofs):
                    i = tree.solved[j]
                    if i >= 0:
                        part = wp.dot(s.jacobian[e, a, j], f)
                        s.residual[e, i] = s.residual[e, i] - part
                        s.size[e, i] = s.size[e, i] + wp.abs(part)

    @wp.func
    def contact_slope(tree: Tree, touch: Touch, par: Values, s: Solve, k: int, e: int):
        """Adds the contacts' part of the residual's derivative to `factor`."""
        f = s.factor[k, e]
        h = tree.step
        for a in range(s.active_count[k, e]):
            p = touch.pair[s.active[k, e, a]]
            n = s.normal[e, a]
            u = s.slip[e, a]
            un = wp.dot(n, u)
            ut = u - n * un
            depth = -s.gap[e, a] - h * un
            stiff = h * par.contact_stiffness[e, p]
            damp = one - par.dissipation[e, p] * un
            press = stiff * ramp(depth, touch.softness) * ramp(damp, real(0.1))
            if press > zero:
                slope = -stiff * (
                    h * ramp_slope(depth, touch.softness) * ramp(damp, real(0.1))
                    + par.dissipation[e, p] * ramp(depth, touch.softness) * ramp_slope(damp, real(0.1))
                )
                speed = wp.sqrt(wp.dot(ut, ut) + touch.slip_speed * touch.slip_speed)
                mu = par.friction[e, p]
                hold = mu * press / speed
                g = (
                    wp.outer(n - ut * (mu / speed), n) * slope
                    - (wp.identity(n=3, dtype=real) - wp.outer(n, n)) * hold
                    + wp.outer(ut, ut) * (hold / (speed * speed))
                )
                for j in range(tree.dofs):
                    col = tree.solved[j]
                    if col >= 0:
                        gj = g * s.jacobian[e, a, j]
                        if wp.dot(gj, gj) > zero:
                            for i in range(tree.dofs):
                                row = tree.solved[i]
                                if row >= 0:
                                    f[row, col] = f[row, col] - wp.dot(s.jacobian[e, a, i], gj)

    return SimpleNamespace(
        factorise=factorise,
        factorise_symmetric=factorise_symmetric,
        solve=solve,
        solve_transposed=solve_transposed,
        contact_residual=contact_residual,
        contact_slope=contact_slope,
    )
