"""Encoder readings and the described control law of one joint at one step."""

from __future__ import annotations

import warp as wp

from samrl_core.diagnosis.simulation.kernels.kernel_slots import (
    ENCODER_WAVE,
    L_COMMAND_STEP,
    L_DEAD_BAND,
    L_INTEGRAL,
    L_POLE_PITCH,
    L_PUNCH,
    L_VELOCITY_INTEGRAL,
    L_VELOCITY_LAG,
    L_VELOCITY_SHARE,
    ONE,
    P_COMMAND_DELAY,
    P_DAMPING_SCALE,
    P_DEAD_BAND,
    P_ENCODER_AMPLITUDE,
    P_ENCODER_OFFSET,
    P_ENCODER_PHASE,
    P_ENCODER_RESOLUTION,
    P_STIFFNESS_SCALE,
    QUANTISED,
    READ_LINK,
    S_DAMPED_V,
    S_HYSTERESIS,
    S_INTEGRAL,
    S_Q,
    S_QM,
    S_V,
    S_VM,
    ZERO,
)
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, f64


@wp.func
def past(series: wp.array2d(dtype=f64), k: int, j: int, delay: f64):
    """A command `delay` steps before step k, between samples linearly; the first value before the start."""
    whole = int(wp.floor(delay))
    share = delay - f64(whole)
    new = series[wp.max(k - whole, 0), j]
    old = series[wp.max(k - whole - 1, 0), j]
    return new + (old - new) * share


@wp.func
def measure(a: Arrays, b: int, k: int):
    """Reading of the encoders at step k into `measured_q` and `measured_v`, and what the law damps of it.

    Differences, low-passed, are late by the time constant: alpha = h / (h + lag) has just that delay.
    """
    slot = k % a.slots
    for j in range(a.mount, a.joints):
        flags = a.flags[b, j]
        if a.logged == 1:
            a.measured_q[b, j] = a.log_q[k, j - a.mount]
            a.measured_v[b, j] = a.log_v[k, j - a.mount]
            a.damped_v[b, j] = a.log_v[k, j - a.mount]
        else:
            q = a.state[slot, b, j, S_QM] + a.state[slot, b, j, S_HYSTERESIS]
            v = a.state[slot, b, j, S_VM]
            if (flags & READ_LINK) != 0:
                q = a.state[slot, b, j, S_Q]
                v = a.state[slot, b, j, S_V]
            true_q = q
            q = q + a.params[b, j, P_ENCODER_OFFSET]
            if (flags & ENCODER_WAVE) != 0:
                amplitude = a.params[b, j, P_ENCODER_AMPLITUDE]
                angle = true_q + a.params[b, j, P_ENCODER_PHASE]
                q = q + amplitude * wp.sin(angle)
                v = v * (ONE + amplitude * wp.cos(angle))
            if (flags & QUANTISED) != 0:
                resolution = a.params[b, j, P_ENCODER_RESOLUTION]
                q = resolution * wp.round(q / resolution)
            a.measured_q[b, j] = q
            a.measured_v[b, j] = v
            reported = v
            late = a.law[j - a.mount, L_VELOCITY_LAG]
            if late > ZERO:
                before = a.state[slot, b, j, S_DAMPED_V]
                reported = before + (v - before) * a.step / (a.step + late)
            a.damped_v[b, j] = reported


@wp.func
def control(a: Arrays, b: int, k: int, j: int, command_q: f64, command_v: f64):
    """The described law at the reading (`DriveLaw`), clipped, and the next integral."""
    i = j - a.mount
    on = a.enabled[wp.min(k, a.enabled.shape[0] - 1), i]
    step = a.law[i, L_COMMAND_STEP]
    goal = command_q
    if step > ZERO:
        goal = step * wp.round(command_q / step)
    off = goal - a.measured_q[b, j]
    band = a.law[i, L_DEAD_BAND] + a.params[b, j, P_DEAD_BAND]
    side = wp.sign(off)
    error = off
    if band + a.law[i, L_PUNCH] > ZERO:  # without them, an error of zero has a slope
        if wp.abs(off) <= band:
            side = ZERO
        error = wp.abs(side) * off - side * band
    lag = a.law[i, L_VELOCITY_SHARE] * command_v - a.damped_v[b, j]
    pull = a.stiffness[i] * error
    pitch = a.law[i, L_POLE_PITCH]
    if pitch > ZERO:
        pull = a.stiffness[i] / pitch * wp.sin(pitch * error)
    spring = a.params[b, j, P_STIFFNESS_SCALE] * pull + a.law[i, L_PUNCH] * side
    damper = a.params[b, j, P_DAMPING_SCALE] * a.damping[i] * lag
    u = spring + damper + past(a.command_u, k, i, a.params[b, j, P_COMMAND_DELAY])
    if a.compensate == 1:
        u = u + a.held[b, j]
    # an integral stands still while the output is clipped and it would drive it further
    held = a.state[k % a.slots, b, j, S_INTEGRAL]
    gain = ONE
    if a.cascaded == 1:  # the stiffness is the position gain times the velocity gain
        gain = a.params[b, j, P_STIFFNESS_SCALE] / wp.max(a.params[b, j, P_DAMPING_SCALE], f64(1e-6))
    wind = gain * a.law[i, L_INTEGRAL] * error + a.law[i, L_VELOCITY_INTEGRAL] * lag
    wind = wind * a.step * f64(a.substeps)
    raw = u + held + wind
    if wp.abs(raw) <= a.limit[i] or raw * wind < ZERO:
        held = held + wind
    held = held * on
    return wp.vec2d(on * wp.clamp(u + held, -a.limit[i], a.limit[i]), held)
