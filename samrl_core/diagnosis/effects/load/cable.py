"""28: cable or hose."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import bristle
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.nominal import SPRING
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_TAUT = 0.05  # share of the squared pull on each side of the slack
LEAST_PULL = 0.1  # of the hysteresis, that the spring must change by over the travel
TURN = 0.03  # [rad] over which the hysteresis turns round, before it is searched
SLACK = (0.05, 0.2)  # [rad] half widths, likewise
CENTRES = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)  # of the travel, likewise


FARTHEST = 100.0  # [rad] that a joint with a cable turns from its zero; what goes on turning has none


class Cable(Effect):
    """A cable outside the arm pulls a joint back, with some friction of its own."""

    family, number, title = "cable", 28, "Cable or hose"
    meaning = "A cable or hose pulls on the joint like a spring, with some hysteresis."
    remedy = "Reroute or fasten it with slack; if it must stay, add its stiffness to the joint."
    formula = (
        "tau_c = k y + c y |y| + h z(q), y = q - q0 or what of it is beyond the slack; z: Dahl's bristle"
    )
    source = "dress packs: 0-2 N m/rad; hysteresis: Dahl 1968; toe region of ropes and hoses: Costello 1997"
    acts_on = "dynamics"
    excitation = "sweep of the wrist"
    experiment = "sweep"
    curve_over = "position"
    confounded_with = ("position_dependent_friction", "payload", "encoder_offset")
    parameters = (
        Parameter(
            "k",
            "N m/rad",
            0.05,
            3.0,
            "stiffness beyond a stated spring's, of a slack cable where it gets taut",
        ),
        Parameter("q0", "rad", -3.2, 3.2, "rest position, or middle of the slack", bounded=False),
        Parameter("h", "N m", 0.0, 0.5, "half height of the loop"),
        Parameter("c", "N m/rad2", 0.0, 10.0, "by which a slack cable hardens", bounded=False),
        Parameter("slack", "rad", 0.0, 1.0, "half width of the gap in which it is slack", bounded=False),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """A straight spring, and one that is slack within a gap and hardens beyond.

        A shape is searched in its logarithm, so the middle of the slack is searched as its exponential.
        """
        (joint,) = place.joints
        q = trial.motion.q[:, joint]
        low, span = float(np.min(q)), float(np.ptp(q))
        if max(abs(low), abs(low + span)) > FARTHEST:
            return ()
        limits = {"x": (0.002, 0.3)}
        slack = tuple({"x": TURN, "s": s, "e": float(np.exp(low + c * span))} for s in SLACK for c in CENTRES)
        ends = {"s": (0.005, 1.0), "e": (float(np.exp(low - 1.0)), float(np.exp(low + span + 1.0)))}
        return (
            StraightCable(place=place, amplitudes=("k", "kq0", "h"), shapes=({"x": TURN},), refine=limits),
            SlackCable(
                name="slack", place=place, amplitudes=("k", "c", "h"), shapes=slack, refine=limits | ends
            ),
        )


class CableForm(Form):
    """A spring of two amplitudes, and the hysteresis of the cable's own friction."""

    @abstractmethod
    def pull(self, trial: Trial, shape: Shape) -> np.ndarray:
        """Torque (2, N) of the spring per unit of its two amplitudes."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        rows = np.zeros((3, len(trial), trial.joints))
        rows[:2, :, self.joint] = self.pull(trial, shape)
        rows[2, :, self.joint] = self._loop(trial, shape["x"])
        return trial.link(rows)

    def _loop(self, trial: Trial, distance: float) -> np.ndarray:
        """Hysteresis (N,) of unit height."""
        key = ("cable", f"{self.joint} {distance:.9g}")
        if key not in trial.cached:
            trial.cached[key] = trial.motion.reduce(
                bristle(trial.motion.full_position[:, self.joint], distance)
            )
        return trial.cached[key]

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        scale = trial.scale[self.joint]
        return np.zeros(3), np.array([0.05 * scale, 0.05 * scale, 0.01 * scale])

    def stated(self, trial: Trial) -> float:
        """Stiffness [N m/rad] of the joint's spring in the model: the softest that it may be less."""
        return 0.0 if trial.rigid is None else float(trial.rigid.spring_stiffness[self.joint])

    def is_spring(self, trial: Trial, torque: np.ndarray, amplitudes: np.ndarray) -> bool:
        """Whether the joint's spring pulls, this torque (N,) changing enough beside the hysteresis.

        Hysteresis without a spring is dry friction under another name.
        """
        stated, change = self.stated(trial), float(np.ptp(torque))
        if stated > 0:  # of either sign: what is within its tolerance is no change, and no loop gives energy
            beyond = abs(amplitudes[0]) > SPRING * stated and amplitudes[2] > -LEAST_PULL * change
            return bool(beyond and amplitudes[0] > -stated and change > LEAST_PULL * abs(amplitudes[2]))
        return bool(amplitudes[0] > 0 and change > LEAST_PULL * abs(amplitudes[2]))

    def simulate_spring(
        self, trial: Trial, stiffness: float, constant: float, hysteresis: float
    ) -> PlantFields | None:
        """Fields of the simulator's cable, which is straight."""
        if stiffness == 0 or stiffness <= -self.stated(trial):
            return None
        return {
            "cable_stiffness": self.at_joints(trial, stiffness),
            "cable_rest": self.at_joints(trial, constant / stiffness),
            "cable_friction": self.at_joints(trial, hysteresis),
        }


class StraightCable(CableForm):
    """A straight spring."""

    def pull(self, trial: Trial, shape: Shape) -> np.ndarray:
        q = trial.motion.q[:, self.joint]
        return np.stack([q, -np.ones(len(q))])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return self.is_spring(trial, amplitudes[:2] @ self.pull(trial, shape), amplitudes)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        k, second, h = (float(a) for a in amplitudes)
        return {"k": k, "q0": second / k if k else 0.0, "h": h}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return self.simulate_spring(trial, float(amplitudes[0]), float(amplitudes[1]), amplitudes[2])


class SlackCable(CableForm):
    """A spring that is slack within a gap and hardens beyond."""

    def pull(self, trial: Trial, shape: Shape) -> np.ndarray:
        away = trial.motion.q[:, self.joint] - np.log(shape["e"])
        taut = np.sign(away) * np.maximum(np.abs(away) - shape["s"], 0.0)
        return np.stack([taut, taut * np.abs(taut)])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        torque = amplitudes[:2] @ self.pull(trial, shape)
        sides = [float(np.sum(np.clip(side * torque, 0.0, None) ** 2)) for side in (1.0, -1.0)]
        # Felt on one side only, it may as well be a stop: a cable is known by both.
        if min(sides) < LEAST_TAUT * sum(sides) or min(amplitudes[:2]) <= 0:
            return False
        return self.is_spring(trial, torque, amplitudes)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        k, c, h = (float(a) for a in amplitudes)
        return {"k": k, "q0": float(np.log(shape["e"])), "h": h, "c": c, "slack": float(shape["s"])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # The line through its pull over the travel.
        pull = amplitudes[:2] @ self.pull(trial, shape)
        k, offset = (float(c) for c in np.polyfit(trial.motion.q[:, self.joint], pull, 1))
        return self.simulate_spring(trial, k, -offset, amplitudes[2])


EFFECT = Cable()
