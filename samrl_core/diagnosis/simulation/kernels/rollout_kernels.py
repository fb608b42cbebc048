"""The forward loop over time, one thread per plant; compiled without adjoints."""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.diagnosis.simulation.kernels.drive_kernels import before_solve, diverged, update
from samrl_core.diagnosis.simulation.kernels.rigid_kernels import bias_and_matrix, solve
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, Bodies, f64

wp.set_module_options({"enable_backward": False})


@wp.kernel(enable_backward=False)
def bias_kernel(a: Arrays, s: Bodies, bias: wp.array2d(dtype=f64)):
    """Torque of gravity and motion at the first state."""
    b = wp.tid()
    bias_and_matrix(a, s, b, 0)
    for j in range(a.joints):
        bias[b, j] = -a.acceleration[b, j]


@wp.kernel(enable_backward=False)
def rollout_kernel(a: Arrays, s: Bodies, steps: int, failed: wp.array2d(dtype=int)):
    """Every step of one plant; its first step and joint without a usable number, if any."""
    b = wp.tid()
    k = int(0)
    while k < steps:
        before_solve(a, b, k)
        solve(a, s, b, k % a.slots)
        update(a, b, k)
        bad = diverged(a, b, k)
        if bad >= 0:
            failed[b, 0] = k
            failed[b, 1] = bad
            k = steps
        k += 1
