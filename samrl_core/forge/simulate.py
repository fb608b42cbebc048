"""One recording of one arm: described controller, real chain, a physics engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv  # pyright: ignore[reportAttributeAccessIssue]

from samrl_core.errors import InputError
from samrl_core.forge.arm_body import ArmBody
from samrl_core.forge.engines import make_engine
from samrl_core.forge.hooks import Hooks, Law
from samrl_core.robots.arm_model import ArmModel
from samrl_core.types.arm_description import ArmController
from samrl_core.types.arm_recording import JointSignal

_FASTEST = 15.0  # [rad/s], and
_FARTHEST = 1.0  # [rad] behind the command: no arm under control does that
SETTLE_S = 0.8  # held at the first command before the recording begins


@dataclass(frozen=True, eq=False)
class Reality:
    """What is real of an arm beside its bodies and the disturbances; arrays (J,)."""

    armature: np.ndarray  # [kg m2]
    coulomb: np.ndarray  # friction floor [N m]
    viscous: np.ndarray  # [N m s/rad]
    stribeck_velocity: float  # at which the floor's sign is smoothed [rad/s]
    drive_offset: np.ndarray  # [N m]
    gravity: np.ndarray  # (3,) in the base frame [m/s2]
    position_noise: float  # standard deviation [rad]
    velocity_noise: float  # [rad/s]

    @staticmethod
    def ideal(armature: np.ndarray, gravity: np.ndarray) -> Reality:
        """Without any mismatch or noise."""
        zero = np.zeros_like(armature)
        return Reality(armature, zero, zero, 0.01, zero, gravity, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Trace:
    """Samples (N,) and (N, J) at the controller's ticks; nothing of it is stamped or noisy but q and dq.

    At tick k the controller reads `position` and `velocity` and sends `commanded`; `effort` is the link-side
    torque in the period that begins there.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    commanded: np.ndarray


class DivergedError(InputError):
    """A simulated world left all bounds; its ranges must be mended, not its seed."""


