"""20: controller gain."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import track_joints
from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_law
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, PresentForm, Shape
from samrl_core.diagnosis.residuals.equations import TIMING_RATE_HZ, Columns
from samrl_core.diagnosis.residuals.laws.follow_command import sure_part
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise
from samrl_core.diagnosis.residuals.trial import Trial, add

CLIPPED = 0.01  # share of samples in the output's limit, from which on it hides what a gain does
FACTORS = (0.55, 0.7, 0.85, 1.18, 1.4)  # of a gain, from which the search begins
LEAST_FACTOR = 0.01  # a gain nearer to the described one is that one


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
        Parameter("eK", "1", -0.5, 0.5, "relative error of the stiffness; in a cascade of the position gain"),
        Parameter("eD", "1", -0.5, 0.5, "relative error of the damping; in a cascade of the velocity gain"),
        Parameter("eP", "1", -0.5, 0.5, "relative error of the punch, where there is one"),
        Parameter("sag", "rad", 0.001, 0.5, "how far a soft servo gives way over the poses, without torques"),
    )

    def acts_on_arm(self, trial: Trial) -> bool:
        return trial.joints > 1

    def why_unobservable(self, trial: Trial) -> str | None:
        if "tracking" in trial.channels and trial.motion.rate >= TIMING_RATE_HZ:
            return None
        if trial.shows_controller:
            return None
        return lacks_law(trial, "needs the command, the described controller, and what came of it")

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            return (Sag(name="sag", place=place, amplitudes=("constant", *trial.recording.arm.joints)),)
        controller = trial.recording.arm.controller
        assert controller is not None
        joints = list(place.joints)
        punch = controller.law.of_joints("punch", trial.joints)
        there = (("eK", controller.stiffness), ("eD", controller.damping), ("eP", punch))
        names = tuple(name for name, gain in there if np.any(gain[joints] > 0))
        if not names:  # a joint that nothing drives
            return ()
        gains = ScaledGains(name="gains", place=place, amplitudes=names)
        if "eK" not in names or controller.law.cascaded or not clips(trial, place):
            return (gains,)
        shapes = tuple({"factor": k} for k in FACTORS)
        bounds = {"factor": (0.4, 1.8)}
        return (
            gains,
            ClippedGain(name="clipped", place=place, amplitudes=("present",), shapes=shapes, refine=bounds),
        )


class ScaledGains(Form):
    """Stiffness, damping and punch off by a factor each.

    In a cascade the position gain acts through the velocity gain: the stiffness is their product, and before
    the integral the position gain stands alone. Amplitudes are those of the product and of the velocity gain.
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        terms = sure_terms(trial)
        rows = -np.stack([terms[name] for name in self.amplitudes])
        return add(*(trial.controller(j, rows[:, :, j]) for j in self.place.joints))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.amplitudes)
        return np.zeros(count), np.full(count, 0.3)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        found = self._factors(trial, amplitudes)
        controller = trial.recording.arm.controller
        assert controller is not None
        if controller.law.cascaded and "eK" in found:
            found["eK"] = (1.0 + found["eK"]) / max(1.0 + found.get("eD", 0.0), 0.1) - 1.0
        return found

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        fields = {"eK": "stiffness_scale", "eD": "damping_scale"}  # a punch moves nothing for long
        return {
            fields[name]: self.at_joints(trial, 1.0 + value, 1.0)
            for name, value in self._factors(trial, amplitudes).items()
            if name in fields
        }

    def _factors(self, trial: Trial, amplitudes: np.ndarray) -> dict[str, float]:
        """Relative errors of the law's own terms."""
        found = dict(zip(self.amplitudes, map(float, amplitudes), strict=True))
        if trial.motion.computed and "eK" in found:
            # Of the spring that was there, not of the one described: see `ActuatorGain`.
            found["eK"] = found["eK"] / max(1.0 - found["eK"], 0.1)
        return found


