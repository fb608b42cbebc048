"""20: controller gain."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.residuals.equations import TIMING_RATE_HZ, Columns
from samrl_core.diagnosis.residuals.trial import Trial, add


class ControllerGain(Effect):
    """The controller's gains are not those that it is described with."""

    family, number, title = "controller_gain", 20, "Controller gain"
    meaning = "The controller runs with other stiffness or damping than described."
    remedy = "Compare the gains on the machine with the description and correct whichever is wrong."
    formula = "u = (1 + eK) K (q_d - q) + (1 + eD) D (dq_d - dq) + ..."
    source = "gains scaled in firmware; +-30 %"
    acts_on = "dynamics"
    excitation = "steps, at two gain sets"
    experiment = "two_gains"
    confounded_with = ("actuator_gain", "reflected_inertia")
    parameters = (
        Parameter("eK", "1", -0.5, 0.5, "relative error of the stiffness"),
        Parameter("eD", "1", -0.5, 0.5, "relative error of the damping"),
        Parameter("sag", "rad", 0.001, 0.5, "how far a soft servo gives way over the poses, without torques"),
    )

    def places(self, trial: Trial) -> tuple[str, ...]:
        return super().places(trial) + (f"arm:{trial.recording.arm.role}",)

    def unobservable(self, trial: Trial) -> str | None:
        if "tracking" in trial.channels and trial.motion.rate >= TIMING_RATE_HZ:
            return None
        if "controller" in trial.channels:
            return None
        return "needs command, commanded effort and the described controller"

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            joints = trial.recording.arm.joints
            return (Form("sag", ("constant", *joints)),)
        return (Form("gains", ("eK", "eD")),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        if form == "sag":
            return self._sag(trial, self.joints_at(trial, place))
        motion, command, controller = trial.motion, trial.motion.command, trial.recording.arm.controller
        assert command is not None and command.position is not None and command.velocity is not None
        assert controller is not None and motion.raw_position is not None
        speed = motion.raw_velocity if motion.raw_velocity is not None else motion.full_velocity
        spring = controller.stiffness * (command.position - motion.raw_position)
        damper = controller.damping * (command.velocity - speed)
        rows = -np.stack([spring, damper])
        return add(*(trial.controller(j, rows[:, :, j]) for j in self.joints_at(trial, place)))

    def _sag(self, trial: Trial, joints: tuple[int, ...]) -> Columns:
        """Error of a servo without integral part: weight over stiffness, linear in the commanded pose."""
        command = trial.motion.command
        assert command is not None and command.position is not None
        pose = trial.motion.reduce(command.position)
        terms = np.vstack([np.ones(len(pose)), pose.T])
        out: Columns = {}
        for i, j in enumerate(joints):
            rows = np.zeros((len(joints) * len(terms), len(pose)))
            rows[i * len(terms) : (i + 1) * len(terms)] = terms
            out |= trial.tracking(j, rows)
        return out

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        if form == "sag":
            count = (1 + trial.joints) * len(self.joints_at(trial, place))
            return np.zeros(count), np.full(count, 0.1)
        return np.zeros(2), np.full(2, 0.3)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        if form == "sag":
            joints = self.joints_at(trial, place)
            columns = self._sag(trial, joints)
            names = trial.recording.arm.joints
            spans = {j: float(np.ptp(amplitudes @ columns["tracking", j])) for j in joints}
            return {"sag" if len(joints) == 1 else f"sag[{names[j]}]": span for j, span in spans.items()}
        return {"eK": float(amplitudes[0]), "eD": float(amplitudes[1])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "sag":
            return None
        joints = self.joints_at(trial, place)
        return {
            "stiffness_scale": at_joint(trial, joints, 1.0 + amplitudes[0], 1.0),
            "damping_scale": at_joint(trial, joints, 1.0 + amplitudes[1], 1.0),
        }


EFFECT = ControllerGain()
