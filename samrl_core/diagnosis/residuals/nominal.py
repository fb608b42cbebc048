"""What the nominal model itself leaves open: regressors of its tolerances, with their standard deviations.

Put into the likelihood as a low-rank covariance, so that a gap inside the tolerances is no gap, and an effect
is credited only with what tolerances cannot explain (Kennedy and O'Hagan 2001, in its linear form). The
regressors are evaluated along the measured motion, hence exact for any size of the effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.equations import (
    NOMINAL_SIGN,
    WALKS,
    Columns,
    integrated_terms,
    integrates,
)
from samrl_core.diagnosis.residuals.field_time import straight_time
from samrl_core.diagnosis.residuals.laws.control_law import WOUND
from samrl_core.diagnosis.residuals.laws.goal_phase import reading_time, tooth_rates
from samrl_core.diagnosis.residuals.laws.late_law import late_law_change
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise
from samrl_core.diagnosis.residuals.trial import Trial, add

CONTROLLER_GAIN = 0.003  # relative: rounding of published gains
FLOOR_WIDTHS = (0.0015, 0.003, 0.006, 0.012, 0.025, 0.05, 0.1)  # [rad/s] of the friction floor's sign
OF_A_WIDTH = 0.45  # of the tolerated friction, each: any one of them may be most of it
AHEAD_S = 0.009  # of stated friction: MuJoCo's default solreffriction of 0.02 s at impedance 0.9
COMPLIANCE = 1e-4  # [rad] twist at the effort limit: no joint is quite rigid
SPRING = 0.02  # relative, of a stated spring: as a rotor's inertia
OFFSET_TRACKING = 0.003  # [rad] calibration of a reading against a command


def tolerance_columns(trial: Trial, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations; the same list for every recording of an arm.

    `widened` times the stated tolerances.
    """
    return [(columns, std) for columns, std, _ in _tolerances(trial, widened)]


def friction_turns(trial: Trial) -> list[float | None]:
    """Of each of these columns: width [rad/s] of the tolerated friction's sign; None of all others."""
    return [turn for *_, turn in _tolerances(trial, 1.0)]


def _tolerances(trial: Trial, widened: float) -> list[tuple[Columns, float, float | None]]:
    out: list[tuple[Columns, float, float | None]] = []
    plausible = trial.recording.arm.tolerances
    motion, tolerances = trial.motion, plausible.scaled(widened * plausible.deviation)
    ones, joints = np.ones((1, len(motion.time))), range(trial.joints)
    flat = np.ones((1, len(trial)))
    if "tracking" in trial.channels:
        out += [(trial.tracking(j, flat), OFFSET_TRACKING, None) for j in joints]
        stamp = max(tolerances.stamp, 0.5 / motion.rate)
        for j in joints:
            out.append((trial.tracking(j, motion.derivative(motion.q[:, j])[None]), stamp, None))
        return out + [(columns, std, None) for columns, std in _gives_way(trial, tolerances)]
    rigid = trial.rigid
    assert rigid is not None
    offset = _per_joint(tolerances.torque_offset, trial) * trial.scale
    coulomb = _per_joint(tolerances.coulomb_friction, trial) * trial.scale
    viscous = _per_joint(tolerances.viscous_friction, trial) * trial.scale / trial.speed_scale
    stated = joint_dynamics(trial.recording.arm)
    for j in joints:
        velocity = motion.sure_velocity[:, j]
        acting: list[tuple[np.ndarray, float, float | None]] = [(ones[0], offset[j], None)]
        # Nobody states how sharply the remaining friction turns; several widths span what it may be.
        acting += [(smooth_sign(velocity, w), OF_A_WIDTH * coulomb[j], w) for w in FLOOR_WIDTHS]
        acting.append((velocity, viscous[j], None))
        if stated.friction[j] > 0:  # nor is it stated of the friction that the model has
            shapes = [smooth_sign(velocity, w) for w in FLOOR_WIDTHS]
            turn = smooth_sign(velocity, NOMINAL_SIGN)
            # MuJoCo's turns ahead of the velocity, the less abruptly the lighter the joint.
            ahead = velocity + AHEAD_S * motion.sure_acceleration[:, j]
            shapes += [smooth_sign(ahead, w) for w in (NOMINAL_SIGN, *FLOOR_WIDTHS[4:])]
            acting += [(x - turn, OF_A_WIDTH * float(stated.friction[j]), None) for x in shapes]
        if trial.rotor[j] > 0:
            acting.append((motion.sure_acceleration[:, j], tolerances.armature * trial.rotor[j], None))
        first, *rest = _driven(trial, j, acting)
        out += [first, (trial.sensor(j, flat), offset[j], None), *rest]
        if rigid.spring_stiffness[j] != 0:
            pull = np.zeros((1, len(trial), trial.joints))
            pull[0, :, j] = rigid.spring_torque(motion.q)[:, j]
            out.append((trial.link(pull), SPRING, None))
    others: list[tuple[Columns, float]] = []
    if {"link", "dynamics"} & set(trial.channels):
        others += _bodies(trial, tolerances)
        others += [(trial.link(axis[None]), tolerances.base_tilt) for axis in trial.tilt]
        for j in joints:
            soft = trial.link(trial.deflection(j, trial.transmitted[None, :, j]))
            others.append((soft, COMPLIANCE / max(trial.scale[j], 1e-9)))
    others += _stamps(trial, tolerances) + _within_goals(trial)
    others += _late_speeds(trial, tolerances) + _motors(trial, tolerances)
    out += [(columns, std, None) for columns, std in others]
    return [item for item in out if item[1] > 0]


