"""The chain between command and link for one joint at one step: reading, controller, drive, friction, gear.

Friction and springs are implicit in the next velocity: a drive's law is linearised at a predicted next
velocity, and the slope joins the diagonal of the mass matrix. So a joint that is held by friction stands
still, however light its link is.
"""

from __future__ import annotations

import warp as wp

from samrl_core.dynamics.rigid_kernels import gravity_torque
from samrl_core.dynamics.simulation_arrays import Arrays, F, H, P, S, f64

ZERO = wp.constant(f64(0.0))
HALF = wp.constant(f64(0.5))
ONE = wp.constant(f64(1.0))
TINY = wp.constant(f64(1.0e-12))
CABLE_SLIP = wp.constant(f64(0.05))  # motion over which a cable's friction turns round [rad]. ASSUMPTION
SHARP = wp.constant(f64(0.1))  # rounding of the backlash's corners, as a share of its half width
RELAX = wp.constant(f64(1.0 / 3.0))  # share of its way that a massless motor goes in a step
SOFT = wp.constant(f64(16.0))  # springs above sqrt of this, in (step x natural frequency)^2, are damped

PASSIVE = wp.constant(int(F.PASSIVE))
ELASTIC = wp.constant(int(F.ELASTIC))
BRISTLED = wp.constant(int(F.BRISTLE))
READ_LINK = wp.constant(int(F.READ_LINK))
QUANTISED = wp.constant(int(F.QUANTISED))
ENCODER_WAVE = wp.constant(int(F.ENCODER_WAVE))
FRICTION = wp.constant(int(F.FRICTION))
STRIBECK = wp.constant(int(F.STRIBECK))
FRICTION_WAVE = wp.constant(int(F.FRICTION_WAVE))
THERMAL = wp.constant(int(F.THERMAL))
TORQUE_WAVE = wp.constant(int(F.TORQUE_WAVE))
HYSTERETIC = wp.constant(int(F.HYSTERESIS))
CABLED = wp.constant(int(F.CABLE))
HOLDING = wp.constant(int(F.HOLD))
DELAYED = wp.constant(int(F.DELAYED))
QUASI = wp.constant(int(F.QUASI))