class ClippedGain(PresentForm):
    """A stiffness off by a factor, before a limit that the output reaches: its torque is not linear in it.

    Where the nominal output is clipped and the true one is not, or the reverse, the difference depends on
    both. Left out there, a gain leaves what a delay then seems to explain.
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        rows = self.lacks(trial, shape["factor"])
        return add(*(trial.controller(j, rows[None, :, j]) for j in self.place.joints))

    def lacks(self, trial: Trial, factor: float) -> np.ndarray:
        """Torque at standstill (F, J) of the described law less that of `factor` times its stiffness."""
        motion = trial.motion
        law, limit = motion.described_law, motion.limit()
        spring, nominal = law.spring + law.stiff_integral, law.total
        real = nominal + (factor - 1.0) * spring
        # By the model where both are within the limit, as in `ScaledGains`.
        sprung = trial.delivered_torque + motion.back_emf_loss - (nominal - spring)
        within = (np.abs(nominal) < limit) & (np.abs(real) < limit)
        clipped = np.clip(nominal, -limit, limit) - np.clip(real, -limit, limit)
        return np.where(within, (1.0 / factor - 1.0) * sprung, clipped)

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        return abs(shape["factor"] - 1.0) > LEAST_FACTOR

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"eK": shape["factor"] - 1.0}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {"stiffness_scale": self.at_joints(trial, shape["factor"], 1.0)}


def clips(trial: Trial, place: Place) -> bool:
    """Whether a computed law spends more than `CLIPPED` of the time in the limit of its output."""
    motion = trial.motion
    if not motion.computed:
        return False
    beyond = np.abs(motion.described_law.total) >= motion.limit()
    return bool(np.mean(beyond[:, list(place.joints)]) > CLIPPED)


def sure_terms(trial: Trial) -> dict[str, np.ndarray]:
    """The law's terms (F, J) per parameter, without noise that the controller did not read itself.

    The residual holds that noise, and a weaker law would seem to explain it.
    """
    key = ("sure", "law")
    if key not in trial.cached:
        law = trial.motion.described_law
        terms = np.stack([law.spring + law.stiff_integral, law.damper - law.stiff_integral, law.punch])
        terms = _terms_by_model(trial) if trial.motion.computed else sure_part(trial.motion, terms)
        trial.cached[key] = dict(zip(("eK", "eD", "eP"), terms, strict=True))
    found: dict[str, np.ndarray] = trial.cached[key]
    return found


def _terms_by_model(trial: Trial) -> np.ndarray:
    """The same (3, F, J) of a law that stands for the torque: its spring is what the model needs.

    Against what tolerances of masses say, a law would seem to explain their noise. Nothing changes where the
    output is clipped anyway.
    """
    motion, law = trial.motion, trial.motion.described_law
    done = trial.delivered_torque + motion.back_emf_loss
    spring = done - law.damper - law.punch - (law.integral - law.stiff_integral) - law.rest
    calm = motion.sure(law.damper, white_noise(law.damper, motion.rate))
    terms = np.stack([spring, calm - law.stiff_integral, law.punch])
    return np.asarray(terms * (np.abs(law.total) < motion.limit()))


class Sag(Form):
    """Error of a servo without integral part: weight over stiffness, linear in the commanded pose."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        command = trial.motion.command
        assert command is not None and command.position is not None
        pose = trial.motion.reduce(command.position)
        terms = np.vstack([np.ones(len(pose)), pose.T])
        return track_joints(trial, self.place, lambda _: terms)

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        count = (1 + trial.joints) * len(self.place.joints)
        return np.zeros(count), np.full(count, 0.1)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        joints, names = self.place.joints, trial.recording.arm.joints
        columns = self.columns(trial, shape)
        spans = {j: float(np.ptp(amplitudes @ columns["tracking", j])) for j in joints}
        return {"sag" if len(joints) == 1 else f"sag[{names[j]}]": span for j, span in spans.items()}


EFFECT = ControllerGain()
