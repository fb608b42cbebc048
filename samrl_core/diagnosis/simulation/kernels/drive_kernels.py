"""The chain between command and link for one joint at one step: reading, controller, drive, friction, gear.

Friction and springs are implicit in the next velocity: a drive's law is linearised at a predicted next
velocity, and the slope joins the diagonal of the mass matrix. So a joint that is held by friction stands
still, however light its link is.
"""
# ruff: noqa: UP018, RUF046  (Warp: only float(...) and int(...) may change in a loop, a bare literal may not)

from __future__ import annotations

import warp as wp

from samrl_core.diagnosis.simulation.kernels.control_kernels import control, measure, past
from samrl_core.diagnosis.simulation.kernels.friction_kernels import friction, spring_blend
from samrl_core.diagnosis.simulation.kernels.kernel_slots import (
    BRISTLED,
    CABLE_SLIP,
    CABLED,
    DELAYED,
    ELASTIC,
    FRICTION,
    H_ADDED,
    H_BRISTLE_CONSTANT,
    H_BRISTLE_SLOPE,
    H_CABLE,
    H_COMMAND_Q,
    H_COMMAND_V,
    H_INTEGRAL,
    H_MOTOR_CONSTANT,
    H_MOTOR_FOLLOWS,
    H_OUTSIDE,
    H_RATE,
    H_RECEIVED,
    H_REST_CONSTANT,
    H_REST_SLOPE,
    H_SMOOTH,
    H_TAU,
    HOLDING,
    HYSTERETIC,
    L_BACK_EMF,
    L_POLE_PITCH,
    ONE,
    P_ACTUATOR_GAIN,
    P_BACK_EMF,
    P_BACKLASH,
    P_CABLE_FRICTION,
    P_CABLE_REST,
    P_CABLE_STIFFNESS,
    P_COMMAND_ALPHA,
    P_COMMAND_DELAY,
    P_EFFORT_ALPHA,
    P_EFFORT_DELAY,
    P_EFFORT_LIMIT,
    P_EFFORT_RATE_LIMIT,
    P_HARMONIC_AMPLITUDE,
    P_HARMONIC_ORDER,
    P_HARMONIC_PHASE,
    P_HOLD_PROBABILITY,
    P_HYSTERESIS_AMPLITUDE,
    P_HYSTERESIS_TORQUE,
    P_JOINT_DAMPING,
    P_JOINT_STIFFNESS,
    P_ROTOR_INERTIA,
    P_SENSOR_BIAS,
    P_SENSOR_DRIFT,
    P_SENSOR_GAIN,
    P_TORQUE_OFFSET,
    PASSIVE,
    QUASI,
    RELAX,
    S_BRISTLE,
    S_CABLE,
    S_COMMAND_Q,
    S_COMMAND_V,
    S_DAMPED_V,
    S_HYSTERESIS,
    S_INTEGRAL,
    S_LINK_TORQUE,
    S_Q,
    S_QM,
    S_RATE,
    S_RECEIVED,
    S_REST,
    S_SMOOTH,
    S_V,
    S_VM,
    SHARP,
    TINY,
    TORQUE_WAVE,
    ZERO,
)
from samrl_core.diagnosis.simulation.kernels.rigid_kernels import gravity_torque
from samrl_core.diagnosis.simulation.simulation_arrays import Arrays, f64