def _gives_way(trial: Trial, tolerances: Tolerances) -> list[tuple[Columns, float]]:
    """How far a simulated servo may give way more or less than it does, and stick elsewhere."""
    motion, followed = trial.motion, trial.equations.followed
    command, controller = motion.command, motion.controller
    if followed is None or controller is None or command is None or command.position is None:
        return []
    error = motion.reduce(command.position - followed)
    motor = float(np.max(np.asarray(tolerances.motor_constant)))
    share = float(np.linalg.norm([tolerances.mass, tolerances.inertia, motor, CONTROLLER_GAIN]))
    turns = smooth_sign(motion.sure_velocity, FLOOR_WIDTHS[-2])
    friction = _per_joint(tolerances.coulomb_friction, trial) * trial.scale
    out: list[tuple[Columns, float]] = []
    for j in range(trial.joints):
        out.append((trial.tracking(j, error[None, :, j]), share))
        if controller.stiffness[j] > 0:
            sticks = trial.tracking(j, motion.reduce(turns)[None, :, j])
            out.append((sticks, float(friction[j] / controller.stiffness[j])))
    return [(columns, std) for columns, std in out if std > 0]


def _driven(
    trial: Trial, joint: int, acting: Sequence[tuple[np.ndarray, float, float | None]]
) -> list[tuple[Columns, float, float | None]]:
    """Each of several torques (F,) before a joint's sensor by itself; they pass the band's filter at once."""
    together = trial.drive(joint, np.stack([torque for torque, *_ in acting]))
    return [
        ({place: rows[k : k + 1] for place, rows in together.items()}, std, turn)
        for k, (_, std, turn) in enumerate(acting)
    ]


def _per_joint(value: float | tuple[float, ...], trial: Trial) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, dtype=float), (trial.joints,))


