"""Where torque or motion gets lost between the nominal model and the recording, stage by stage.

    controller  described law at the measured state  -  commanded effort
    drive       commanded effort  -  nominal rotor inertia and friction  -  link-side effort
    link        link-side effort  -  inverse dynamics of URDF and tool
    dynamics    drive + link, where only one effort was recorded
    tracking    command  -  position, where no effort or no model exists; with a law and a model, what the
                nominal machine makes of the command  -  position

Each is zero for a nominal arm. An unmodelled effect appears in the stage in which it acts, which is what
tells a payload (link) from a weak drive (drive) or a changed gain (controller).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_description import HELD, ArmDescription
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.coarse_readings import coarse_steps, widen_where_coarse
from samrl_core.diagnosis.residuals.laws.followed import followed_position
from samrl_core.diagnosis.residuals.laws.goal_phase import widen_with_goals
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.rest import widen_at_rest
from samrl_core.diagnosis.residuals.signals.noise_color import NoiseColor
from samrl_core.diagnosis.residuals.signals.rounding import rounding_noise, widen_at_edges, widen_where_held
from samrl_core.diagnosis.residuals.signals.signal_noise import sample_detail, white_noise
from samrl_core.diagnosis.residuals.torque_noise import acceleration_noise, spring_noise, unknown_wider
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

CHANNELS = ("controller", "drive", "link", "dynamics", "tracking")
UNITS = {"controller": "N m", "drive": "N m", "link": "N m", "dynamics": "N m", "tracking": "rad"}
RELATIVE_FLOOR = 0.02  # of a block's own residual: no formula of friction is right to better than this
FRICTION_FLOOR = 0.05  # of the tolerated Coulomb friction
LEAST_NOISE = 1e-9  # of the effort scale: a joint that nothing drives has no noise of its own
TORQUE_FLOOR = 0.002  # of a joint's torque variation: sampling and filtering
TIMING_RATE_HZ = 20.0  # below it moves are not followed, only what stays when they are over
SETTLED = 1e-6  # [rad] travel of a command that rests
SETTLING_S = 1.0  # ASSUMPTION: until a small servo has settled
LATEST_S = 0.5  # longest delay of a servo that only logs where it is; a tenth of a shorter recording
LATEST_IN_LAW_S = 0.1  # the same of a command before a described law
# Of a command's typical speed: slower than that when the recording begins, it stood still before.
MOVES = 0.05
NOMINAL_SIGN = 0.005  # [rad/s] width of the sign in stated friction, as in closed-loop simulation
WALKS = 60  # functions of a random walk: up to 2.5 Hz in a recording of 12 s
MAX_LAG = 2  # [samples] by which states may lead or trail the commanded effort they caused

Columns = dict[tuple[str, int], np.ndarray]  # (channel, joint) -> (p, N): a few regressors, sparse


@dataclass(frozen=True, eq=False)
class Equations:
    """Residuals of one recording; missing channels are absent from the mappings."""

    motion: RecordedMotion
    residual: dict[str, np.ndarray]  # channel -> (N, J) [N m or rad]
    sigma: dict[str, np.ndarray]  # channel -> (N, J), same unit: noise and floors
    law: np.ndarray | None  # (F, J) commanded effort by the described law at full rate [N m]
    lag: int  # [samples] by which states were shifted
    model: np.ndarray | None = None  # (N, J) link-side torque of the nominal model along the motion [N m]
    followed: np.ndarray | None = None  # (F, J) positions of the simulated nominal machine, without torques
    color: dict[str, NoiseColor] = field(default_factory=dict)  # channel -> of its noise; absent: white

    @property
    def channels(self) -> tuple[str, ...]:
        """Available channels in the order of `CHANNELS`."""
        return tuple(c for c in CHANNELS if c in self.residual)


def armature(arm: ArmDescription) -> np.ndarray:
    """Nominal rotor inertia (J,) [kg m2]."""
    return joint_dynamics(arm).armature


def nominal_friction(arm: ArmDescription, velocity: np.ndarray) -> np.ndarray:
    """Friction (F, J) that the model itself states, at joint velocities (F, J) [N m]."""
    stated = joint_dynamics(arm)
    return stated.friction * smooth_sign(velocity, NOMINAL_SIGN) + stated.damping * velocity


def scale_limits(arm: ArmDescription, rigid: RigidArm | None, motion: RecordedMotion) -> np.ndarray:
    """Effort scale (J,) [N m]: the effort limit, or the largest effort seen where none is stated.

    Of a joint that nothing drives, such as a pendulum that was let go, it is what its motion takes.
    """
    limit = np.full(len(arm.joints), np.inf)
    if rigid is not None:
        limit = rigid.effort_limits()
    if arm.controller is not None and arm.controller.effort_limit is not None:
        limit = np.minimum(limit, arm.controller.effort_limit)
    seen = motion.u if motion.u is not None else motion.tau
    largest = np.ones(len(arm.joints)) if seen is None else np.abs(seen).max(axis=0)
    passive = ~np.isfinite(limit) & (largest == 0.0)
    if rigid is not None and motion.dynamic and passive.any():
        moved = rigid.inverse_dynamics(motion.q, motion.sure_velocity, motion.sure_acceleration)
        largest = np.where(passive, np.abs(moved).max(axis=0), largest)
    return np.where(np.isfinite(limit), limit, largest)


def scale_speeds(rigid: RigidArm, motion: RecordedMotion) -> np.ndarray:
    """Speed scale (J,) [rad/s]: the velocity limit; where none is stated 1 rad/s, or the fastest seen beyond.

    Without it what is tolerated of viscous friction would hide a fast motor's or a pendulum's own.
    """
    limit = rigid.velocity_limits()
    if np.isfinite(limit).all():
        return limit
    fastest = np.abs(motion.sure_velocity).max(axis=0)
    return np.where(np.isfinite(limit), limit, np.maximum(fastest, 1.0))


def form_equations(motion: RecordedMotion) -> Equations:
    """All residuals that the recording allows."""
    arm, rigid = motion.recording.arm, motion.arm
    residual: dict[str, np.ndarray] = {}
    sigma: dict[str, np.ndarray] = {}
    color: dict[str, NoiseColor] = {}
    law, lag = None, 0
    u, tau = motion.u, motion.tau
    dynamic = rigid is not None and motion.dynamic
    if not dynamic or (u is None and tau is None):
        followed = None
        if motion.command is not None:
            command = motion.command.position
            assert command is not None and motion.raw_position is not None
            followed = followed_position(motion)
            wanted = command if followed is None else followed
            residual["tracking"] = motion.reduce(wanted - motion.raw_position)
            noise = np.sqrt(motion.band_share) * motion.noise.position
            level = np.hypot(noise + 1e-4, _resolution(motion.raw_position))
            residual["tracking"] *= settled(motion)
            sigma["tracking"] = _spread(level, residual["tracking"])
        return Equations(motion, residual, sigma, law, lag, followed=followed)
    assert rigid is not None
    scale = scale_limits(arm, rigid, motion)
    share = np.sqrt(motion.band_share)
    rotor = armature(arm) * motion.ddq + motion.reduce(nominal_friction(arm, motion.sure_velocity))
    model = rigid.inverse_dynamics(motion.q, motion.dq, motion.ddq) + _made_by_the_band(motion, rigid)
    link_noise, sprung = acceleration_noise(motion, rigid), spring_noise(motion, rigid)
    noise = motion.noise
    torque = u if u is not None else tau
    assert torque is not None
    variation = np.std(torque, axis=0)
    floor = TORQUE_FLOOR * variation
    # The friction that tolerances allow is of no formula either.
    friction = FRICTION_FLOOR * np.asarray(arm.tolerances.coulomb_friction) * scale
    if motion.computed:
        law = motion.described_law.total
    elif motion.command is not None and _has_loop(arm) and u is not None:
        law, lag, raw = _controller_residual(motion)
        residual["controller"] = motion.reduce(raw)
        rounded = rounding_noise(motion, raw)
        behind = motion.noise.torque_filter
        detail = behind.noise(raw) if behind.form else sample_detail(raw)
        level = np.hypot(share * np.maximum(detail, rounded), floor)
        assert arm.controller is not None
        if motion.raw_velocity is None:  # what multiplies differences of noisy positions
            damped = arm.controller.damping * (not motion.logs_damped_velocity)
            if arm.controller.law.after_back_emf:
                damped = damped + arm.controller.law.of_joints("back_emf", motion.joints)
            rising = damped * np.sqrt(motion.velocity_noise())
            level = np.hypot(level, rising)
            color["controller"] = _color(motion, rising, level, 2)
        level = np.hypot(level, np.hypot(_between_commands(motion), _fast_walk(motion)))
        # What an integral held when the recording began is unknown, and no part of a formula.
        own = residual["controller"] - np.where(integrates(arm), residual["controller"].mean(axis=0), 0.0)
        wider = widen_where_held(widen_with_goals(_spread(level, own), motion, raw), motion, rounded)
        wider = _past_wider(widen_at_edges(wider, motion), motion, scale)
        sigma["controller"] = np.maximum(wider, LEAST_NOISE * scale)  # no law, no effort: nothing is off
    if u is not None and tau is not None:
        residual["drive"] = u - rotor - tau
        rotor_noise = armature(arm) * np.sqrt(motion.acceleration_noise(0.0, motion.band))
        level = np.hypot(share * np.hypot(noise.commanded_effort, noise.effort), np.hypot(rotor_noise, floor))
        level = np.hypot(level, friction)
        color["drive"] = _color(motion, rotor_noise, level)
        sigma["drive"] = widen_at_rest(_spread(level, residual["drive"]), motion, scale, color["drive"])
        if motion.computed:
            sigma["drive"] = _past_wider(widen_at_edges(sigma["drive"], motion), motion, scale)
    if tau is not None:
        residual["link"] = tau - model
        level = np.sqrt((share * noise.effort) ** 2 + link_noise**2 + floor**2 + sprung**2)
        color["link"] = _color(motion, link_noise, level)
        sigma["link"] = _spread(level, residual["link"])
        sigma["link"] = unknown_wider(sigma["link"], motion, rigid)
    elif u is not None:
        residual["dynamics"] = u - rotor - model
        moved = link_noise + armature(arm) * np.sqrt(motion.acceleration_noise(0.0, motion.band))
        moved = np.hypot(moved, _noise_of_speed(motion))
        level = np.sqrt((share * noise.commanded_effort) ** 2 + moved**2 + floor**2 + friction**2 + sprung**2)
        color["dynamics"] = _color(motion, moved, level)
        spread = _spread(level, residual["dynamics"])
        sigma["dynamics"] = widen_at_rest(spread, motion, scale, color["dynamics"])
        sigma["dynamics"] = unknown_wider(sigma["dynamics"], motion, rigid)
        if "controller" in residual:
            sigma["dynamics"] = widen_with_goals(sigma["dynamics"], motion, raw)
        if motion.computed:
            sigma["dynamics"] = _past_wider(widen_at_edges(sigma["dynamics"], motion), motion, scale)
    if coarse_steps(motion).any():
        rotors = np.broadcast_to(np.diag(armature(arm)), (len(motion), motion.joints, motion.joints))
        mass = rigid.mass_matrix(motion.q)
        for channel, inertia in (("drive", rotors), ("link", mass), ("dynamics", mass + rotors)):
            if channel in residual:
                sigma[channel] = widen_where_coarse(sigma[channel], motion, inertia, color[channel])
    return Equations(motion, residual, sigma, law, lag, model, color=color)


def drive_channel(channels: Collection[str]) -> str:
    """Where the motors' torque is compared: with what a sensor reads behind them, else with the motion."""
    return "drive" if "drive" in channels else "dynamics"


