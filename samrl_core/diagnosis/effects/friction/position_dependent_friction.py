"""7: position-dependent friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.trial import Trial

EVERYWHERE = "friction everywhere"  # positive all over the turn: a level with two harmonics
WAVES = tuple({"k": k} for k in (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0))
LEAST_NEGATIVE = 0.25  # of the largest friction: what missing harmonics may make negative somewhere
LEAST_WAVE = 0.25  # of a harmonic's root mean square that must vary over the travel
LEAST_CHANGE = 0.1  # likewise of a friction with a level, which for the rest is Coulomb's


class PositionDependentFriction(DriveTorque):
    """Torque or friction that repeats with the joint's position: tight spots, eccentric bearings."""

    family, number, title = "position_dependent_friction", 7, "Position-dependent friction"
    meaning = "Friction changes with joint angle and repeats there, as with a bent shaft or an uneven gear."
    remedy = "Add a friction table over the angle; inspect the bearing at the angles where the curve peaks."
    formula = "tau_f = a sin(k q + phi) (tanh(dq / v) or 1), or (level + a sin(k q + phi) + 2k) tanh(dq / v)"
    source = (
        "harmonics shrink the gap of a real Panda by 0.15-0.2; friction over a turn as a Fourier series of "
        "low orders: Popovic and Goldenberg 1998; Garcia et al. 2002"
    )
    excitation = "slow sweep over the whole range, both ways"
    experiment = "sweep"
    curve_over = "position"
    renamed_shapes = ("k",)
    confounded_with = ("cable", "gear_ripple", "payload")
    parameters = (
        Parameter("amplitude", "N m", 0.05, 0.5, "of the harmonic"),
        Parameter("order", "1/rad", 1.0, 12.0, "periods per 2 pi"),
        Parameter("phase", "rad", -3.1416, 3.1416, "of the sine", bounded=False),
        Parameter("level", "N m", 0.0, 1.5, "mean over the turn, of a friction that is one everywhere"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        grid = tuple({"k": float(k)} for k in (1, 2, 3, 4, 6, 8, 12))
        limits = {"k": (0.7, 15.0)}
        return (
            Form("friction", ("sine", "cosine"), grid, limits),
            Form("torque", ("sine", "cosine"), grid, limits),
            # Orders in steps that the travel tells apart.
            Form(EVERYWHERE, ("level", "sine", "cosine", "sine2", "cosine2"), WAVES, limits),
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        angle = shape["k"] * trial.motion.full_position[:, joint]
        rows = _rows(form, angle)
        if form != "torque":
            rows = rows * smooth_sign(trial.motion.full_velocity[:, joint], 0.005)
        return rows

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.full(5 if form == EVERYWHERE else 2, 0.05 * trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Over a short travel a long wave is constant: Coulomb friction under another name.
        (joint,) = self.joints_at(trial, place)
        wave = _wave(form, shape["k"] * trial.motion.q[:: max(1, len(trial) // 200), joint], amplitudes)
        if form == EVERYWHERE:
            # Also where the joint has not been: else a short travel is fitted by huge waves that cancel.
            turn = _wave(form, np.linspace(0.0, 2.0 * np.pi, 60), amplitudes)
            if np.min(turn) < -LEAST_NEGATIVE * np.max(turn):
                return False
        least = LEAST_CHANGE if form == EVERYWHERE else LEAST_WAVE
        return bool(np.std(wave) > least * np.sqrt(np.mean(wave**2)))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        a, b = amplitudes[-4:-2] if form == EVERYWHERE else amplitudes
        found = {"amplitude": float(np.hypot(a, b)), "order": shape["k"], "phase": float(np.arctan2(b, a))}
        return {**found, "level": float(amplitudes[0])} if form == EVERYWHERE else found

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        head = "harmonic" if form == "torque" else "friction_harmonic"
        # The simulator knows one harmonic of friction, upon a level. A friction is lost as the residual
        # counts it; a torque is added by the simulator.
        level, a, b = amplitudes[:3] if form == EVERYWHERE else (0.0, *amplitudes)
        if form == "torque":
            a, b = -a, -b
        return {
            "coulomb": at_joint(trial, joints, level),
            f"{head}_amplitude": at_joint(trial, joints, np.hypot(a, b)),
            f"{head}_order": at_joint(trial, joints, shape["k"]),
            f"{head}_phase": at_joint(trial, joints, np.arctan2(b, a)),
        }


def _rows(form: str, angle: np.ndarray) -> np.ndarray:
    """Waves (p, ...) over an angle, one for each amplitude."""
    rows = [np.sin(angle), np.cos(angle)]
    if form == EVERYWHERE:
        rows = [np.ones_like(angle), *rows, np.sin(2 * angle), np.cos(2 * angle)]
    return np.stack(rows)


def _wave(form: str, angle: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Torque or friction [N m] over an angle."""
    return np.asarray(amplitudes @ _rows(form, angle))


EFFECT = PositionDependentFriction()
