"""25: link inertia."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.load.payload import INERTIAL, point_inertia
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

SCALES = 0.3  # spread of a link's scale before any data
LEAST, MOST = 0.2, 5.0  # factors between which a link's numbers are off by a factor
BESIDE = 0.1  # of its distance from the joint: spread of a link's centre of mass before any data
LEAST_BESIDE = 0.01  # the same of a link whose centre lies on its joint [m]


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
        Parameter("mass_error", "1", -0.5, 1.0, "relative change of mass, first moment and inertia alike"),
        Parameter("com_shift", "m", 0.0, 0.1, "of the centre of mass alone, what the torques show of it"),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        return lacks_link_torque(trial)

    def places(self, trial: Trial) -> tuple[Place, ...]:
        """All links: the last one's scale is told from a payload, whatever else of it is not."""
        assert trial.rigid is not None
        return tuple(Place.find(trial, f"link:{name}") for name in trial.rigid.links)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        assert trial.rigid is not None
        scaled = ScaledLink(name="scale", place=place, amplitudes=("s",))
        shifted = ShiftedLink(name="centre of mass", place=place, amplitudes=("x", "y", "z"))
        if place.name == f"link:{trial.rigid.links[-1]}":
            return scaled, shifted
        return AtLink(place=place, amplitudes=INERTIAL), scaled, shifted


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


class ScaledLink(AtLink):
    """Mass, first moments and inertia of a link off by one factor: its density, or a wrong part in the model.

    With one amplitude it competes with a scale of the whole model on even terms.
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        k = self.link(trial)
        assert trial.rigid is not None
        return trial.link((trial.regressor[:, :, k, :] @ trial.rigid.inertial_parameters[k])[None])

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, SCALES)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(LEAST < 1.0 + amplitudes[0] < MOST)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        assert trial.rigid is not None
        nominal = trial.rigid.inertial_parameters[self.link(trial)]
        moment = float(np.linalg.norm(nominal[1:4]))
        share = float(amplitudes[0])
        return {"mass": share * float(nominal[0]), "first_moment": abs(share) * moment, "mass_error": share}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        assert trial.rigid is not None
        k = self.link(trial)
        delta = np.zeros((trial.joints, 10))
        delta[k] = amplitudes[0] * trial.rigid.inertial_parameters[k]
        return {"inertial_delta": delta}


class ShiftedLink(AtLink):
    """A link's centre of mass lies elsewhere, its mass and its inertia about that centre are right.

    What a wrong origin of the inertial frame does, or a part mounted on the other side. Inertia about the
    joint goes with it by the parallel axes, to first order of the shift.
    """

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(np.moveaxis(trial.regressor[:, :, self.link(trial), :] @ self._units(trial), 2, 0))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        _, centre = self._nominal(trial)
        return np.zeros(3), np.full(3, max(BESIDE * float(np.linalg.norm(centre)), LEAST_BESIDE))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        mass, _ = self._nominal(trial)
        shift = float(np.linalg.norm(amplitudes))
        return {"first_moment": mass * shift, "com_shift": shift}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        delta = np.zeros((trial.joints, 10))
        delta[self.link(trial)] = self._units(trial) @ amplitudes
        return {"inertial_delta": delta}

    def _nominal(self, trial: Trial) -> tuple[float, np.ndarray]:
        """Mass [kg] and centre of mass (3,) [m] by the model, in the joint's frame."""
        assert trial.rigid is not None
        nominal = trial.rigid.inertial_parameters[self.link(trial)]
        mass = float(nominal[0])
        return mass, nominal[1:4] / mass if mass > 0.0 else np.zeros(3)

    def _units(self, trial: Trial) -> np.ndarray:
        """Inertial parameters (10, 3) by a metre of shift along each axis."""
        mass, centre = self._nominal(trial)
        out = np.zeros((10, 3))
        for k, axis in enumerate(np.eye(3)):
            out[1:4, k] = mass * axis
            both = point_inertia(centre + axis) - point_inertia(centre) - point_inertia(axis)  # first order
            out[4:, k] = mass * both
        return out


def _matrix(p: np.ndarray) -> np.ndarray:
    return np.array([[p[4], p[5], p[7]], [p[5], p[6], p[8]], [p[7], p[8], p[9]]])


EFFECT = LinkInertia()