def _made_by_the_band(motion: RecordedMotion, rigid: RigidArm) -> np.ndarray:
    """Torque (N, J) within the band of motion beyond it: reduce(f(x)) - f(reduce(x)).

    The recorded torque passes the band after the machine, which is not linear, has made it. A pendulum that
    whips round has speeds above the band whose squares are below it.
    """
    whole = (motion.full_position, motion.full_velocity, motion.full_acceleration)
    return motion.reduce(rigid.inverse_dynamics(*whole)) - rigid.inverse_dynamics(*map(motion.reduce, whole))


def _color(
    motion: RecordedMotion, rising: np.ndarray, level: np.ndarray, order: int | None = None
) -> NoiseColor:
    """Of noise of a level (J,) of which a part (J,) rises with frequency, by default as accelerations do."""
    if order is None:
        order = 2 * motion.reading.order
    share = np.clip((rising / np.maximum(level, 1e-300)) ** 2, 0.0, 1.0)
    return NoiseColor(share, order, motion.band, motion.dt)


def _noise_of_speed(motion: RecordedMotion) -> np.ndarray:
    """Torque noise (J,) of speeds that were differenced or smoothed before a law or a back-EMF took them up.

    Its white part above the band is gone, so that the torque's own spectrum does not show it.
    """
    controller = motion.controller
    if controller is None:
        return np.zeros(motion.joints)
    recorded = motion.recording.commanded_effort is not None
    gain = np.zeros(motion.joints)
    if not (recorded and controller.law.after_back_emf):
        gain = controller.law.of_joints("back_emf", motion.joints)
    if motion.raw_velocity is not None:
        return gain * np.sqrt(motion.band_share) * motion.noise.velocity
    if motion.computed and not motion.logs_damped_velocity:
        gain = gain + controller.damping
    return gain * np.sqrt(motion.velocity_noise())


