"""24: payload."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


class PayloadEffect(Effect):
    """The arm carries another mass at its flange than the model knows."""

    family, number, title = "payload", 24, "Payload"
    meaning = "The mass at the flange, or where it is centred, differs from what the model carries."
    remedy = "Weigh the tool and enter mass and centre of mass; look for forgotten adapters or cables."
    formula = "inertial parameters of the last link + (m, m c, I)"
    source = "identification of payloads: Swevers et al. 2007"
    acts_on = "dynamics"
    place_kind = "arm"
    excitation = "static holds in five poses, wrist turns"
    experiment = "static"
    curve_over = "position"
    confounded_with = ("actuator_gain", "torque_sensor_error", "link_inertia", "base_tilt")
    parameters = (
        Parameter("mass", "kg", 0.05, 3.0, "beyond the nominal tool"),
        Parameter("com_x", "m", -0.2, 0.2, "in the flange frame"),
        Parameter("com_y", "m", -0.2, 0.2, "in the flange frame"),
        Parameter("com_z", "m", -0.2, 0.2, "in the flange frame"),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        return (AtFlange(place=place, amplitudes=INERTIAL),)


class AtFlange(Form):
    """Inertial parameters of the last link."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(np.moveaxis(trial.regressor[:, :, -1, :], 2, 0))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(10), np.array([1.0, 0.15, 0.15, 0.15] + [0.03] * 6)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(abs(amplitudes[0]) > 1e-4)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        assert trial.rigid is not None
        mass = float(amplitudes[0])
        center = (
            trial.rigid.flange_in_joint.actInv(amplitudes[1:4] / mass) if abs(mass) > 1e-6 else np.zeros(3)
        )
        return {"mass": mass, "com_x": float(center[0]), "com_y": float(center[1]), "com_z": float(center[2])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        delta = np.zeros((trial.joints, 10))
        delta[-1] = amplitudes
        return {"inertial_delta": delta}


EFFECT = PayloadEffect()
