"""25: link inertia."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.load.payload import INERTIAL
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

    def why_unobservable(self, trial: Trial) -> str | None:
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        return (AtLink(place=place, amplitudes=INERTIAL),)


class AtLink(Form):
    """Inertial parameters of a link."""

    def link(self, trial: Trial) -> int:
        """Index of the link."""
        assert trial.rigid is not None
        return trial.rigid.links.index(self.place.name.partition(":")[2])

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(np.moveaxis(trial.regressor[:, :, self.link(trial), :], 2, 0))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        assert trial.rigid is not None
        nominal = trial.rigid.inertial_parameters[self.link(trial)]
        mass, size = max(nominal[0], 0.1), np.linalg.norm(nominal[1:4]) / max(nominal[0], 0.1)
        inertia = max(float(np.trace(_matrix(nominal))) / 3.0, 1e-4)
        return np.zeros(10), np.array([0.1 * mass] + [0.1 * mass * max(size, 0.05)] * 3 + [0.2 * inertia] * 6)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"mass": float(amplitudes[0]), "first_moment": float(np.linalg.norm(amplitudes[1:4]))}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        delta = np.zeros((trial.joints, 10))
        delta[self.link(trial)] = amplitudes
        return {"inertial_delta": delta}


def _matrix(p: np.ndarray) -> np.ndarray:
    return np.array([[p[4], p[5], p[7]], [p[5], p[6], p[8]], [p[7], p[8], p[9]]])


EFFECT = LinkInertia()
