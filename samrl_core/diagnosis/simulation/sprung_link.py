"""A link hung on its motor by a spring behind a gap: one oscillator along a known motor motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from samrl_core.common.warp_runtime import start as start_warp


@wp.kernel(enable_backward=False, module="unique")
def _swing(
    torque: wp.array(dtype=wp.float64),
    mass: wp.array(dtype=wp.float64),
    stiffness: wp.float64,
    damping: wp.float64,
    gap: wp.float64,
    h: wp.float64,
    first: wp.float64,
    out: wp.array(dtype=wp.float64),
):
    zero = wp.float64(0.0)
    angle = first / stiffness - gap
    if first > zero:
        angle = first / stiffness + gap
    speed = zero
    for i in range(torque.shape[0]):
        ahead = angle + h * speed
        k = zero
        d = zero
        rest = zero
        if ahead > gap:
            k = stiffness
            d = damping
            rest = gap
        if ahead < -gap:
            k = stiffness
            d = damping
            rest = -gap
        m = mass[i]
        one = wp.float64(1.0)
        speed = (speed + h * (torque[i] - k * (angle - rest)) / m) / (one + h * d / m + h * h * k / m)
        angle = angle + h * speed
        out[i] = angle


def sprung_link(
    torque: np.ndarray,
    inertia: np.ndarray,
    stiffness: float,
    damping: float,
    gap: float,
    period_s: float,
    first: float | None = None,
) -> np.ndarray:
    """Deflection (F,) [rad] under the torque (F,) [N m] that following rigidly would take.

    M d2delta/dt2 = torque - K dz(delta) - D ddelta/dt, with dz the dead zone of half width `gap` [rad], M the
    link's inertia (F,) [kg m2]. It begins at rest under the torque `first` [N m], by default the first of
    all; a wrong one swings for long. Implicit Euler: a spring too stiff for the sampling just follows.
    """
    start_warp()
    start = float(torque[0]) if first is None else first
    arrays: list[Any] = [
        wp.from_numpy(np.ascontiguousarray(x, dtype=np.float64), device="cpu") for x in (torque, inertia)
    ]
    out = wp.zeros(len(torque), dtype=wp.float64, device="cpu")
    wp.launch(
        _swing, 1, inputs=[*arrays, stiffness, damping, gap, period_s, start], outputs=[out], device="cpu"
    )
    return out.numpy()