@wp.func
def drive(a: Arrays, b: int, k: int):
    """From the reading at step k to the torque on each joint: commanded effort and `hand`."""
    h = a.step
    slot = k % a.slots
    # one draw a packet: all joints of an arm share it
    draw = f64(wp.randf(wp.rand_init(a.seed[b], k)))
    for j in range(a.joints):
        flags = a.flags[b, j]
        stiffness = a.params[b, j, P_JOINT_STIFFNESS]
        damping = a.params[b, j, P_JOINT_DAMPING]
        rotor = a.params[b, j, P_ROTOR_INERTIA]
        q = a.state[slot, b, j, S_Q]
        v = a.state[slot, b, j, S_V]
        hint = a.inertia_hint[j]
        if (flags & PASSIVE) != 0:
            c = damping + h * stiffness * spring_blend(stiffness, hint + rotor, h)
            a.hand[b, j, H_TAU] = -stiffness * q - c * v
            a.hand[b, j, H_ADDED] = rotor + h * c
            a.hand[b, j, H_OUTSIDE] = ZERO
        else:
            i = j - a.mount
            # command
            delay = a.params[b, j, P_COMMAND_DELAY]
            late_q = past(a.command_q, k, i, delay)
            late_v = past(a.command_v, k, i, delay)
            keep = ONE - a.params[b, j, P_COMMAND_ALPHA]
            command_q = late_q
            command_v = late_v
            if k > 0:
                command_q = late_q + keep * (a.state[slot, b, j, S_COMMAND_Q] - late_q)
                command_v = late_v + keep * (a.state[slot, b, j, S_COMMAND_V] - late_v)
            a.hand[b, j, H_COMMAND_Q] = command_q
            a.hand[b, j, H_COMMAND_V] = command_v
            # controller, at its own period; a stepper's field does not wait
            if k % a.substeps == 0 or a.law[i, L_POLE_PITCH] > ZERO:
                asked = control(a, b, k, j, command_q, command_v)
                a.effort[slot, b, j] = asked[0]
                a.hand[b, j, H_INTEGRAL] = asked[1]
            else:
                a.effort[slot, b, j] = a.effort[(k - 1) % a.slots, b, j]
                a.hand[b, j, H_INTEGRAL] = a.state[slot, b, j, S_INTEGRAL]
            u = a.effort[slot, b, j]
            # the way to the drive
            if (flags & DELAYED) != 0:
                late = a.params[b, j, P_EFFORT_DELAY]
                whole = int(wp.floor(late))
                share = late - f64(whole)
                new = a.effort[wp.max(k - whole, 0) % a.slots, b, j]
                old = a.effort[wp.max(k - whole - 1, 0) % a.slots, b, j]
                u = new + (old - new) * share
            if (flags & HOLDING) != 0:
                if k > 0 and draw < a.params[b, j, P_HOLD_PROBABILITY]:
                    u = a.state[slot, b, j, S_RECEIVED]
            a.hand[b, j, H_RECEIVED] = u
            rate = u
            if k > 0:
                u = u + (ONE - a.params[b, j, P_EFFORT_ALPHA]) * (a.state[slot, b, j, S_SMOOTH] - u)
                last = a.state[slot, b, j, S_RATE]
                most = a.params[b, j, P_EFFORT_RATE_LIMIT] * h
                rate = wp.clamp(u, last - most, last + most)
            a.hand[b, j, H_SMOOTH] = u
            a.hand[b, j, H_RATE] = rate
            most = a.params[b, j, P_EFFORT_LIMIT]
            torque = a.params[b, j, P_ACTUATOR_GAIN] * wp.clamp(rate, -most, most)
            powered = a.enabled[wp.min(k, a.enabled.shape[0] - 1), i]
            torque = powered * torque + a.params[b, j, P_TORQUE_OFFSET]
            if a.braked == 1:
                powered = ONE
            drag = powered * (a.law[i, L_BACK_EMF] + a.params[b, j, P_BACK_EMF])
            qm = a.state[slot, b, j, S_QM]
            vm = a.state[slot, b, j, S_VM]
            if (flags & TORQUE_WAVE) != 0:
                torque = torque + a.params[b, j, P_HARMONIC_AMPLITUDE] * wp.sin(
                    a.params[b, j, P_HARMONIC_ORDER] * qm + a.params[b, j, P_HARMONIC_PHASE]
                )
            # the gear, seen from the motor: a spring with a dead zone, or a rigid link
            wound = ZERO
            c = ZERO
            inertia = rotor + hint
            rest = a.state[slot, b, j, S_REST]
            if k == 0:
                rest = a.held[b, j]
            if (flags & ELASTIC) != 0:
                d = qm - q
                half = a.params[b, j, P_BACKLASH]
                wound = stiffness * d
                contact = ONE
                if half > ZERO:
                    corner = SHARP * half
                    beyond = wp.abs(d) - half
                    if beyond < -corner:
                        wound = ZERO
                        contact = ZERO
                    elif beyond < corner:
                        wound = (
                            stiffness
                            * (beyond + corner)
                            * (beyond + corner)
                            / (f64(4.0) * corner)
                            * wp.sign(d)
                        )
                        contact = (beyond + corner) / (f64(2.0) * corner)
                    else:
                        wound = stiffness * beyond * wp.sign(d)
                reduced = rotor * hint / (rotor + hint + TINY)
                c = contact * (damping + h * stiffness * spring_blend(stiffness, reduced, h))
                inertia = rotor + h * c + TINY
                rest = wound + c * (vm - v)
            free = (vm + h * (torque - rest) / inertia) / (ONE + h * drag / inertia)
            constant = ZERO
            slope = drag
            if (flags & FRICTION) != 0:
                law = friction(
                    a, b, k, j, vm, qm, a.state[slot, b, j, S_LINK_TORQUE], a.state[slot, b, j, S_BRISTLE],
                    free, inertia,
                )  # fmt: skip
                constant = law[0]
                slope = drag + law[1]
                a.hand[b, j, H_BRISTLE_CONSTANT] = law[2]
                a.hand[b, j, H_BRISTLE_SLOPE] = law[3]
            if (flags & ELASTIC) != 0:
                total = rotor / h + slope + c + TINY
                push = rotor / h * vm + torque - constant - wound
                g = c * (total - c) / total
                a.hand[b, j, H_TAU] = wound + c * push / total - g * v
                a.hand[b, j, H_ADDED] = h * g
                a.hand[b, j, H_MOTOR_CONSTANT] = push / total
                a.hand[b, j, H_MOTOR_FOLLOWS] = c / total
                a.hand[b, j, H_REST_CONSTANT] = ZERO
                a.hand[b, j, H_REST_SLOPE] = ZERO
            else:
                a.hand[b, j, H_TAU] = torque - constant - slope * v
                a.hand[b, j, H_ADDED] = rotor + h * slope
                a.hand[b, j, H_REST_CONSTANT] = torque - constant - slope * v
                a.hand[b, j, H_REST_SLOPE] = -(inertia + h * slope)
            # the cable pulls at the link
            outside = ZERO
            if (flags & CABLED) != 0:
                grip = a.state[slot, b, j, S_CABLE]
                grip = (grip + h * v / CABLE_SLIP) / (ONE + h * wp.abs(v) / CABLE_SLIP)
                a.hand[b, j, H_CABLE] = grip
                outside = -a.params[b, j, P_CABLE_STIFFNESS] * (q - a.params[b, j, P_CABLE_REST])
                outside = outside - a.params[b, j, P_CABLE_FRICTION] * grip
            a.hand[b, j, H_OUTSIDE] = outside