def _bodies(trial: Trial, tolerances: Tolerances) -> list[tuple[Columns, float]]:
    """Mass, centre of mass and inertia of every link, and the tool's mass."""
    rigid = trial.rigid
    assert rigid is not None
    out: list[tuple[Columns, float]] = []
    for link, p in enumerate(rigid.inertial_parameters):
        y = trial.regressor[:, :, link, :]
        mass = max(float(p[0]), 1e-6)
        out.append((trial.link((y @ p)[None]), tolerances.mass))
        center = p[1:4] / mass
        for axis in range(3):
            shift = np.zeros(10)
            e = np.eye(3)[axis]
            shift[1 + axis] = mass
            # Moving the centre also moves the inertia about the joint: d/dc of m (c.c I - c c^T).
            change = mass * (2 * center[axis] * np.eye(3) - np.outer(center, e) - np.outer(e, center))
            shift[4:] = _six(change)
            out.append((trial.link((y @ shift)[None]), tolerances.center_of_mass))
        inertia = _about_center(p, mass, center)
        moments, axes = np.linalg.eigh(inertia)
        for moment, axis in zip(np.maximum(moments, 1e-7), axes.T, strict=True):
            change = np.zeros(10)
            change[4:] = _six(moment * np.outer(axis, axis))
            out.append((trial.link((y @ change)[None]), tolerances.inertia))
    tool = trial.recording.arm.tool
    if tool is not None:
        center = rigid.flange_in_joint.act(np.asarray(tool.center_of_mass, dtype=float))
        p = np.zeros(10)
        p[0], p[1:4] = tool.mass, tool.mass * center
        p[4:] = _six(tool.mass * (center @ center * np.eye(3) - np.outer(center, center)))
        out.append((trial.link((trial.regressor[:, :, -1, :] @ p)[None]), tolerances.tool_mass))
    return out


def _stamps(trial: Trial, tolerances: Tolerances) -> list[tuple[Columns, float]]:
    """Channels that are stamped early or late against one another, within half a sample or the tolerance.

    Or by as much as a driver's filter before a torque is late, where its noise shows one.
    Of what stands out of noise: a controller makes torque of the noise that it reads, and that noise,
    differenced, is in the residual as well. A shift would seem to explain it, and effects would have to undo
    the shift.
    """
    motion = trial.motion
    stamp = max(tolerances.stamp, 0.5 / motion.rate)
    out: list[tuple[Columns, float]] = []
    if motion.u is not None and motion.tau is not None:
        sent = motion.reduce(_sent(motion))
        columns = {("drive", j): motion.derivative(sent[:, j])[None] for j in range(trial.joints)}
        out.append((columns, float(np.linalg.norm([stamp, trial.effort_lag, trial.torque_lag]))))
        if np.any(trial.rotor > 0):
            # States that are stamped half a period early or late move the rotor's share of the torque.
            jerk = motion.derivative(trial.rotor * motion.sure_ddq)
            out.append(({("drive", j): jerk[None, :, j] for j in range(trial.joints)}, stamp))
    channel = "link" if "link" in trial.channels else "dynamics"
    if channel in trial.channels:
        torque = motion.reduce(_sent(motion) if motion.tau is None else motion.sure_effort)
        columns = {(channel, j): motion.derivative(torque[:, j])[None] for j in range(trial.joints)}
        lag = trial.torque_lag if motion.tau is None else trial.effort_lag
        out.append((columns, float(np.hypot(stamp, lag))))
    if trial.shows_controller and motion.command is not None:
        controller, command = trial.recording.arm.controller, motion.command
        assert controller is not None and command.position is not None and command.velocity is not None
        if controller.period_s > 1.5 / motion.rate:  # nobody knows when within a sample's time it thought
            stamp = max(stamp, 0.25 * controller.period_s)
        shift = straight_time(motion, stamp)
        rate = late_law_change(motion, shift) / shift
        out.append((add(*(trial.controller(j, rate[None, :, j]) for j in range(trial.joints))), stamp))
        if trial.torque_lag > 0.0:
            grows = np.gradient(motion.smooth(motion.sure_torque), 1.0 / motion.rate, axis=0)
            columns = add(*(trial.controller(j, grows[None, :, j]) for j in range(trial.joints)))
            out.append((columns, trial.torque_lag))
        law = motion.described_law
        for part in (law.spring, law.punch, law.damper):
            if motion.computed:
                part = motion.sure(part, white_noise(part, motion.rate))
            for j in range(trial.joints):
                out.append((trial.controller(j, part[None, :, j]), CONTROLLER_GAIN))
    return out


