"""24: payload."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial


class Payload(Effect):
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

    def unobservable(self, trial: Trial) -> str | None:
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            return "needs a torque and a dynamic model"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return (Form("", ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        return trial.link(np.moveaxis(trial.regressor[:, :, -1, :], 2, 0))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(10), np.array([1.0, 0.15, 0.15, 0.15] + [0.03] * 6)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(abs(amplitudes[0]) > 1e-4)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        assert trial.rigid is not None
        mass = float(amplitudes[0])
        center = (
            trial.rigid.flange_in_joint.actInv(amplitudes[1:4] / mass) if abs(mass) > 1e-6 else np.zeros(3)
        )
        return {"mass": mass, "com_x": float(center[0]), "com_y": float(center[1]), "com_z": float(center[2])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        delta = np.zeros((trial.joints, 10))
        delta[-1] = amplitudes
        return {"inertial_delta": delta}


EFFECT = Payload()
