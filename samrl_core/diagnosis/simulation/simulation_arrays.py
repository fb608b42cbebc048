"""Memory of the simulator: slots of the parameter, state and hand-over vectors, and their arrays."""

from __future__ import annotations

import enum

import warp as wp

f64 = wp.float64
Vec3 = wp.vec3d
Mat3 = wp.mat33d


class P(enum.IntEnum):
    """Slots of `params` (plant, joint, slot): what the kernels read per joint, delays in steps."""

    ENCODER_OFFSET = 0  # [rad]
    ENCODER_AMPLITUDE = 1  # [rad]
    ENCODER_PHASE = 2  # [rad]
    ENCODER_RESOLUTION = 3  # [rad]
    STIFFNESS_SCALE = 4
    DAMPING_SCALE = 5
    COMMAND_DELAY = 6  # [steps]
    COMMAND_ALPHA = 7  # share of the new value in the low-pass
    EFFORT_DELAY = 8  # [steps]
    EFFORT_ALPHA = 9
    HOLD_PROBABILITY = 10
    EFFORT_RATE_LIMIT = 11  # [N m/s]
    EFFORT_LIMIT = 12  # [N m]
    ACTUATOR_GAIN = 13
    COULOMB = 14
    COULOMB_VELOCITY = 15
    VISCOUS = 16
    STRIBECK_DROP = 17
    STRIBECK_VELOCITY = 18
    LOAD_FRICTION = 19
    FRICTION_ASYMMETRY = 20
    PRESLIDING_STIFFNESS = 21
    HARMONIC_AMPLITUDE = 22
    HARMONIC_ORDER = 23
    HARMONIC_PHASE = 24
    FRICTION_HARMONIC_AMPLITUDE = 25
    FRICTION_HARMONIC_ORDER = 26
    FRICTION_HARMONIC_PHASE = 27
    THERMAL_RATIO = 28
    THERMAL_TIME = 29
    THERMAL_OFFSET = 30  # [s]
    TORQUE_OFFSET = 31
    BACKLASH = 32
    JOINT_STIFFNESS = 33
    JOINT_DAMPING = 34
    HYSTERESIS_AMPLITUDE = 35
    HYSTERESIS_TORQUE = 36
    ROTOR_INERTIA = 37  # nominal armature included [kg m2]
    SENSOR_GAIN = 38
    SENSOR_BIAS = 39
    SENSOR_DRIFT = 40
    CABLE_STIFFNESS = 41
    CABLE_REST = 42
    CABLE_FRICTION = 43
    DEAD_BAND = 44  # beyond the described one [rad]
    BACK_EMF = 45  # beyond the described one [N m s/rad]
    STRIBECK_EXPONENT = 46


class S(enum.IntEnum):
    """Slots of `state` (time slot, plant, joint, slot)."""

    Q = 0  # link position [rad or m]
    V = 1  # link velocity
    QM = 2  # motor position; the link's where the joint is rigid
    VM = 3  # motor velocity
    COMMAND_Q = 4  # low-passed command
    COMMAND_V = 5
    RECEIVED = 6  # effort that reached the drive
    SMOOTH = 7  # the same after its low-pass
    RATE = 8  # the same after the rate limit
    LINK_TORQUE = 9  # link-side torque of the step before
    REST = 10  # torque that held against the motor in the step before
    BRISTLE = 11  # presliding deflection [rad]
    HYSTERESIS = 12  # hysteretic deflection of the reading [rad]
    CABLE = 13  # share of the cable's friction in force, -1..1
    INTEGRAL = 14  # of the controller [N m]
    DAMPED_V = 15  # velocity as the law read it in the step before


class H(enum.IntEnum):
    """Slots of `hand` (plant, joint, slot): what a step hands from the drive to its update."""

    TAU = 0  # torque on the joint at the present velocity [N m]
    ADDED = 1  # added to the diagonal of the mass matrix [kg m2]
    OUTSIDE = 2  # torque on the link from outside the transmission: the cable [N m]
    COMMAND_Q = 3
    COMMAND_V = 4
    RECEIVED = 5
    SMOOTH = 6
    RATE = 7
    MOTOR_CONSTANT = 8  # next motor velocity = MOTOR_CONSTANT + MOTOR_FOLLOWS x next link velocity
    MOTOR_FOLLOWS = 9
    REST_CONSTANT = 10  # torque that holds against a rigid joint's motor = constant + slope x acceleration
    REST_SLOPE = 11
    BRISTLE_CONSTANT = 12  # next bristle = constant + slope x next motor velocity
    BRISTLE_SLOPE = 13
    CABLE = 14
    INTEGRAL = 15


