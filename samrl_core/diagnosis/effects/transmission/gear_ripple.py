"""8: gear torque ripple."""

from __future__ import annotations

import numpy as np
from scipy import signal

from samrl_core.diagnosis.effects.drive_torque import (
    DriveEffect,
    DriveForm,
    least_ripple_order,
    travel_unit,
)
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import drive_channel
from samrl_core.diagnosis.residuals.trial import Trial

HIGHEST = 420.0  # [1/rad] order that is searched
LOWER, HIGHER = 14.0 / 15.0, 43.0 / 42.0  # times the orders searched, within which the best one is refined


class GearRipple(DriveEffect):
    """Torque that repeats many times per turn: teeth, poles, flexspline."""

    family, number, title = "gear_ripple", 8, "Gear torque ripple"
    meaning = "Tooth meshing adds a torque that oscillates with motor angle at a fixed count per turn."
    remedy = (
        "Add the ripple with its order and amplitude, or filter at that order; avoid speeds where it meets a "
        "resonance."
    )
    formula = "tau_f = A sin(N q + phi) (+ A2 sin(2 N q + phi2)), lost between command and sensor"
    source = "harmonic drives ripple at 2 and 4 per wave-generator turn; ratio about 100"
    excitation = "constant slow speed, two or three levels"
    experiment = "sweep"
    curve_over = "position"
    renamed_shapes = ("N",)
    confounded_with = ("position_dependent_friction", "encoder_eccentricity")
    parameters = (
        Parameter("amplitude", "N m", 0.02, 0.5, "of the ripple's first line"),
        Parameter("order", "1/rad", 15.0, 420.0, "periods per 2 pi"),
        Parameter(
            "phase", "rad", -3.1416, 3.1416, "of the torque that is lost; pi more if added", bounded=False
        ),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        (joint,) = place.joints
        grid = tuple({"N": n} for n in _peaks(trial, joint))
        unit = travel_unit(trial, joint)
        limits = {"N": (LOWER * least_ripple_order(trial, joint), HIGHER * HIGHEST / unit)}
        first, second = ("sine", "cosine"), ("sine2", "cosine2")
        return (
            Ripple(place=place, amplitudes=first, shapes=grid, refine=limits, step=0.003),
            # Per turn of a wave generator, and twice.
            Ripple(
                name="two lines",
                place=place,
                amplitudes=first + second,
                shapes=grid[:2],
                refine=limits,
                step=0.003,
            ),
        )


class Ripple(DriveForm):
    """One line, or two of which the second repeats twice as often."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        angle = shape["N"] * trial.motion.full_position[:, joint]
        lines = range(1, len(self.amplitudes) // 2 + 1)
        return np.stack([wave(n * angle) for n in lines for wave in (np.sin, np.cos)])

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(len(self.amplitudes), 0.03 * trial.scale[joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        a, b = amplitudes[:2]
        return {"amplitude": float(np.hypot(a, b)), "order": shape["N"], "phase": float(np.arctan2(b, a))}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        a, b = amplitudes[:2]  # the simulator knows one line
        return {
            "harmonic_amplitude": self.at_joints(trial, np.hypot(a, b)),
            "harmonic_order": self.at_joints(trial, shape["N"]),
            # The simulator adds to the drive what the residual counts as lost.
            "harmonic_phase": self.at_joints(trial, np.arctan2(-b, -a)),
        }


def _peaks(trial: Trial, joint: int, count: int = 4) -> list[float]:
    """Orders at which the drive residual of a joint has most power over position, well inside the band."""
    channel = drive_channel(trial.channels)
    residual = trial.equations.residual[channel][:, joint]
    unit = travel_unit(trial, joint)
    q, speed = trial.motion.q[:, joint], np.abs(trial.motion.dq[:, joint])
    moving = speed > 0.01 * unit
    if np.count_nonzero(moving) < 50:
        return [100.0 / unit]
    lowest = least_ripple_order(trial, joint)
    smooth = signal.medfilt(residual, 15)
    detail, q, speed = (residual - smooth)[moving], q[moving], speed[moving]
    span = max(float(np.ptp(q)), 0.1 * unit)
    orders = np.arange(lowest, HIGHEST / unit, np.pi / 2 / span)
    power = np.zeros(len(orders))
    for k, n in enumerate(orders):
        inside = n * speed < 2 * np.pi * 0.8 * trial.motion.band
        if np.count_nonzero(inside) > 30:
            power[k] = np.abs(np.exp(1j * n * q[inside]) @ detail[inside]) ** 2 / np.count_nonzero(inside)
    best: list[float] = []
    for k in np.argsort(power)[::-1]:
        if all(abs(orders[k] - other) > 3 * np.pi / span for other in best):
            best.append(float(orders[k]))
        if len(best) == count:
            break
    return best


EFFECT = GearRipple()
