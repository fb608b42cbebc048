"""24: payload."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
USUAL = np.array([1.0, 0.15, 0.15, 0.15] + [0.03] * 6)  # [kg, kg m, kg m2] that an arm may carry unannounced
USUAL_CARRIER = 4.0  # [kg] of moving links that carry as much; a lighter machine carries less
USUAL_ARM = 20.0  # [kg] of moving links, from which on the load grows with them: a UR5e's, which lifts 5 kg
DISTANCES = (0.02, 0.05, 0.1, 0.2, 0.4)  # [m] of a point from a small arm's flange, where the search begins
BESIDE = 0.1  # of its distance: standard deviation of what an axis of the flange leaves open
MOST_TAKEN = 0.5  # of the last link's inertia, off a machine that nothing drives
LEAST_SEEN = 0.01  # of the largest torque that a usual parameter makes: less does not tell a size


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
        longer = max(1.0, usual_mass(trial) ** (1.0 / 3.0))
        grid = tuple({"d": longer * d} for d in DISTANCES)
        limits = {"d": (DISTANCES[0] / 3.0, longer * DISTANCES[-1] * 1.5)}
        points = (
            PointOnAxis(
                name=f"on {'-' if way < 0 else ''}{axis}", place=place, amplitudes=("m",), shapes=grid,
                refine=limits, axis=k, way=way, thing=f"on {'-' if way < 0 else ''}{axis}",
            )
            for k, axis in enumerate("xyz")
            for way in (1.0, -1.0)
        )  # fmt: skip
        return AtFlange(place=place, amplitudes=INERTIAL), *points


class AtFlange(Form):
    """Inertial parameters of the last link."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(np.moveaxis(trial.regressor[:, :, -1, :], 2, 0))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        # A large arm's sizes on a small machine would cost evidence that any narrower effect saves. Lengths
        # go with the cube root of mass, as among machines of one density.
        mass = usual_mass(trial)
        length = mass ** (1.0 / 3.0)
        return np.zeros(10), USUAL * mass * np.array([1.0] + [length] * 3 + [length**2] * 6)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(abs(self._mass(trial, amplitudes)) > 1e-4)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        assert trial.rigid is not None
        mass = self._mass(trial, amplitudes)
        center = (
            trial.rigid.flange_in_joint.actInv(amplitudes[1:4] / mass) if abs(mass) > 1e-6 else np.zeros(3)
        )
        return {"mass": mass, "com_x": float(center[0]), "com_y": float(center[1]), "com_z": float(center[2])}

    def _mass(self, trial: Trial, amplitudes: np.ndarray) -> float:
        """Mass [kg]; where the last link only turns about its joint, that of a point that does the same.

        A pendulum's torque holds m c and I about the axis, not m: with I = m (c'c E - c c') of a point, 1 / m
        is the least-squares ratio of what is seen of the inertia to that of the moment m c.
        """
        seen = self._which_are_seen(trial)
        if seen[0]:
            return float(amplitudes[0])
        moment = np.where(seen[1:4], amplitudes[1:4], 0.0)
        point, inertia = point_inertia(moment)[seen[4:]], amplitudes[4:][seen[4:]]
        against = float(inertia @ point)
        return float(point @ point) / against if abs(against) > 1e-15 else 0.0

    def _which_are_seen(self, trial: Trial) -> np.ndarray:
        """(10,) whether a parameter of the last link, of its usual size, turns up in any torque.

        A tilt on a pan that is a centimetre off carries its mass a thousandth as visibly as its moment.
        """
        _, usual = self.prior(trial, {})
        largest = usual * np.max(np.abs(trial.regressor[:, :, -1, :]), axis=(0, 1))
        return largest > LEAST_SEEN * np.max(largest)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        delta = np.zeros((trial.joints, 10))
        delta[-1] = amplitudes
        return {"inertial_delta": delta}


@dataclass(frozen=True, eq=False, kw_only=True)
class PointOnAxis(Form):
    """A point mass on an axis of the flange, `d` from it: what is screwed on mostly is.

    With one amplitude and one shape it competes on even terms with a scale of the link or of the model, where
    ten parameters would each cost evidence.
    """

    axis: int
    way: float

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link((trial.regressor[:, :, -1, :] @ self._unit(trial, shape))[None])

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, usual_mass(trial))

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        assert trial.rigid is not None
        last = trial.rigid.inertial_parameters[-1]
        if amplitudes[0] <= -last[0]:
            return False
        # Of what nothing drives all torques are zero, and a body that is taken away explains any motion.
        added = amplitudes[0] * self._unit(trial, shape)
        return is_driven(trial) or bool(_moments(added) > -MOST_TAKEN * _moments(last))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        center = self._in_flange(shape)
        return {
            "mass": float(amplitudes[0]),
            **dict(zip(("com_x", "com_y", "com_z"), map(float, center), strict=True)),
        }

    def sample_parameters(
        self, trial: Trial, shape: Shape, amplitudes: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """The same, and beside the axis by as little as this form takes for nothing."""
        out = self.parameters(trial, shape, amplitudes)
        for k, name in enumerate(("com_x", "com_y", "com_z")):
            if k != self.axis:
                out[name] = float(BESIDE * shape["d"] * rng.standard_normal())
        return out

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        delta = np.zeros((trial.joints, 10))
        delta[-1] = amplitudes[0] * self._unit(trial, shape)
        return {"inertial_delta": delta}

    def _in_flange(self, shape: Shape) -> np.ndarray:
        return self.way * shape["d"] * np.eye(3)[self.axis]

    def _unit(self, trial: Trial, shape: Shape) -> np.ndarray:
        """Ten inertial parameters of one kilogram, about the last joint's frame."""
        assert trial.rigid is not None
        c = trial.rigid.flange_in_joint.act(self._in_flange(shape))
        return np.concatenate([[1.0], c, point_inertia(c)])


def is_driven(trial: Trial) -> bool:
    """Whether any torque is known to have acted on the joints, or may have."""
    torque = trial.motion.u if trial.motion.u is not None else trial.motion.tau
    return torque is None or bool(np.any(torque))


def _moments(inertial: np.ndarray) -> float:
    """Sum [kg m2] of the moments of inertia about the axes of the joint's frame."""
    return float(inertial[4] + inertial[6] + inertial[9])


def usual_mass(trial: Trial) -> float:
    """Mass [kg] that a machine may carry unannounced: a light one carries less, a heavy one more.

    A prior of 1 kg on an arm of 945 kg costs a load of 32 kg 512 nat: it was read as 22 kg farther out.
    """
    assert trial.rigid is not None
    moving = float(np.sum(trial.rigid.inertial_parameters[:, 0]))
    return max(min(1.0, moving / USUAL_CARRIER), moving / USUAL_ARM)


def point_inertia(c: np.ndarray) -> np.ndarray:
    """Ixx Ixy Iyy Ixz Iyz Izz (6,) of one kilogram at a point (3,): c'c E - c c'."""
    (x, y, z), square = c, float(c @ c)
    return np.array([square - x * x, -x * y, square - y * y, -x * z, -y * z, square - z * z])


EFFECT = PayloadEffect()
