"""25: link inertia."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial


class LinkInertia(Effect):
    """A link's mass, centre of mass or inertia is not the model's."""

    family, number, title = "link_inertia", 25, "Link inertia"
    meaning = "A link's mass, centre of mass or inertia differs from the model."
    remedy = "Correct the link's inertial values in the model, and look for parts mounted on the link."
    formula = "inertial parameters of the link + delta"
    source = "CAD against weighed parts: 1-5 %"
    acts_on = "dynamics"
    place_kind = "link"
    excitation = "exciting trajectories over the whole workspace"
    curve_over = "position"
    confounded_with = ("payload", "reflected_inertia", "cable")
    parameters = (
        Parameter("mass", "kg", -1.0, 1.0, "beyond nominal; base parameters only are seen"),
        Parameter("first_moment", "kg m", 0.0, 0.2, "length of the change of mass times centre"),
    )

    def places(self, trial: Trial) -> tuple[str, ...]:
        # A mass on the last link and one in the gripper are the same to every joint: that is a payload.
        return super().places(trial)[:-1]

    def unobservable(self, trial: Trial) -> str | None:
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            return "needs a torque and a dynamic model"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return (Form("", ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        assert trial.rigid is not None
        link = trial.rigid.links.index(place.partition(":")[2])
        return trial.link(np.moveaxis(trial.regressor[:, :, link, :], 2, 0))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        assert trial.rigid is not None
        link = trial.rigid.links.index(place.partition(":")[2])
        nominal = trial.rigid.inertial_parameters[link]
        mass, size = max(nominal[0], 0.1), np.linalg.norm(nominal[1:4]) / max(nominal[0], 0.1)
        inertia = max(float(np.trace(_matrix(nominal))) / 3.0, 1e-4)
        return np.zeros(10), np.array([0.1 * mass] + [0.1 * mass * max(size, 0.05)] * 3 + [0.2 * inertia] * 6)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"mass": float(amplitudes[0]), "first_moment": float(np.linalg.norm(amplitudes[1:4]))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        assert trial.rigid is not None
        delta = np.zeros((trial.joints, 10))
        delta[trial.rigid.links.index(place.partition(":")[2])] = amplitudes
        return {"inertial_delta": delta}


def _matrix(p: np.ndarray) -> np.ndarray:
    return np.array([[p[4], p[5], p[7]], [p[5], p[6], p[8]], [p[7], p[8], p[9]]])


EFFECT = LinkInertia()
