"""The machines of the tests: figures of data sheets, rounded.

MX-28: stall torque 2.5 N m and 1.4 A, no-load 55 rev/min at 12 V, gear 193 (ROBOTIS e-manual). RE 25, 24 V:
kt 23.4 mN m/A, 2.32 ohm, 10.8 g cm2 (maxon). A NEMA 17 stepper: 0.4 N m, 54 g cm2.
"""

from __future__ import annotations

import numpy as np

from tests.diagnosis.controllers.machines import COUNTS, Machine, Path


def _ramped(t: np.ndarray) -> np.ndarray:
    return 1.0 - np.exp(-((t / 0.5) ** 3))


def slow(t: np.ndarray) -> np.ndarray:
    """Slow reversals."""
    return 0.8 + _ramped(t) * (0.5 * np.sin(1.9 * t) + 0.15 * np.sin(4.3 * t + 1.0))


def lively(t: np.ndarray) -> np.ndarray:
    """A chirp to 3 Hz on a slow sine."""
    return 0.6 + _ramped(t) * (0.35 * np.sin(1.3 * t) + 0.12 * np.sin(2 * np.pi * (0.5 + 0.125 * t) * t))


def work(t: np.ndarray) -> np.ndarray:
    """Point to point, with rests."""
    places = [0.6, 1.3, 0.2, 0.9, 0.0, 0.7]
    out = np.full_like(t, places[0])
    for k, (a, b) in enumerate(zip(places[:-1], places[1:], strict=True)):
        s = np.clip((t - 0.5 - 1.9 * k) / 1.0, 0.0, 1.0)
        out = out + (b - a) * s**3 * (10 - 15 * s + 6 * s**2)
    return out


def signal(most: float, seed: int) -> Path:
    """An input of sines of several periods, for machines without a loop."""
    rng = np.random.default_rng(seed)
    w, p = rng.uniform(0.8, 9.0, 5), rng.uniform(0, 2 * np.pi, 5)

    def of(t: np.ndarray) -> np.ndarray:
        return most * _ramped(t) * np.mean(np.sin(np.multiply.outer(t, w) + p), axis=-1) * 1.4

    return of


PATHS: dict[str, Path] = {"slow": slow, "lively": lively, "work": work}
MX28 = {
    "torque_constant": [0.00925],
    "back_emf_constant": [0.0108],
    "resistance": [8.57],
    "gear_ratio": [193.0],
}
MX28_ROTOR = 193.0**2 * 8.7e-8
RE25 = {"torque_constant": [0.0234], "resistance": [2.32], "gear_ratio": [20.0]}
RE25_ROTOR = 20.0**2 * 1.08e-6

POSITION_SERVO = Machine(
    {
        "type": "position_servo", "stiffness": [30.0], "damping": [1.0], "dead_band": [0.002],
        "punch": [0.02], "velocity_feedforward": [0.5], "effort_limit": [6.0], "period_s": 0.001,
        "armature": [0.01],
    },
    0.6, 0.2, 0.002, 0.01, 6.0, 250.0, PATHS, speed_log=2e-3,
)  # fmt: skip
VOLTAGE_SERVO = Machine(
    {
        "type": "voltage_servo", "proportional": [40.0], "integral": [20.0], "voltage_limit": [12.0],
        "period_s": 0.005, "armature": [MX28_ROTOR], **MX28,
    },
    0.3, 0.15, 0.001, MX28_ROTOR, 2.5, 200.0, PATHS, resolution=2 * np.pi / COUNTS,
)  # fmt: skip
VELOCITY_DRIVE = Machine(
    {
        "type": "velocity_drive", "velocity_gain": [1.5], "position_gain": [15.0], "integral": [6.0],
        "effort_limit": [8.0], "armature": [0.02],
    },
    0.8, 0.25, 0.003, 0.02, 8.0, 500.0, PATHS, records="standstill", speed_log=2e-3,
)  # fmt: skip
VOLTAGE_MOTOR = Machine(
    {"type": "voltage_motor", "voltage_limit": [24.0], "armature": [RE25_ROTOR], **RE25},
    0.4, 0.15, 0.001, RE25_ROTOR, 4.8, 500.0, {f"signal {k}": signal(12.0, k) for k in (1, 2, 3)},
    records="standstill", speed_log=2e-3,
)  # fmt: skip
CURRENT_MOTOR = Machine(
    {"type": "current_motor", "torque_constant": [0.0234], "gear_ratio": [20.0], "armature": [RE25_ROTOR]},
    0.4, 0.15, 0.001, RE25_ROTOR, 2.4, 500.0, {f"signal {k}": signal(1.0, k) for k in (1, 2, 3)},
    records="standstill", speed_log=2e-3,
)  # fmt: skip
STEPPER = Machine(
    {
        "type": "stepper", "holding_torque": [0.4], "full_steps": [200.0], "microsteps": [16.0],
        "gear_ratio": [5.0], "damping": [0.05], "armature": [1.35e-4],
    },
    0.15, 0.15, 0.0005, 1.35e-4, 2.0, 500.0, PATHS, speed_log=2e-3,
)  # fmt: skip
MACHINES = {
    m.about["type"]: m
    for m in (POSITION_SERVO, VOLTAGE_SERVO, VELOCITY_DRIVE, VOLTAGE_MOTOR, CURRENT_MOTOR, STEPPER)
}