P_ENCODER_OFFSET = wp.constant(int(P.ENCODER_OFFSET))
P_ENCODER_AMPLITUDE = wp.constant(int(P.ENCODER_AMPLITUDE))
P_ENCODER_PHASE = wp.constant(int(P.ENCODER_PHASE))
P_ENCODER_RESOLUTION = wp.constant(int(P.ENCODER_RESOLUTION))
P_STIFFNESS_SCALE = wp.constant(int(P.STIFFNESS_SCALE))
P_DAMPING_SCALE = wp.constant(int(P.DAMPING_SCALE))
P_COMMAND_DELAY = wp.constant(int(P.COMMAND_DELAY))
P_COMMAND_ALPHA = wp.constant(int(P.COMMAND_ALPHA))
P_EFFORT_DELAY = wp.constant(int(P.EFFORT_DELAY))
P_EFFORT_ALPHA = wp.constant(int(P.EFFORT_ALPHA))
P_HOLD_PROBABILITY = wp.constant(int(P.HOLD_PROBABILITY))
P_EFFORT_RATE_LIMIT = wp.constant(int(P.EFFORT_RATE_LIMIT))
P_EFFORT_LIMIT = wp.constant(int(P.EFFORT_LIMIT))
P_ACTUATOR_GAIN = wp.constant(int(P.ACTUATOR_GAIN))
P_COULOMB = wp.constant(int(P.COULOMB))
P_COULOMB_VELOCITY = wp.constant(int(P.COULOMB_VELOCITY))
P_VISCOUS = wp.constant(int(P.VISCOUS))
P_STRIBECK_DROP = wp.constant(int(P.STRIBECK_DROP))
P_STRIBECK_VELOCITY = wp.constant(int(P.STRIBECK_VELOCITY))
P_LOAD_FRICTION = wp.constant(int(P.LOAD_FRICTION))
P_FRICTION_ASYMMETRY = wp.constant(int(P.FRICTION_ASYMMETRY))
P_PRESLIDING_STIFFNESS = wp.constant(int(P.PRESLIDING_STIFFNESS))
P_HARMONIC_AMPLITUDE = wp.constant(int(P.HARMONIC_AMPLITUDE))
P_HARMONIC_ORDER = wp.constant(int(P.HARMONIC_ORDER))
P_HARMONIC_PHASE = wp.constant(int(P.HARMONIC_PHASE))
P_FRICTION_HARMONIC_AMPLITUDE = wp.constant(int(P.FRICTION_HARMONIC_AMPLITUDE))
P_FRICTION_HARMONIC_ORDER = wp.constant(int(P.FRICTION_HARMONIC_ORDER))
P_FRICTION_HARMONIC_PHASE = wp.constant(int(P.FRICTION_HARMONIC_PHASE))
P_THERMAL_RATIO = wp.constant(int(P.THERMAL_RATIO))
P_THERMAL_TIME = wp.constant(int(P.THERMAL_TIME))
P_THERMAL_OFFSET = wp.constant(int(P.THERMAL_OFFSET))
P_TORQUE_OFFSET = wp.constant(int(P.TORQUE_OFFSET))
P_BACKLASH = wp.constant(int(P.BACKLASH))
P_JOINT_STIFFNESS = wp.constant(int(P.JOINT_STIFFNESS))
P_JOINT_DAMPING = wp.constant(int(P.JOINT_DAMPING))
P_HYSTERESIS_AMPLITUDE = wp.constant(int(P.HYSTERESIS_AMPLITUDE))
P_HYSTERESIS_TORQUE = wp.constant(int(P.HYSTERESIS_TORQUE))
P_ROTOR_INERTIA = wp.constant(int(P.ROTOR_INERTIA))
P_SENSOR_GAIN = wp.constant(int(P.SENSOR_GAIN))
P_SENSOR_BIAS = wp.constant(int(P.SENSOR_BIAS))
P_SENSOR_DRIFT = wp.constant(int(P.SENSOR_DRIFT))
P_CABLE_STIFFNESS = wp.constant(int(P.CABLE_STIFFNESS))
P_CABLE_REST = wp.constant(int(P.CABLE_REST))
P_CABLE_FRICTION = wp.constant(int(P.CABLE_FRICTION))
S_Q = wp.constant(int(S.Q))
S_V = wp.constant(int(S.V))
S_QM = wp.constant(int(S.QM))
S_VM = wp.constant(int(S.VM))
S_COMMAND_Q = wp.constant(int(S.COMMAND_Q))
S_COMMAND_V = wp.constant(int(S.COMMAND_V))
S_RECEIVED = wp.constant(int(S.RECEIVED))
S_SMOOTH = wp.constant(int(S.SMOOTH))
S_RATE = wp.constant(int(S.RATE))
S_LINK_TORQUE = wp.constant(int(S.LINK_TORQUE))
S_REST = wp.constant(int(S.REST))
S_BRISTLE = wp.constant(int(S.BRISTLE))
S_HYSTERESIS = wp.constant(int(S.HYSTERESIS))
S_CABLE = wp.constant(int(S.CABLE))
H_TAU = wp.constant(int(H.TAU))
H_ADDED = wp.constant(int(H.ADDED))
H_OUTSIDE = wp.constant(int(H.OUTSIDE))
H_COMMAND_Q = wp.constant(int(H.COMMAND_Q))
H_COMMAND_V = wp.constant(int(H.COMMAND_V))
H_RECEIVED = wp.constant(int(H.RECEIVED))
H_SMOOTH = wp.constant(int(H.SMOOTH))
H_RATE = wp.constant(int(H.RATE))
H_MOTOR_CONSTANT = wp.constant(int(H.MOTOR_CONSTANT))
H_MOTOR_FOLLOWS = wp.constant(int(H.MOTOR_FOLLOWS))
H_REST_CONSTANT = wp.constant(int(H.REST_CONSTANT))
H_REST_SLOPE = wp.constant(int(H.REST_SLOPE))
H_BRISTLE_CONSTANT = wp.constant(int(H.BRISTLE_CONSTANT))
H_BRISTLE_SLOPE = wp.constant(int(H.BRISTLE_SLOPE))
H_CABLE = wp.constant(int(H.CABLE))


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
    """Reading of the encoders at step k into `measured_q` and `measured_v`."""
    slot = k % a.slots
    for j in range(a.mount, a.joints):
        flags = a.flags[b, j]
        if a.logged == 1:
            a.measured_q[b, j] = a.log_q[k, j - a.mount]
            a.measured_v[b, j] = a.log_v[k, j - a.mount]
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


@wp.func
def control(a: Arrays, b: int, k: int, j: int, command_q: f64, command_v: f64):
    """The described law at the reading: clip(K (q_d - q) + D (dq_d - dq) + g(q) + feed-forward)."""
    i = j - a.mount
    spring = a.params[b, j, P_STIFFNESS_SCALE] * a.stiffness[i] * (command_q - a.measured_q[b, j])
    damper = a.params[b, j, P_DAMPING_SCALE] * a.damping[i] * (command_v - a.measured_v[b, j])
    u = spring + damper + past(a.command_u, k, i, a.params[b, j, P_COMMAND_DELAY])
    if a.compensate == 1:
        u = u + a.held[b, j]
    return wp.clamp(u, -a.limit[i], a.limit[i])


