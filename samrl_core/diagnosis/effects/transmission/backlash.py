"""10: backlash."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import Deflection
from samrl_core.diagnosis.effects.transmission import tracked_gap
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

GAPS = (2e-4, 8e-4, 3e-3)  # [rad]
FLANK = 300.0  # [1/rad] stiffness of a tooth over effort limit, before it is searched
DAMPING_S = 0.002  # of stiffness
LEAST_GAP = 8e-5  # [rad] below it a gap is smaller than what encoders of arms resolve


class Backlash(Deflection):
    """Lost motion: the link is free within a gap, and jumps when the load changes sides."""

    family, number, title = "backlash", 10, "Backlash"
    meaning = "The gear has play: at load reversal the motor turns a little before the link follows."
    remedy = "Model the dead zone or preload the joint; if it exceeds the datasheet, have the gear serviced."
    formula = "q_link within q_motor +- b, free between, on a stiff flank beyond"
    source = "Nordin and Gutman 2002, Controlling mechanical systems with backlash"
    excitation = "load reversals, with both sides observed"
    experiment = "micro_reversals"
    confounded_with = ("joint_elasticity", "transmission_hysteresis", "coulomb_friction")
    parameters = (Parameter("b", "rad", 0.0001, 0.02, "half width of the gap"),)

    def places(self, trial: Trial) -> tuple[str, ...]:
        """Each joint; where only tracking is seen, also all of them."""
        every = "tracking" in trial.channels and trial.joints > 1
        return super().places(trial) + ((f"arm:{trial.recording.arm.role}",) if every else ())

    def unobservable(self, trial: Trial) -> str | None:
        return None if "tracking" in trial.channels else super().unobservable(trial)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            return tracked_gap.forms(trial)
        (joint,) = self.joints_at(trial, place)
        scale = float(trial.scale[joint])
        grid = tuple({"b": b, "K": FLANK * scale, "d": DAMPING_S * FLANK * scale} for b in GAPS)
        limits = {
            "b": (LEAST_GAP, 0.05),
            "K": (20.0 * scale, 5000.0 * scale),
            "d": (1e-3 * scale, 8.0 * scale),
        }
        return (Form("free", ("present",), grid, limits),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        if "tracking" in trial.channels:
            return tracked_gap.columns(trial, self.joints_at(trial, place), form, shape)
        (joint,) = self.joints_at(trial, place)
        angle = trial.motion.reduce(trial.sprung(joint, shape["K"], shape["d"], shape["b"]))
        return trial.link(trial.deflection(joint, angle[None]))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        if form == "free":
            return np.ones(1), np.full(1, 0.05)
        return tracked_gap.prior(self.joints_at(trial, place))

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0) if form == "free" else tracked_gap.admissible(form, amplitudes)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        if form == "free":
            return {"b": shape["b"]}
        return tracked_gap.physical(trial, self.joints_at(trial, place), amplitudes)

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form != "free":
            return None
        joints = self.joints_at(trial, place)
        return {
            "backlash": at_joint(trial, joints, shape["b"]),
            "joint_stiffness": at_joint(trial, joints, shape["K"], np.inf),
            "joint_damping": at_joint(trial, joints, shape["d"]),
        }


EFFECT = Backlash()
