"""Set B: many sines at once on every joint, and a chirp of small amplitude on top of them."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.excitation.signal import closing_rest, from_velocity, sample_times, taper
from samrl_core.cell.excitation.workspace import WorkBox
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_recording import JointSignal

BAND_HZ = (0.1, 5.0)
CHIRP_HZ = (2.0, 20.0)
_SINES = 12  # per joint
_AMPLITUDE_SLOPE = -1.7  # position amplitude over frequency, between constant speed and constant acceleration
_ACCELERATION_SHARE = 0.35  # of the limit for the sines
_CHIRP_SHARE = 0.25  # of the acceleration limit
_CHIRP_SPEED = 0.12  # amplitude bound of the chirp at its slow end [rad/s]
_REST_S = 0.2  # before the motion [s]


def multisine(
    spec: RobotSpec,
    box: WorkBox,
    rng: np.random.Generator,
    duration_s: float,
    period_s: float,
    band_hz: tuple[float, float] = BAND_HZ,
    chirp_hz: tuple[float, float] | None = CHIRP_HZ,
    joints: np.ndarray | None = None,
    vigour: float = 1.0,
) -> JointSignal:
    """Sines of random phase, frequencies stratified over the band and different for every joint.

    Each joint is scaled to the box and to shares of its velocity and acceleration limits; `vigour`
    scales the result. The chirp sweeps upwards on odd joints and downwards on even ones.
    """
    time = sample_times(duration_s, period_s)
    limits = spec.limits
    move = np.ones(len(spec.joint_names), bool) if joints is None else joints
    low = max(band_hz[0], 1.0 / duration_s)  # less than one period teaches nothing
    edges = np.geomspace(low, max(band_hz[1], 1.5 * low), _SINES + 1)
    center = box.center + rng.uniform(-0.1, 0.1, len(move)) * box.half_width
    end = duration_s - closing_rest(duration_s)
    weight = taper(time, _REST_S, end, 0.15 * duration_s)
    velocity = np.zeros((len(time), len(move)))
    for j in np.flatnonzero(move):
        omega = 2.0 * np.pi * np.exp(rng.uniform(np.log(edges[:-1]), np.log(edges[1:])))
        phase = rng.uniform(0.0, 2.0 * np.pi, _SINES)
        wave = (np.sin(np.outer(time, omega) + phase) * omega**_AMPLITUDE_SLOPE).sum(axis=1)
        position = weight * (wave - wave.mean())
        speed = np.gradient(position, period_s)
        force = np.gradient(speed, period_s)
        scale = min(
            0.8 * box.half_width / np.abs(position).max(),
            0.45 * limits.velocity[j] / np.abs(speed).max(),
            _ACCELERATION_SHARE * limits.acceleration[j] / np.abs(force).max(),
        )
        velocity[:, j] = scale * speed
        if chirp_hz is not None:
            up = rng.random() < 0.5
            velocity[:, j] += chirp_velocity(
                time,
                (0.5 * duration_s, end),
                chirp_hz if up else (chirp_hz[1], chirp_hz[0]),
                _CHIRP_SHARE * limits.acceleration[j],
                rng.uniform(0.0, 2.0 * np.pi),
            )
    velocity[[0, -1]] = 0.0
    return from_velocity(time, vigour * velocity, center)


def chirp_velocity(
    time: np.ndarray,
    span_s: tuple[float, float],
    sweep_hz: tuple[float, float],
    acceleration: float,
    phase: float = 0.0,
    speed: float = _CHIRP_SPEED,
) -> np.ndarray:
    """Velocity (N,) of a logarithmic sweep of constant acceleration amplitude, its speed bounded too."""
    begin, end = span_s
    length = end - begin
    s = np.clip((time - begin) / length, 0.0, 1.0)
    ratio = np.log(sweep_hz[1] / sweep_hz[0])
    omega = 2.0 * np.pi * sweep_hz[0] * np.exp(ratio * s)
    angle = 2.0 * np.pi * sweep_hz[0] * length * (np.expm1(ratio * s) / ratio) + phase
    return taper(time, begin, end, 0.1 * length) * np.minimum(acceleration / omega, speed) * np.cos(angle)