def simulate(
    model: ArmModel,
    body: ArmBody,
    controller: ArmController,
    command: JointSignal,
    hooks: Hooks,
    reality: Reality,
    engine_name: str,
    rng: np.random.Generator,
) -> Trace:
    """Simulate `command` at the controller's period.

    Args:
        model: nominal arm with nominal tool, for the law's gravity torque.
        body: real arm with real tool.
        rng: of the sensor noise.

    Raises:
        DivergedError: a state that is not finite, or faster than any arm.
    """
    for edit in hooks.body:
        body = edit(body)
    shaped = command
    for change in hooks.command:
        shaped = change(shaped)
    period, mount, n_joints = controller.period_s, body.mount_joints, len(controller.joints)
    size = mount + n_joints
    arm = slice(mount, size)
    elastic = sorted(hooks.transmission)
    # Two bodies on a stiff spring, or a mount, want finer steps; the other engine takes them anyway.
    substeps = 2 if elastic or mount or engine_name == "mujoco" else 1
    dt = period / substeps
    rotor = reality.armature + sum(hooks.rotor_inertia, np.zeros(n_joints))
    rigid = np.ones(n_joints, dtype=bool)
    rigid[elastic] = False
    padded = np.zeros((3, size))  # rotor, Coulomb floor, viscous floor of rigid joints
    padded[:, arm] = np.stack([rotor, reality.coulomb, reality.viscous]) * rigid
    native = engine_name == "mujoco"
    engine = make_engine(engine_name, body, dt, padded[1], padded[2])
    own_coulomb = np.where(rigid & native, 0.0, reality.coulomb)
    own_viscous = np.where(rigid & native, 0.0, reality.viscous)

    start = shaped.position[0]  # type: ignore[index]
    full = np.concatenate([np.zeros(mount), start])
    engine.place(full)
    base_gravity = reality.gravity
    engine.gravity(base_gravity)
    theta, omega = start.copy(), np.zeros(n_joints)
    load = model.gravity(start)
    for i in elastic:
        theta[i] += hooks.transmission[i].rest_twist(float(load[i]))
    settle = round(SETTLE_S / period)
    count = len(shaped.time)
    noise = rng.normal(size=(2, settle + count, n_joints))
    noise[0] *= reality.position_noise
    noise[1] *= reality.velocity_noise
    out = np.empty((4, count, n_joints))
    limit = controller.effort_limit
    zero_command = np.zeros(n_joints)
    guess = np.zeros(n_joints)  # of rotor velocity at the step's end
    link_guess = np.zeros(size)
    mounts = list(enumerate(hooks.mount))
    passes = 2 if hooks.friction or elastic else 1  # the floor alone is smooth enough for one

    for k in range(-settle, count):
        t = k * period
        row = max(k, 0)
        q_true = engine.position[arm].copy()
        v_true = engine.velocity[arm].copy()
        q_true[elastic], v_true[elastic] = theta[elastic], omega[elastic]
        # Semi-implicit Euler steps the position with the new velocity: it stands half a step ahead of it.
        q_read, v_read = q_true - 0.5 * dt * v_true, v_true
        for read in hooks.encoder:
            q_read, v_read = read(t, q_read, v_read)
        q_read = q_read + noise[0, k + settle]
        v_read = v_read + noise[1, k + settle]
        lag = np.abs(shaped.position[row] - q_read).max()  # type: ignore[index]
        if not (np.abs(v_read).max() < _FASTEST and lag < _FARTHEST):  # NaN too
            engine.close()
            raise DivergedError(
                f"velocity {v_read} rad/s, lag {lag:.2f} rad at {t:.3f} s; narrow the disturbance's range"
            )
        law = Law(controller.stiffness, controller.damping, np.ones(n_joints))
        for alter in hooks.law:
            alter(law, t)
        error = shaped.position[row] - q_read  # type: ignore[index]
        error_rate = (shaped.velocity[row] if k >= 0 else zero_command) - v_read  # type: ignore[index]
        effort = law.stiffness * error + law.damping * error_rate
        if controller.gravity_compensation:
            effort += law.gravity * model.gravity(q_read)
        if k >= 0 and shaped.effort is not None:
            effort += shaped.effort[row]
        for more in law.extra:
            effort = effort + more(t, error, error_rate)
        if limit is not None:
            effort = np.minimum(np.maximum(effort, -limit), limit)
        drive = effort
        for stage in hooks.drive:
            drive = stage(t, drive)
        drive = drive + reality.drive_offset
        if hooks.gravity:
            vector = base_gravity
            for tilt in hooks.gravity:
                vector = tilt(t, vector)
            engine.gravity(vector)

        link_sum = np.zeros(n_joints)
        for _substep in range(substeps):
            mass, bias = engine.dynamics()
            position, velocity = engine.position, engine.velocity
            q_rotor, v_rotor = position[arm].copy(), velocity[arm].copy()
            q_rotor[elastic], v_rotor[elastic] = theta[elastic], omega[elastic]
            turning = drive
            for more_torque in hooks.rotor_torque:
                turning = turning + more_torque(t, q_rotor, v_rotor, effort)
            beside = np.zeros(n_joints)
            for push in hooks.external:
                beside = beside + push(t, position[arm], velocity[arm])
            for _ in range(passes):  # friction and contact are linearised about the end of the step
                ratio = np.maximum(np.abs(guess) / reality.stribeck_velocity, 1e-6)
                slope = own_coulomb / reality.stribeck_velocity * np.tanh(ratio) / ratio + own_viscous
                offset = np.zeros(n_joints)
                for i, elements in hooks.friction.items():
                    for element in elements:
                        a, c = element.linear(t, q_rotor[i], guess[i], load[i], dt)
                        offset[i] += a
                        slope[i] += c
                a_full, c_full = np.zeros(size), np.zeros(size)
                a_full[arm] = turning - offset  # effort = a - c v'
                c_full[arm] = slope
                springs = {}
                for i in elastic:
                    twist = theta[i] - position[mount + i]
                    rate = guess[i] - link_guess[mount + i]
                    a_s, c_s = hooks.transmission[i].linear(t, twist, rate, dt)
                    stiff = rotor[i] / dt + slope[i] + c_s
                    free = rotor[i] / dt * omega[i] + turning[i] - offset[i]
                    springs[i] = (a_s, c_s, stiff, free)
                    a_full[mount + i] = a_s + c_s * (free - a_s) / stiff
                    c_full[mount + i] = c_s * (1.0 - c_s / stiff)
                for i, spring in mounts:
                    hard = spring.stiffness * (1.0 + spring.hardening * position[i] ** 2)
                    a_full[i] = -hard * position[i]
                    c_full[i] = spring.damping + dt * hard
                push_full = a_full.copy()
                push_full[arm] += beside
                matrix = mass.copy()
                matrix.flat[:: size + 1] += padded[0] + dt * c_full
                # Positive definite: LAPACK straight, a third of numpy's time for such small systems.
                acceleration = dposv(matrix, push_full - bias - c_full * velocity)[1]
                link_guess = velocity + dt * acceleration
                guess = link_guess[arm].copy()
                for i, (a_s, c_s, stiff, free) in springs.items():
                    guess[i] = (free - a_s + c_s * link_guess[mount + i]) / stiff
            applied = a_full - c_full * link_guess
            for i, elements in hooks.friction.items():
                for element in elements:
                    element.commit(t, q_rotor[i], guess[i], load[i], dt)
            for i in elastic:
                rate = guess[i] - link_guess[mount + i]
                hooks.transmission[i].commit(t, theta[i] - position[mount + i], rate, dt)
                omega[i] = guess[i]
                theta[i] += dt * omega[i]
            external_full = np.zeros(size)
            external_full[arm] = beside
            passed = engine.step(applied + external_full, padded[0], acceleration)
            load = passed[arm] - beside
            link_sum += load
        if k >= 0:
            out[:, k] = q_read, v_read, link_sum / substeps, effort
    engine.close()
    if not np.isfinite(out).all():
        raise DivergedError("a recorded value is not finite; narrow the disturbance's range")
    reading = out[2]
    for sense in hooks.sensor:
        reading = sense(shaped.time, reading)
    return Trace(shaped.time, out[0], out[1], reading, out[3])
