"""22: encoder eccentricity."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import travel_unit
from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import Columns, drive_channel
from samrl_core.diagnosis.residuals.trial import Trial, add

HARMONICS = (
    *range(1, 11),
    12,
    14,
    16,
    19,
    22,
    26,
    32,
)  # of a ring at the link; as near as travel tells apart
RATIOS = (50, 80, 100, 120, 160)  # of harmonic drives (maker's catalogues): once per turn of the motor
# Of the root mean square that must vary: an offset explains 99 % of an error that varies less.
LEAST_WAVE = 0.1


class EncoderEccentricity(Effect):
    """The reading errs once per turn of the link or of its motor, or a few times."""

    family, number, title = "encoder_eccentricity", 22, "Encoder eccentricity"
    meaning = "The encoder disc is off centre, so the reading errs periodically, once per turn."
    remedy = "Add the periodic correction to the reading or have the encoder aligned."
    formula = "q_read = q + a sin(n q + phi)"
    source = "ring off centre by micrometres: 0.2 mrad on good encoders, a degree under a servo's magnet"
    acts_on = "reading"
    excitation = "slow rotation over the whole range"
    experiment = "sweep"
    curve_over = "position"
    renamed_shapes = ("k",)
    confounded_with = ("encoder_offset", "gear_ripple")
    parameters = (
        Parameter("a", "rad", 0.0001, 0.03, "amplitude"),
        Parameter("harmonic", "1/rad", 1.0, 160.0, "n, periods per 2 pi"),
        Parameter("phi", "rad", -3.1416, 3.1416, "phase", bounded=False),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        (joint,) = place.joints
        unit = travel_unit(trial, joint)
        grid = tuple({"k": k / unit} for k in (*HARMONICS, *RATIOS))
        limits = {"k": (0.8 / unit, 250.0 / unit)}
        return (
            PeriodicError(place=place, amplitudes=("sine", "cosine"), shapes=grid, refine=limits, step=0.01),
        )


class PeriodicError(Form):
    """An error of the reading that repeats with the angle."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        joint, motion = self.joint, trial.motion
        q = shape["k"] * motion.full_position[:, joint]
        error = motion.reduce(np.stack([np.sin(q), np.cos(q)], axis=1)).T
        # The rotor's share of the torque is reckoned from the same reading as the arm's.
        rotor = -trial.rotor[joint] * np.stack([motion.second_derivative(e) for e in error])
        # So is what the motor is said to lose to its speed.
        rotor -= trial.lost_to_speed[joint] * np.stack([motion.derivative(e) for e in error])
        channel = drive_channel(trial.channels)
        lost: Columns = {(channel, joint): rotor} if channel in trial.channels else {}
        return add(trial.link(trial.deflection(joint, error)), lost)

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(2), np.full(2, 0.01)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Over a short travel a long wave is constant: an encoder's offset under another name.
        angle = shape["k"] * trial.motion.q[:: max(1, len(trial) // 200), self.joint]
        wave = amplitudes[0] * np.sin(angle) + amplitudes[1] * np.cos(angle)
        return bool(np.std(wave) > LEAST_WAVE * np.sqrt(np.mean(wave**2)))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        a, b = amplitudes
        return {"a": float(np.hypot(a, b)), "harmonic": shape["k"], "phi": float(np.arctan2(b, a))}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if abs(shape["k"] - 1.0) > 0.05:
            return None  # the simulator's reading errs once per turn
        a, b = amplitudes
        return {
            "encoder_amplitude": self.at_joints(trial, np.hypot(a, b)),
            "encoder_phase": self.at_joints(trial, np.arctan2(b, a)),
        }


EFFECT = EncoderEccentricity()