def _sent(motion: RecordedMotion) -> np.ndarray:
    """Torque (F, J) whose stamps may be off: a recorded voltage's, and not what the speed takes off it.

    That is a matter of the states, as is all that it is compared with. So is a voltage that a law gives.
    """
    controller, torque = motion.controller, motion.sure_torque
    if controller is None or motion.computed or controller.law.after_back_emf:
        return torque
    lost = controller.law.of_joints("back_emf", motion.joints) * motion.enabled * motion.sure_velocity
    return torque + lost


def _late_speeds(trial: Trial, tolerances: Tolerances) -> list[tuple[Columns, float]]:
    """How late the speed is that each law damps, where nobody recorded it.

    A drive differences its last two readings, so that its speed is half a period old, or filters it. The
    recorded position's slope is of the moment itself.
    """
    motion, controller = trial.motion, trial.recording.arm.controller
    if controller is None or not trial.shows_controller or motion.logs_damped_velocity:
        return []
    late = max(tolerances.stamp, 0.5 * controller.period_s)
    wound = controller.law.of_joints("velocity_integral", trial.joints)  # but for what it held at the start
    torque = controller.damping * motion.sure_acceleration + wound * motion.sure_velocity  # per second
    return [(trial.controller(j, torque[None, :, j]), late) for j in range(trial.joints)]


def _within_goals(trial: Trial) -> list[tuple[Columns, float]]:
    """At which time between two held goals torques were read, the same at all joints.

    The motion feels the mean of a tooth of which a log holds one place. What speaks of the law itself reads
    both at that place.
    """
    late = reading_time(trial.motion)
    if late == 0.0:
        return []
    return [
        (add(*(trial.drive(j, rate[None, :, j]) for j in range(trial.joints))), late)
        for rate in tooth_rates(trial.motion)
    ]


def _motors(trial: Trial, tolerances: Tolerances) -> list[tuple[Columns, float]]:
    """Torque per volt or ampere of each motor."""
    motion, controller = trial.motion, trial.recording.arm.controller
    if controller is None:
        return []
    law, out = controller.law, []
    known = law.of_joints("torque_per_volt", trial.joints) + law.of_joints("torque_per_ampere", trial.joints)
    spread = _per_joint(tolerances.motor_constant, trial)
    torque = motion.sure_torque if motion.computed else motion.raw_commanded
    for j in range(trial.joints):
        if known[j] > 0 and torque is not None:
            out.append((trial.drive(j, torque[None, :, j]), spread[j]))
    return out


def recording_columns(trial: Trial) -> list[tuple[Columns, float]]:
    """The same of what differs from recording to recording: what a controller's integrals hold.

    Nobody knows what they held when the recording began. From there on they add up the noise of every
    reading, those between two samples included: a random walk, here by its Karhunen-Loeve functions.
    """
    motion, controller = trial.motion, trial.recording.arm.controller
    if controller is None or not trial.shows_controller or motion.command is None:
        return []
    winding = np.flatnonzero(integrates(trial.recording.arm)).tolist()
    if not winding:
        return []
    out: list[tuple[Columns, float]] = []
    span = max(float(motion.time[-1] - motion.time[0]), 1e-9)
    elapsed = motion.elapsed / span
    rate, noise = integrated_terms(motion)
    step = 1.0 / motion.rate
    for j in winding:
        for shape in (np.ones_like(elapsed), elapsed):
            out.append((trial.controller(j, shape[None]), WOUND * trial.scale[j]))
        out.append((trial.controller(j, rate[None, :, j]), step))
        for k in range(1, WALKS + 1):
            turns = (k - 0.5) * np.pi
            wave = np.sin(turns * elapsed)[None]
            out.append((trial.controller(j, wave), float(noise[j]) * np.sqrt(2.0 * span) / turns))
    return [(columns, std) for columns, std in out if std > 0]


def _six(matrix: np.ndarray) -> np.ndarray:
    """Pinocchio's order of a symmetric 3x3: xx xy yy xz yz zz."""
    return matrix[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]


def _about_center(p: np.ndarray, mass: float, center: np.ndarray) -> np.ndarray:
    about_joint = np.array([[p[4], p[5], p[7]], [p[5], p[6], p[8]], [p[7], p[8], p[9]]])
    return about_joint - mass * (center @ center * np.eye(3) - np.outer(center, center))
