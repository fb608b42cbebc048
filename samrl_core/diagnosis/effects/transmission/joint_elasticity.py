"""11: joint elasticity."""

from __future__ import annotations

import numpy as np
from scipy import signal

from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.transmission.deflection import Deflection, TwistForm
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.laws.follow_command import span_of_command
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.sprung_link import sprung_link

STIFF = (1.5, 4.0, 10.0, 25.0, 60.0, 150.0, 350.0)  # [1/rad] grid of stiffness over effort limit
STIFFEST = 400.0  # [1/rad] stiffness over effort limit, 1.7 times what is known of drives: no more is elastic
# Of the largest torque: where a hardening spring is twice as stiff as a straight one.
HARDENS = (0.5, 1.0, 2.0)
SURE = 2.0  # times noise: its power in a spectrum of a few averages exceeds that seldom
STEP_PHASE = 0.01  # [rad] of a swing per step of integration
MOST_STEPS = 16  # per sample
DAMPING_S = 0.002  # of stiffness: lightly damped


class JointElasticity(Deflection):
    """The joint twists under torque, like a spring between motor and link."""

    family, number, title = "joint_elasticity", 11, "Joint elasticity"
    meaning = "The transmission twists under load like a spring, so link and motor angle differ and resonate."
    remedy = "Model the joint with its stiffness, and keep control bandwidth and motions below the resonance."
    formula = "q_link = q_motor - x, tau = K x or K x (1 + (K x / F)^2), with the link swinging on K"
    source = "Spong 1987; hardening: Tuttle and Seering 1996; harmonic drives of this size: 5e3-2e4 N m/rad"
    excitation = "chirp of 1-20 Hz"
    experiment = "chirp"
    confounded_with = ("backlash", "command_delay", "mount_compliance")
    parameters = (
        Parameter("K", "N m/rad", 500.0, 50000.0, "joint stiffness, of a hardening spring at no twist"),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        static = StraightSpring(name="static", place=place, amplitudes=("compliance",))
        if "tracking" in trial.channels:
            return (static,)
        (joint,) = place.joints
        scale = float(trial.scale[joint])
        grid = tuple({"K": s * scale, "d": DAMPING_S * s * scale} for s in STIFF)
        limits = {"K": (0.5 * scale, 3000.0 * scale), "d": (1e-4 * scale, 5.0 * scale)}
        most = max(float(np.max(np.abs(trial.transmitted[:, joint]))), 1e-3)
        steps = tuple({"F": f * most} for f in HARDENS)
        return (
            static,
            SwingingLink(name="swinging", place=place, amplitudes=("present",), shapes=grid, refine=limits),
            HardeningSpring(
                name="hardening",
                place=place,
                amplitudes=("compliance",),
                shapes=steps,
                refine={"F": (0.1 * most, 5.0 * most)},
            ),
        )


class SpringForm(TwistForm):
    """A spring without mass, whose amplitude is its compliance.

    Where one torque alone is known, its noise and that of the rotor's accelerations weigh more, twice
    differenced, than what the spring does. What follows from the command holds neither.
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        rows, motion = super().columns(trial, shape), trial.motion
        if not {"controller", "dynamics"} <= set(trial.channels) or motion.command is None:
            return rows
        key = ("follows", str(self.joint))
        if key not in trial.cached:
            trial.cached[key] = span_of_command(motion, self.joint)
        span: np.ndarray = trial.cached[key]
        return {at: (row @ span) @ span.T for at, row in rows.items()}

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.02 / trial.scale[self.joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        if "tracking" in trial.channels:
            return True
        stiffness = self.parameters(trial, shape, amplitudes)["K"]
        return bool(amplitudes[0] > 0 and stiffness < STIFFEST * trial.scale[self.joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"K": float(1.0 / max(abs(amplitudes[0]), 1e-12))}


class StraightSpring(SpringForm):
    """Twist in proportion to the torque."""

    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        return torque[None] - np.mean(torque) * (1.0 if "tracking" in trial.channels else 0.0)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if "tracking" in trial.channels:
            return None
        stiffness = self.parameters(trial, shape, amplitudes)["K"]
        return {"joint_stiffness": self.at_joints(trial, stiffness, np.inf)}


class HardeningSpring(SpringForm):
    """A cubic spring."""

    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        return hardened(torque, shape["F"])[None]

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # The simulator's spring is straight.
        return {"joint_stiffness": self.at_joints(trial, self.line(trial, shape, amplitudes), np.inf)}


class SwingingLink(Form):
    """The link swings on its spring.

    Near its resonance it answers most to what the motor hardly does: there a reading's noise, times the
    resonance, would be nearly all of the column. So each frequency counts by the share that is motion.
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        angle = trial.motion.reduce(self.twist(trial, shape))
        rows = trial.link(trial.deflection(self.joint, angle[None]))
        share = self.share_of_motion(trial, angle, shape)
        return {key: _weigh(row, share, trial.motion.dt) for key, row in rows.items()}

    def twist(self, trial: Trial, shape: Shape) -> np.ndarray:
        """Deflection (F,) [rad] of the link under the torque that it would take to follow what was read."""
        motion, key = trial.motion, ("as read", "torque")
        assert trial.rigid is not None
        if key not in trial.cached:
            trial.cached[key] = trial.rigid.inverse_dynamics(
                motion.full_position, motion.full_velocity, motion.full_acceleration
            )
        torque = trial.cached[key][:, self.joint]
        inertia = np.interp(motion.time, motion.t, trial.mass[:, self.joint, self.joint])
        # Steps of the log would damp a swing by half its phase per step.
        mean = float(np.mean(inertia))  # of a nominal model without inertia none: it swings at any rate
        phase = np.sqrt(shape["K"] / mean) / motion.rate if mean > 0.0 else np.inf
        steps = int(np.clip(np.ceil(phase / STEP_PHASE), 1, MOST_STEPS))
        ticks = np.arange(len(torque))
        fine = np.minimum(np.arange(len(torque) * steps) / steps, ticks[-1])
        load, mass = np.interp(fine, ticks, torque), np.interp(fine, ticks, inertia)
        # The weight of a link that gives way pulls it back, or further.
        held = shape["K"] + max(float(np.mean(trial.stiffness[:, self.joint, self.joint])), -0.5 * shape["K"])
        # Most logs begin at rest. An acceleration twice differenced at a log's end is a kick that rings on.
        weight = float(trial.rigid.gravity(motion.full_position[:1])[0, self.joint])
        return sprung_link(load, mass, held, shape["d"], 0.0, 1.0 / (motion.rate * steps), weight)[::steps]

    def share_of_motion(self, trial: Trial, angle: np.ndarray, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz] and the share of a deflection (N,) that is no answer to a reading's noise.

        Wiener's filter, with the noise's spectrum from its level and the spring's response.
        """
        motion = trial.motion
        swing = motion.second_derivative(angle)
        if not np.isfinite(swing).all():
            return np.zeros(2), np.ones(2)
        frequency, power = signal.welch(swing, fs=1.0 / motion.dt, nperseg=min(256, len(swing)))
        turn = 2.0 * np.pi * frequency
        masses = np.mean(trial.mass[:, self.joint] ** 2, axis=0)  # every joint's noise pushes this link
        inertia, read = np.sqrt(masses[self.joint]), motion.reading
        pushed = float(masses @ read.deviation**2) * 2.0 / motion.rate * turn ** (2 * read.order)
        answer = turn**2 / np.abs(shape["K"] - inertia * turn**2 + 1j * shape["d"] * turn)
        noise = pushed * answer**2
        return frequency, np.clip(1.0 - SURE * noise / np.maximum(power, 1e-300), 0.0, 1.0)

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.ones(1), np.full(1, 0.05)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0 and shape["K"] < STIFFEST * trial.scale[self.joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"K": shape["K"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {
            "joint_stiffness": self.at_joints(trial, shape["K"], np.inf),
            "joint_damping": self.at_joints(trial, shape["d"]),
        }


def _weigh(rows: np.ndarray, share: tuple[np.ndarray, np.ndarray], spacing: float) -> np.ndarray:
    """Rows (p, N), each frequency [Hz] times its share, at samples so far apart [s]."""
    count = rows.shape[1]
    wide = np.concatenate([rows[:, :0:-1], rows, rows[:, -2::-1]], axis=1)
    gain = np.interp(np.fft.rfftfreq(wide.shape[1], spacing), *share)
    return np.fft.irfft(np.fft.rfft(wide, axis=1) * gain, wide.shape[1], axis=1)[:, count - 1 : 2 * count - 1]


def hardened(torque: np.ndarray, level: float) -> np.ndarray:
    """K x (N,) [N m] of a cubic spring under a torque: torque = K x (1 + (K x / level)^2).

    The only real root (Cardano, in hyperbolic form).
    """
    root = np.sqrt(3.0) / 2.0
    return level / root * np.sinh(np.arcsinh(3.0 * root * torque / level) / 3.0)


EFFECT = JointElasticity()