@wp.func
def friction(
    a: Arrays, b: int, k: int, j: int, v: f64, q: f64, load: f64, bristle: f64, free: f64, inertia: f64
):
    """Friction as constant + slope x next velocity, and the next bristle in the same form.

    `free` is the next velocity were there no friction, `inertia` what the joint then feels.

    Level: Fc + drop exp(-(v / vs)^2) + Kl |load| + A sin(N q + phase), times the warm-up's factor.
    Dry: level tanh(v / vc) + asymmetry tanh^2(v / vc). Bristle: dz/dt = v - s0 |v| z / level, F = s0 z
    (C. Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995, with s1 = 0). Then viscous x v.
    """
    h = a.step
    flags = a.flags[b, j]
    warm = ONE
    if (flags & THERMAL) != 0:
        age = h * f64(k) + a.params[b, j, P_THERMAL_OFFSET]
        warm = ONE + a.params[b, j, P_THERMAL_RATIO] * wp.exp(-age / a.params[b, j, P_THERMAL_TIME])
    level = a.params[b, j, P_COULOMB] + a.params[b, j, P_LOAD_FRICTION] * wp.abs(load)
    if (flags & FRICTION_WAVE) != 0:
        level = level + a.params[b, j, P_FRICTION_HARMONIC_AMPLITUDE] * wp.sin(
            a.params[b, j, P_FRICTION_HARMONIC_ORDER] * q + a.params[b, j, P_FRICTION_HARMONIC_PHASE]
        )
    drop = a.params[b, j, P_STRIBECK_DROP]
    vs = a.params[b, j, P_STRIBECK_VELOCITY]
    vc = a.params[b, j, P_COULOMB_VELOCITY]
    # The next velocity under dry friction of this level, close enough to linearise there: `free` less
    # what friction takes, or creeping where it takes all.
    there = level
    if (flags & STRIBECK) != 0:
        there = there + drop * wp.exp(-v * v / (vs * vs))
    take = h * warm * wp.abs(there) / inertia
    beyond = wp.max(wp.abs(free) - take, ZERO)
    x = free / (ONE + take / wp.sqrt(vc * vc + beyond * beyond))
    if (flags & BRISTLED) != 0:
        x = v  # a bristle holds without creeping, so only motion that is there may wear it
    viscous = warm * a.params[b, j, P_VISCOUS]
    fall = ZERO
    if (flags & STRIBECK) != 0:
        lift = drop * wp.exp(-x * x / (vs * vs))
        level = level + lift
        fall = -f64(2.0) * x / (vs * vs) * lift
    s = wp.tanh(x / vc)
    steep = (ONE - s * s) / vc
    asymmetry = a.params[b, j, P_FRICTION_ASYMMETRY]
    constant = warm * asymmetry * s * s
    slope = viscous
    z_constant = ZERO
    z_slope = ZERO
    if (flags & BRISTLED) != 0:
        stiff = a.params[b, j, P_PRESLIDING_STIFFNESS]
        strength = wp.max(warm * level, ZERO)
        share = strength / (strength + h * stiff * wp.abs(x) + TINY)
        z_constant = share * bristle
        z_slope = share * h
        constant = constant + stiff * z_constant
        slope = slope + stiff * z_slope
    else:
        force = warm * (level * s + asymmetry * s * s)
        tangent = wp.max(warm * (level * steep + f64(2.0) * asymmetry * s * steep + fall * s), ZERO)
        constant = force - tangent * x
        slope = slope + tangent
    return wp.vec4d(constant, slope, z_constant, z_slope)


@wp.func
def spring_blend(stiffness: f64, inertia: f64, h: f64):
    """How implicit a spring is: 0 keeps a slow one undamped, 1 keeps one faster than the step stable."""
    x = h * h * stiffness / (inertia + TINY)
    return x * x / (x * x + SOFT)


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
            # controller, at its own period
            if k % a.substeps == 0:
                a.effort[slot, b, j] = control(a, b, k, j, command_q, command_v)
            else:
                a.effort[slot, b, j] = a.effort[(k - 1) % a.slots, b, j]
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
            torque = torque + a.params[b, j, P_TORQUE_OFFSET]
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
                        wound = stiffness * (beyond + corner) * (beyond + corner) / (f64(4.0) * corner) * wp.sign(d)
                        contact = (beyond + corner) / (f64(2.0) * corner)
                    else:
                        wound = stiffness * beyond * wp.sign(d)
                reduced = rotor * hint / (rotor + hint + TINY)
                c = contact * (damping + h * stiffness * spring_blend(stiffness, reduced, h))
                inertia = rotor + h * c + TINY
                rest = wound + c * (vm - v)
            free = vm + h * (torque - rest) / inertia
            constant = ZERO
            slope = ZERO
            if (flags & FRICTION) != 0:
                law = friction(
                    a, b, k, j, vm, qm, a.state[slot, b, j, S_LINK_TORQUE], a.state[slot, b, j, S_BRISTLE],
                    free, inertia,
                )  # fmt: skip
                constant = law[0]
                slope = law[1]
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