class L(enum.IntEnum):
    """Slots of `law` (joint, slot): the numbers of `DriveLaw`."""

    VELOCITY_SHARE = 0
    INTEGRAL = 1
    VELOCITY_INTEGRAL = 2
    DEAD_BAND = 3
    PUNCH = 4
    COMMAND_STEP = 5
    POLE_PITCH = 6
    BACK_EMF = 7
    VELOCITY_LAG = 8


class F(enum.IntFlag):
    """Bits of `flags` (plant, joint): which parts of the chain are there or worth computing."""

    PASSIVE = 1  # a joint of the mount: no drive
    ELASTIC = 2
    BRISTLE = 4
    READ_LINK = 8
    QUANTISED = 16
    ENCODER_WAVE = 32
    FRICTION = 64
    STRIBECK = 128
    FRICTION_WAVE = 256
    THERMAL = 512
    TORQUE_WAVE = 1024
    HYSTERESIS = 2048
    CABLE = 4096
    HOLD = 8192
    DELAYED = 16384  # an effort delay
    QUASI = 32768  # elastic, but with too little rotor to move apart from its link


@wp.struct
class Arrays:
    """Everything that a thread, one plant, reads and writes, but for the bodies."""

    # the tree: joints of the mount first, parents before children
    joints: int
    mount: int
    parent: wp.array(dtype=int)
    rotation: wp.array(dtype=Mat3)  # of the joint's frame in its parent's
    origin: wp.array(dtype=Vec3)
    axis: wp.array(dtype=Vec3)
    prismatic: wp.array(dtype=int)
    # the controller
    step: f64  # [s]
    substeps: int
    compensate: int
    nominal_gravity: Vec3
    nominal_inertia: wp.array2d(dtype=f64)  # (joint, 10)
    stiffness: wp.array(dtype=f64)
    damping: wp.array(dtype=f64)
    limit: wp.array(dtype=f64)
    law: wp.array2d(dtype=f64)  # (joint, slot)
    enabled: wp.array2d(dtype=f64)  # (time, joint), or one row where torque is never switched
    cascaded: int  # the position gain scales the integral of the position error too
    braked: int  # switched off, the back-EMF goes on acting
    inertia_hint: wp.array(
        dtype=f64
    )  # of the link alone as the joint feels it; choices of the integrator only
    # the command at every step (time, joint), and a log that replaces the reading where there is one
    command_q: wp.array2d(dtype=f64)
    command_v: wp.array2d(dtype=f64)
    command_u: wp.array2d(dtype=f64)
    logged: int
    log_q: wp.array2d(dtype=f64)
    log_v: wp.array2d(dtype=f64)
    # the plants
    seed: wp.array(dtype=int)
    flags: wp.array2d(dtype=int)
    params: wp.array3d(dtype=f64)
    inertia: wp.array3d(dtype=f64)  # (plant, joint, 10)
    gravity: wp.array(dtype=Vec3)
    # time: a ring of `slots`, long enough for the longest delay, or all of it for gradients
    slots: int
    state: wp.array4d(dtype=f64)
    effort: wp.array3d(dtype=f64)  # (time slot, plant, joint) commanded effort
    # one step
    measured_q: wp.array2d(dtype=f64)
    measured_v: wp.array2d(dtype=f64)
    damped_v: wp.array2d(dtype=f64)  # the same as the law's low-pass reports it
    held: wp.array2d(dtype=f64)  # nominal gravity torque at the reading
    hand: wp.array3d(dtype=f64)
    acceleration: wp.array2d(dtype=f64)
    # bodies, for the controller's gravity torque
    g_rotation: wp.array2d(dtype=Mat3)
    g_origin: wp.array2d(dtype=Vec3)
    g_mass: wp.array2d(dtype=f64)
    g_moment: wp.array2d(dtype=Vec3)
    # records
    every: int
    shift: int  # efforts are recorded this many steps after the state that they act on
    out_q: wp.array3d(dtype=f64)  # (plant, record, joint)
    out_v: wp.array3d(dtype=f64)
    out_u: wp.array3d(dtype=f64)
    out_t: wp.array3d(dtype=f64)


@wp.struct
class Bodies:
    """World-frame quantities per (plant, joint), all about the world's origin."""

    rotation: wp.array2d(dtype=Mat3)
    origin: wp.array2d(dtype=Vec3)
    w: wp.array2d(dtype=Vec3)
    v: wp.array2d(dtype=Vec3)
    aw: wp.array2d(dtype=Vec3)
    av: wp.array2d(dtype=Vec3)
    sw: wp.array2d(dtype=Vec3)
    sv: wp.array2d(dtype=Vec3)
    fw: wp.array2d(dtype=Vec3)
    fv: wp.array2d(dtype=Vec3)
    mass: wp.array2d(dtype=f64)
    moment: wp.array2d(dtype=Vec3)
    inertia: wp.array2d(dtype=Mat3)
    matrix: wp.array3d(dtype=f64)  # mass matrix, then its Cholesky factor
