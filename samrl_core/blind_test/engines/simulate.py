"""One recording of one arm: described controller, real chain, a physics engine."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.blind_test.engines.arm_body import ArmBody
from samrl_core.blind_test.engines.drive_chain import DriveChain
from samrl_core.blind_test.engines.engines import make_engine
from samrl_core.blind_test.engines.hooks import Hooks, Law
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError

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
    dry: np.ndarray = field(default_factory=lambda: np.zeros(0))  # that holds joints at rest; or (0,) [N m]

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
    assert shaped.position is not None and shaped.velocity is not None
    period, mount, n_joints = controller.period_s, body.mount_joints, len(controller.joints)
    native = engine_name == "mujoco"
    # Two bodies on a stiff spring, or a mount, want finer steps; the other engine takes them anyway.
    substeps = 2 if hooks.transmission or mount or native else 1
    dt = period / substeps
    # Rigid joints leave their friction floor to an engine that has one.
    left = np.array([native and i not in hooks.transmission for i in range(n_joints)])
    none = np.zeros(mount)
    engine = make_engine(
        engine_name,
        body,
        dt,
        np.concatenate([none, np.where(left, reality.coulomb, 0.0)]),
        np.concatenate([none, np.where(left, reality.viscous, 0.0)]),
    )
    start = shaped.position[0]
    engine.place(np.concatenate([none, start]))
    engine.gravity(reality.gravity)
    chain = DriveChain(
        engine,
        hooks,
        mount,
        reality.armature + sum(hooks.rotor_inertia, np.zeros(n_joints)),
        np.where(left, 0.0, reality.coulomb),
        np.where(left, 0.0, reality.viscous),
        reality.stribeck_velocity,
        start,
        model.gravity(start),
        reality.dry,
    )
    settle = round(SETTLE_S / period)
    count = len(shaped.time)
    noise = rng.normal(size=(2, settle + count, n_joints))
    noise[0] *= reality.position_noise
    noise[1] *= reality.velocity_noise
    out = np.empty((4, count, n_joints))
    limit = controller.effort_limit
    zero_command = np.zeros(n_joints)

    for k in range(-settle, count):
        t = k * period
        row = max(k, 0)
        q_rotor, v_rotor = chain.rotors()
        # Semi-implicit Euler steps the position with the new velocity: it stands half a step ahead of it.
        v_read = np.array(v_rotor)
        q_read = np.array(q_rotor) - 0.5 * dt * v_read
        for read in hooks.encoder:
            q_read, v_read = read(t, q_read, v_read)
        q_read = q_read + noise[0, k + settle]
        v_read = v_read + noise[1, k + settle]
        error = shaped.position[row] - q_read
        # No element exceeds the norm, which is quicker; NaN fails as well.
        if not (v_read @ v_read < _FASTEST**2 and error @ error < _FARTHEST**2):
            _check_bounded(t, v_read, error)
        error_rate = (shaped.velocity[row] if k >= 0 else zero_command) - v_read
        effort = _law(controller, hooks, t, error, error_rate, model.gravity(q_read))
        if k >= 0 and shaped.effort is not None:
            effort += shaped.effort[row]
        if limit is not None:
            effort = np.minimum(np.maximum(effort, -limit), limit)
        drive = effort
        for stage in hooks.drive:
            drive = stage(t, drive)
        drive = drive + reality.drive_offset
        if hooks.gravity:
            vector = reality.gravity
            for tilt in hooks.gravity:
                vector = tilt(t, vector)
            engine.gravity(vector)
        link = chain.step(t, drive, effort)
        for _ in range(substeps - 1):
            link = [a + b for a, b in zip(link, chain.step(t, drive, effort), strict=True)]
        if k >= 0:
            out[0, k], out[1, k], out[2, k], out[3, k] = q_read, v_read, link, effort
    engine.close()
    out[2] /= substeps
    if not np.isfinite(out).all():
        raise DivergedError("a recorded value is not finite; narrow the disturbance's range")
    reading = out[2]
    for sense in hooks.sensor:
        reading = sense(shaped.time, reading)
    return Trace(shaped.time, out[0], out[1], reading, out[3])


def _law(
    controller: ArmController,
    hooks: Hooks,
    t: float,
    error: np.ndarray,
    error_rate: np.ndarray,
    gravity: np.ndarray,
) -> np.ndarray:
    """Effort (J,) of the controller as it really is, before feed-forward and limits."""
    if not hooks.law:
        effort = controller.stiffness * error + controller.damping * error_rate
        return effort + gravity if controller.gravity_compensation else effort
    law = Law(controller.stiffness, controller.damping, np.ones(len(error)))
    for alter in hooks.law:
        alter(law, t)
    effort = law.stiffness * error + law.damping * error_rate
    if controller.gravity_compensation:
        effort += law.gravity * gravity
    for more in law.extra:
        effort = effort + more(t, error, error_rate)
    return effort


def _check_bounded(t: float, velocity: np.ndarray, error: np.ndarray) -> None:
    lag = np.abs(error).max()
    if not (np.abs(velocity).max() < _FASTEST and lag < _FARTHEST):  # NaN too
        raise DivergedError(
            f"velocity {velocity} rad/s, lag {lag:.2f} rad at {t:.3f} s; narrow the disturbance's range"
        )
