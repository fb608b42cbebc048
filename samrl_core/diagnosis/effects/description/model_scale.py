"""50: model scale."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.load.payload import is_driven
from samrl_core.diagnosis.residuals.equations import Columns, drive_channel
from samrl_core.diagnosis.residuals.laws.follow_command import sure_part
from samrl_core.diagnosis.residuals.trial import Trial

LEAST, MOST = 0.2, 5.0  # factors between which a description is off by a factor


class ModelScale(Effect):
    """An error of the description: all masses, or all torques, are off by one factor."""

    family, number, title = "model_scale", 50, "Scale of the model"
    meaning = (
        "All masses of the model, or all torques of the log, are off by one factor: the description errs."
    )
    remedy = (
        "Check the masses of the URDF against the data sheet, and torque constants, gear ratios and units of "
        "the logged effort."
    )
    formula = "tau = factor x inverse dynamics(q, dq, ddq)"
    source = "URDFs from CAD with one density; efforts logged in amperes, or before the gear"
    of_description = True
    acts_on = "dynamics"
    place_kind = "arm"
    excitation = "static poses and fast motion"
    experiment = "multisine"
    curve_over = "position"
    confounded_with = ("actuator_gain", "payload", "link_inertia", "torque_sensor_error")
    parameters = (
        Parameter("masses", "1", 0.4, 2.5, "true masses over those of the model"),
        Parameter("torques", "1", 0.4, 2.5, "logged torques over true ones"),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        if not is_driven(trial):
            return "needs a torque: nothing drives the joints, and a factor of all masses is one of friction"
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        masses = AllMasses(name="masses", place=place, amplitudes=("s",))
        torques = AllTorques(name="torques", place=place, amplitudes=("s",))
        # One link alone that is off by a factor is that link's error, and nothing else would be said.
        scales: tuple[Form, ...] = (masses,) if trial.joints > 1 else ()
        # Where nothing drives the machine, what all masses are off by drops out but for its friction, which
        # is that much larger then; and a factor of a torque that is zero would move nothing.
        if not is_driven(trial):
            return ()
        scales = (*scales, torques)
        if "controller" not in trial.channels:
            return scales
        return *scales, LoggedTorques(name="torques as logged", place=place, amplitudes=("s",))


class AllMasses(Form):
    """Every link's inertial parameters times one plus the amplitude."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(trial.model_torque[None])

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.3)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(LEAST < 1.0 + amplitudes[0] < MOST)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"masses": float(1.0 + amplitudes[0])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        assert trial.rigid is not None
        return {"inertial_delta": amplitudes[0] * trial.rigid.inertial_parameters}


class AllTorques(AllMasses):
    """Every torque behind the controller is the true one times one plus the amplitude."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        out = trial.link(trial.model_torque[None])
        # By the model's motion: a share of the logged torque would hold the friction that is left over.
        rotor = trial.motion.reduce(trial.rotor_share)
        for j in range(trial.joints):
            channel = drive_channel(trial.channels)
            key = (channel, j)
            if channel in trial.channels and np.any(rotor[:, j]):
                out[key] = out.get(key, 0.0) + rotor[None, :, j]
        return out

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"torques": float(1.0 + amplitudes[0])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        gain = self.at_joints(trial, 1.0 / (1.0 + amplitudes[0]) - 1.0)
        if "drive" in trial.channels:
            return None  # both torques off by one factor is no difference that the simulated drive knows
        return {"actuator_gain": gain}


class LoggedTorques(AllTorques):
    """The same of the log alone: what the controller asked for was logged with the factor too."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        out = super().columns(trial, shape)
        law = trial.equations.law
        assert law is not None
        # What the drives read and nobody logged is in the log's torque too.
        asked = trial.motion.reduce(sure_part(trial.motion, law[None])[0])
        for j in range(trial.joints):
            out["controller", j] = -asked[None, :, j]
        return out

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return None  # nothing of the machine differs


EFFECT = ModelScale()