def _has_loop(arm: ArmDescription) -> bool:
    return arm.controller is not None and not arm.controller.law.open_loop


def integrates(arm: ArmDescription) -> np.ndarray:
    """Joints (J,) whose controller adds up errors."""
    assert arm.controller is not None
    count = len(arm.joints)
    winds = [arm.controller.law.of_joints(name, count) for name in ("integral", "velocity_integral")]
    return np.add(*winds) > 0


def integrated_terms(motion: RecordedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Torque per second (F, J) that integrals gain, and deviation (J,) [N m / sqrt(s)] of the random walk.

    They add up the noise of every reading, those between two samples included.
    """
    controller = motion.controller
    assert controller is not None
    law, count = motion.described_law, motion.joints
    winds = [controller.law.of_joints(name, count) for name in ("integral", "velocity_integral")]
    stiff, damped = (np.where(x > 0, x, 1.0) for x in (controller.stiffness, controller.damping))
    sprung = winds[0] * law.spring / stiff
    rate = sprung + winds[1] * law.damper / damped
    step = 1.0 / motion.rate
    between, both = min(controller.period_s, step), np.sqrt(step + min(controller.period_s, step))
    if motion.logs_damped_velocity or motion.asked is None or motion.computed:
        return rate, white_noise(rate, motion.rate) * both
    # The noise of speeds that nobody recorded is in the torque; that of differences does not add up.
    read = winds[1] / damped * white_noise(motion.asked, motion.rate)
    return rate, np.hypot(white_noise(sprung, motion.rate) * both, read * np.sqrt(between))


def _fast_walk(motion: RecordedMotion) -> np.ndarray:
    """Deviation (J,) [N m] of that random walk beyond its first `WALKS` functions."""
    span = float(motion.time[-1] - motion.time[0])
    return integrated_terms(motion)[1] * np.sqrt(2.0 * span / (np.pi**2 * WALKS))


def _between_commands(motion: RecordedMotion) -> np.ndarray:
    """Effort (J,) by which a line between sparse commands may miss what the controller tracked."""
    command, controller = motion.recording.command, motion.recording.arm.controller
    assert command is not None and controller is not None
    if controller.between_commands == HELD or float(np.median(np.diff(command.time))) < 1.5 / motion.rate:
        return np.zeros(motion.joints)

    def missed(values: np.ndarray | None) -> np.ndarray:
        # A parabola through three samples is off its chord by an eighth of their second difference.
        return np.zeros(motion.joints) if values is None else np.std(np.diff(values, n=2, axis=0), axis=0) / 8

    return controller.stiffness * missed(command.position) + controller.damping * missed(command.velocity)


def _controller_residual(motion: RecordedMotion) -> tuple[np.ndarray, int, np.ndarray]:
    """Law, the lag of states that fits its finest detail best, and law - commanded effort at full rate.

    What a controller makes of the noise that it reads tells which reading it had. Another lag than none must
    take that detail off the effort: a law of differenced positions adds noise of its own, at some lags less.
    """
    u, limit = motion.asked, motion.limit()
    assert u is not None
    own = float(np.sum(sample_detail(u)))
    best: tuple[float, int, np.ndarray] | None = None
    for lag in sorted(range(-MAX_LAG, MAX_LAG + 1), key=abs):
        # The command is not shifted: a late command is an effect, a late log of states is not.
        law = motion.law(lag=lag).total
        rough = float(np.sum(sample_detail(np.clip(law, -limit, limit) - u)))
        if lag and rough > own:
            continue
        rough += 1e-4 * float(np.sum(np.std(u, axis=0)))  # a noise-free log must not be decided by rounding
        # Another lag must be clearly better than none.
        if best is None or rough * (1.2 if lag else 1.0) < best[0]:
            best = (rough * (1.2 if lag else 1.0), lag, law)
    assert best is not None
    return best[2], best[1], motion.enabled * (np.clip(best[2], -limit, limit) - u)


def _resolution(position: np.ndarray) -> np.ndarray:
    """Step (J,) of a reading; position servos let an error of one step stand."""
    steps = np.abs(np.diff(position, axis=0))
    out = np.zeros(position.shape[1])
    for j, column in enumerate(steps.T):
        some = column[column > 1e-9]
        if len(some):
            out[j] = np.quantile(some, 0.05)
    return out


def settled(motion: RecordedMotion) -> np.ndarray:
    """(N, J) one, but zero where a tracking error says nothing.

    That is near moves of the command that sampling is too slow to follow, until the joint has settled, and
    else as long as what was commanded before the recording may still be on its way.
    """
    assert motion.command is not None and motion.command.position is not None
    command = motion.command.position
    if motion.rate >= TIMING_RATE_HZ:
        return 1.0 - follows_the_past(motion, latest_delay(motion))
    reach = int(np.ceil(SETTLING_S * motion.rate))
    # Nobody knows what was commanded before the recording began.
    padded = np.concatenate([np.repeat(command[:1] + 1.0, reach, axis=0), command, command[-1:]])
    windows = np.lib.stride_tricks.sliding_window_view(padded, reach + 2, axis=0)
    return motion.reduce((np.ptp(windows, axis=-1) < SETTLED).astype(float))


def latest_delay(motion: RecordedMotion) -> float:
    """Longest delay [s] that is searched in tracking errors."""
    return min(LATEST_S, 0.1 * float(motion.time[-1] - motion.time[0]))


def follows_the_past(motion: RecordedMotion, latest: float) -> np.ndarray:
    """(N, J) one where a command that is late by up to `latest` [s] is one from before the recording.

    Nobody knows that one where it moves when the recording begins. Held at its first value it makes any delay
    worse the longer it is, the true one too. A command that begins at rest stood there before.
    """
    assert motion.command is not None and motion.command.position is not None
    command = motion.command.position
    first = motion.t - motion.time[0] < latest
    if len(command) < 3:
        return np.zeros((len(first), motion.joints))
    begins = np.abs(-1.5 * command[0] + 2.0 * command[1] - 0.5 * command[2])  # rad in a sample
    moves = begins > MOVES * np.sqrt(np.mean(np.diff(command, axis=0) ** 2, axis=0))
    return (first[:, None] & moves).astype(float)


def _past_wider(sigma: np.ndarray, motion: RecordedMotion, scale: np.ndarray) -> np.ndarray:
    """Noise (N, J) so large that a law's torque says nothing while it may follow an unknown command."""
    return np.hypot(sigma, scale * follows_the_past(motion, LATEST_IN_LAW_S))


def _spread(level: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Noise level (J,) as (N, J), with the relative floor of each block."""
    typical = np.sqrt(np.mean(residual**2, axis=0))
    return np.broadcast_to(np.hypot(level, RELATIVE_FLOOR * typical), residual.shape).copy()
