"""28: cable or hose."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.residuals.basis_functions import bristle
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_TAUT = 0.05  # share of the squared pull on each side of the slack
LEAST_PULL = 0.1  # of the hysteresis, that the spring must change by over the travel
TURN = 0.03  # [rad] over which the hysteresis turns round, before it is searched
SLACK = (0.05, 0.2)  # [rad] half widths, likewise
CENTRES = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)  # of the travel, likewise


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
        Parameter("k", "N m/rad", 0.05, 3.0, "stiffness, of a slack cable where it gets taut"),
        Parameter("q0", "rad", -3.2, 3.2, "rest position, or middle of the slack", bounded=False),
        Parameter("h", "N m", 0.0, 0.5, "half height of the loop"),
    )

    def unobservable(self, trial: Trial) -> str | None:
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            return "needs a torque and a dynamic model"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        """A straight spring, and one that is slack within a gap and hardens beyond.

        A shape is searched in its logarithm, so the middle of the slack is searched as its exponential.
        """
        (joint,) = self.joints_at(trial, place)
        q = trial.motion.q[:, joint]
        low, span = float(np.min(q)), float(np.ptp(q))
        limits = {"x": (0.002, 0.3)}
        slack = tuple({"x": TURN, "s": s, "e": float(np.exp(low + c * span))} for s in SLACK for c in CENTRES)
        ends = {"s": (0.005, 1.0), "e": (float(np.exp(low - 1.0)), float(np.exp(low + span + 1.0)))}
        return (
            Form("", ("k", "kq0", "h"), ({"x": TURN},), limits),
            Form("slack", ("k", "c", "h"), slack, limits | ends),
        )

    def pull(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """Torque (2, N) of the spring per unit of its two amplitudes."""
        q = trial.motion.q[:, joint]
        if form == "":
            return np.stack([q, -np.ones(len(q))])
        away = q - np.log(shape["e"])
        taut = np.sign(away) * np.maximum(np.abs(away) - shape["s"], 0.0)
        return np.stack([taut, taut * np.abs(taut)])

    def loop(self, trial: Trial, joint: int, distance: float) -> np.ndarray:
        """Hysteresis (N,) of unit height."""
        key = ("cable", f"{joint} {distance:.9g}")
        if key not in trial.kept:
            z = trial.motion.reduce(bristle(trial.motion.full_position[:, joint], distance))
            trial.kept[key] = (z, z)
        return trial.kept[key][0]

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        (joint,) = self.joints_at(trial, place)
        rows = np.zeros((3, len(trial), trial.joints))
        rows[:2, :, joint] = self.pull(trial, joint, form, shape)
        rows[2, :, joint] = self.loop(trial, joint, shape["x"])
        return trial.link(rows)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        (joint,) = self.joints_at(trial, place)
        scale = trial.scale[joint]
        return np.zeros(3), np.array([0.05 * scale, 0.05 * scale, 0.01 * scale])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        (joint,) = self.joints_at(trial, place)
        if form != "":
            torque = amplitudes[:2] @ self.pull(trial, joint, form, shape)
            sides = [float(np.sum(np.clip(side * torque, 0.0, None) ** 2)) for side in (1.0, -1.0)]
            # Felt on one side only, it may as well be a stop: a cable is known by both.
            if min(sides) < LEAST_TAUT * sum(sides) or min(amplitudes[:2]) <= 0:
                return False
        # Hysteresis without a spring is dry friction under another name.
        pull = float(np.ptp(amplitudes[:2] @ self.pull(trial, joint, form, shape)))
        return bool(amplitudes[0] > 0 and pull > LEAST_PULL * abs(amplitudes[2]))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        k, second, h = (float(a) for a in amplitudes)
        rest = float(np.log(shape["e"])) if form != "" else second / k if k else 0.0
        return {"k": k, "q0": rest, "h": h}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        k, constant = float(amplitudes[0]), float(amplitudes[1])
        if form != "":  # the simulator's cable is straight: the line through its pull over the travel
            q = trial.motion.q[:, joints[0]]
            pull = amplitudes[:2] @ self.pull(trial, joints[0], form, shape)
            k, offset = (float(c) for c in np.polyfit(q, pull, 1))
            constant = -offset
        if k <= 0:
            return None
        return {
            "cable_stiffness": at_joint(trial, joints, k),
            "cable_rest": at_joint(trial, joints, constant / k),
            "cable_friction": at_joint(trial, joints, amplitudes[2]),
        }


EFFECT = Cable()