@wp.func
def update(a: Arrays, b: int, k: int):
    """State at step k + 1 from the accelerations, and what is recorded of step k."""
    h = a.step
    slot = k % a.slots
    after = (k + 1) % a.slots
    for j in range(a.joints):
        flags = a.flags[b, j]
        q = a.state[slot, b, j, S_Q]
        acceleration = a.acceleration[b, j]
        v = a.state[slot, b, j, S_V] + h * acceleration
        a.state[after, b, j, S_Q] = q + h * v
        a.state[after, b, j, S_V] = v
        if (flags & PASSIVE) == 0:
            through = a.hand[b, j, H_TAU] - a.hand[b, j, H_ADDED] * acceleration
            vm = v
            qm = q + h * v
            if (flags & QUASI) != 0:
                # a massless motor stands where the spring holds its torque
                stiffness = a.params[b, j, P_JOINT_STIFFNESS]
                half = a.params[b, j, P_BACKLASH]
                corner = SHARP * half * stiffness
                wound = through / stiffness
                wound = wound + half * through / wp.sqrt(through * through + corner * corner + TINY)
                ahead = a.state[slot, b, j, S_QM] - q
                qm = qm + ahead + RELAX * (wound - ahead)
            if (flags & ELASTIC) != 0:
                vm = a.hand[b, j, H_MOTOR_CONSTANT] + a.hand[b, j, H_MOTOR_FOLLOWS] * v
                qm = a.state[slot, b, j, S_QM] + h * vm
            a.state[after, b, j, S_QM] = qm
            a.state[after, b, j, S_VM] = vm
            a.state[after, b, j, S_COMMAND_Q] = a.hand[b, j, H_COMMAND_Q]
            a.state[after, b, j, S_COMMAND_V] = a.hand[b, j, H_COMMAND_V]
            a.state[after, b, j, S_INTEGRAL] = a.hand[b, j, H_INTEGRAL]
            a.state[after, b, j, S_DAMPED_V] = a.damped_v[b, j]
            a.state[after, b, j, S_RECEIVED] = a.hand[b, j, H_RECEIVED]
            a.state[after, b, j, S_SMOOTH] = a.hand[b, j, H_SMOOTH]
            a.state[after, b, j, S_RATE] = a.hand[b, j, H_RATE]
            a.state[after, b, j, S_LINK_TORQUE] = through
            a.state[after, b, j, S_REST] = (
                a.hand[b, j, H_REST_CONSTANT] + a.hand[b, j, H_REST_SLOPE] * acceleration
            )
            if (flags & BRISTLED) != 0:
                a.state[after, b, j, S_BRISTLE] = (
                    a.hand[b, j, H_BRISTLE_CONSTANT] + a.hand[b, j, H_BRISTLE_SLOPE] * vm
                )
            if (flags & CABLED) != 0:
                a.state[after, b, j, S_CABLE] = a.hand[b, j, H_CABLE]
            if (flags & HYSTERETIC) != 0:
                # P. Dahl's solid friction in torque instead of motion, integrated exactly
                change = through - a.state[slot, b, j, S_LINK_TORQUE]
                goal = a.params[b, j, P_HYSTERESIS_AMPLITUDE] * wp.sign(change)
                left = wp.exp(-wp.abs(change) / a.params[b, j, P_HYSTERESIS_TORQUE])
                a.state[after, b, j, S_HYSTERESIS] = goal + (a.state[slot, b, j, S_HYSTERESIS] - goal) * left
            i = j - a.mount
            if k % a.every == 0:
                a.out_q[b, k / a.every, i] = a.measured_q[b, j]
                a.out_v[b, k / a.every, i] = a.measured_v[b, j]
            if (k + a.shift) % a.every == 0 and (k + a.shift) / a.every < a.out_u.shape[1]:
                time = h * f64(k)
                reading = (ONE + a.params[b, j, P_SENSOR_GAIN]) * through
                reading = reading + a.params[b, j, P_SENSOR_BIAS] + a.params[b, j, P_SENSOR_DRIFT] * time
                a.out_u[b, (k + a.shift) / a.every, i] = a.effort[slot, b, j]
                a.out_t[b, (k + a.shift) / a.every, i] = reading


@wp.func
def diverged(a: Arrays, b: int, k: int):
    """Index of the joint that is fastest beyond all bounds, or first no number; else -1."""
    bad = int(-1)
    most = f64(1.0e4)
    after = (k + 1) % a.slots
    for j in range(a.joints):
        speed = wp.abs(a.state[after, b, j, S_V])
        if speed >= most:
            bad = j
            most = speed
        elif not (speed < most) and bad < 0:
            bad = j
    return bad


@wp.func
def before_solve(a: Arrays, b: int, k: int):
    """Reading, controller and drives of step k."""
    measure(a, b, k)
    gravity_torque(a, b)
    drive(a, b, k)
