"""One step backwards: Warp's adjoints of the drive and of the update, and the rigid-body solution by hand.

The solution ddq of (M + E) ddq = tau - bias is differentiated implicitly: with lambda = (M + E)^-1 g, a
loss with gradient g in ddq has gradient lambda in tau, -lambda ddq in E, and in all else the gradient of
-lambda . ID(q, dq, ddq), a scalar that one outward pass computes.
"""

from __future__ import annotations

import warp as wp

from samrl_core.diagnosis.simulation.kernels.drive_kernels import before_solve, update
from samrl_core.diagnosis.simulation.kernels.rigid_kernels import (
    RigidMotion,
    back_substitute,
    solve,
    virtual_power,
)
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, Bodies, H, f64

TAU = wp.constant(int(H.TAU))
ADDED = wp.constant(int(H.ADDED))
OUTSIDE = wp.constant(int(H.OUTSIDE))


@wp.kernel(enable_backward=False)
def repeat_kernel(a: Arrays, s: Bodies, m: RigidMotion, k: int):
    """Everything of step k up to its accelerations once more, for what one step keeps in memory."""
    b = wp.tid()
    before_solve(a, b, k)
    solve(a, s, b, k % a.slots)
    for j in range(a.joints):
        m.acceleration[b, j] = a.acceleration[b, j]


@wp.kernel
def before_kernel(a: Arrays, k: int):
    """Reading, controller and drives."""
    before_solve(a, wp.tid(), k)


@wp.kernel
def update_kernel(a: Arrays, k: int):
    """Next state and records."""
    update(a, wp.tid(), k)


@wp.kernel(enable_backward=False)
def lambda_kernel(
    a: Arrays,
    s: Bodies,
    m: RigidMotion,
    acceleration_grad: wp.array2d(dtype=f64),
    hand_grad: wp.array3d(dtype=f64),
    power_grad: wp.array(dtype=f64),
):
    """The implicit derivative: lambda into `direction`, and the gradients of torque and added inertia."""
    b = wp.tid()
    for j in range(a.joints):
        m.direction[b, j] = acceleration_grad[b, j]
        acceleration_grad[b, j] = f64(0.0)
    back_substitute(s, a.joints, b, m.direction)
    for j in range(a.joints):
        y = m.direction[b, j]
        hand_grad[b, j, TAU] = hand_grad[b, j, TAU] + y
        hand_grad[b, j, OUTSIDE] = hand_grad[b, j, OUTSIDE] + y
        hand_grad[b, j, ADDED] = hand_grad[b, j, ADDED] - y * a.acceleration[b, j]
    power_grad[b] = f64(1.0)


@wp.kernel
def power_kernel(a: Arrays, m: RigidMotion, k: int):
    """Minus the virtual power of the inverse dynamics."""
    virtual_power(a, m, wp.tid(), k % a.slots)
