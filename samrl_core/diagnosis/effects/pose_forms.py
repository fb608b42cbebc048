"""Forms of effects on seen poses: a constant transform that is off, and a clock that is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial

RADIAN_PER_METRE = 2.0  # of errors of one origin: 0.1 degree comes with 1 mm
SIX = ("x", "y", "z", "rx", "ry", "rz")


def six_parameters(reach_m: float, reach_rad: float, frame: str) -> tuple[Parameter, ...]:
    """Translation and rotation vector of a small transform, applied last: true = stated . small."""
    moved = tuple(Parameter(n, "m", -reach_m, reach_m, f"along {frame}'s {n}") for n in SIX[:3])
    turned = tuple(Parameter(n, "rad", -reach_rad, reach_rad, f"about {frame}'s {n[1]}") for n in SIX[3:])
    return (*moved, *turned)


@dataclass(frozen=True, eq=False, kw_only=True)
class SmallTransform(Form[PoseTrial]):
    """A constant transform of the chain that differs by a small one from what is stated."""

    deviation: ClassVar[float] = 0.0
    twists: Callable[[PoseTrial], np.ndarray]  # (6, N, 6) of the target in the camera per unit
    # Standard deviations of the prior: a small error and a gross one are different things that happen.
    scales: ClassVar[tuple[Shape, ...]] = ({"spread": 0.0015}, {"spread": 0.005}, {"spread": 0.02})  # [m]
    shapes: tuple[Shape, ...] = scales

    def columns(self, trial: PoseTrial, shape: Shape) -> Columns:
        return trial.columns(self.twists(trial))

    def prior(self, trial: PoseTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(6), shape["spread"] * np.array([1.0] * 3 + [RADIAN_PER_METRE] * 3)

    def parameters(self, trial: PoseTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return dict(zip(SIX, map(float, amplitudes), strict=True))


@dataclass(frozen=True, eq=False, kw_only=True)
class OneNumber(Form[PoseTrial]):
    """An error of one number, to which the twists of the target are proportional."""

    deviation: ClassVar[float] = 0.0
    twist: Callable[[PoseTrial], np.ndarray]  # (N, 6) per unit
    spread: float

    def columns(self, trial: PoseTrial, shape: Shape) -> Columns:
        return trial.columns(self.twist(trial)[None])

    def prior(self, trial: PoseTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, self.spread)

    def parameters(self, trial: PoseTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {self.amplitudes[0]: float(amplitudes[0])}


@dataclass(frozen=True, eq=False, kw_only=True)
class TargetSize(Form[PoseTrial]):
    """A target that is larger by s: positions seen are 1 / (1 + s) of the real ones.

    The amplitude is s / (1 + s), to which the twist is proportional however large s is: a size that was typed
    in wrongly, or a length in an unknown unit, is off by a factor.
    """

    deviation: ClassVar[float] = 0.0
    # Standard deviations of the prior: a printer's scaling and a wrong size are different things that happen.
    shapes: tuple[Shape, ...] = ({"spread": 0.03}, {"spread": 0.5})

    def columns(self, trial: PoseTrial, shape: Shape) -> Columns:
        return trial.columns(trial.size_twist[None])

    def prior(self, trial: PoseTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, shape["spread"])

    def is_admissible(self, trial: PoseTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] < 1.0)

    def parameters(self, trial: PoseTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        share = float(amplitudes[0])
        # A target of which nothing is left to see is endlessly large; `is_admissible` leaves it out.
        return {self.amplitudes[0]: share / (1.0 - share) if share < 1.0 else float("inf")}


@dataclass(frozen=True, eq=False, kw_only=True)
class ShiftedStamps(Form[PoseTrial]):
    """Arms read at other stamps than the camera's, by `sign` times the shape T, for arms of `roles`.

    The twist of a finite shift is exact; its amplitude is one, with a little freedom to be polished by.
    """

    deviation: ClassVar[float] = 0.0
    freedom: ClassVar[float] = 0.003
    parameter: str
    sign: float  # of the shift of the arms' reading per T
    reported: float  # sign of the reported parameter
    roles: tuple[str, ...]
    drifts: bool = False

    def columns(self, trial: PoseTrial, shape: Shape) -> Columns:
        sides = {trial.side_of(role) for role in self.roles}
        shift = self.sign * shape["T"]
        twists = [trial.chain.shift_twist([shift if side in sides else 0.0 for side in (0, 1)])]
        if self.drifts:
            rate = self._rate(trial)
            twists.append((trial.chain.time - self._middle(trial))[:, None] * rate)
        return trial.columns(np.stack(twists))

    def _rate(self, trial: PoseTrial) -> np.ndarray:
        """Twist (N, 6) per second of shift."""
        return sum((trial.rates[role] for role in self.roles), np.zeros((len(trial.chain.time), 6)))

    def _middle(self, trial: PoseTrial) -> float:
        """The time [s] about which a drift turns: one that turns about the beginning would be an offset, too.

        It is the middle of the motion, not of the time, so that a drift does nothing that a shift does.
        """
        moved = np.sum(self._rate(trial) ** 2, axis=1)
        time, total = trial.chain.time, float(np.sum(moved))
        return float(time @ moved / total) if total > 0 else float(np.mean(time))

    def prior(self, trial: PoseTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        if self.drifts:
            return np.array([1.0, 0.0]), np.array([self.freedom, 1e-3])
        return np.ones(1), np.full(1, self.freedom)

    def is_admissible(self, trial: PoseTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0.5)

    def parameters(self, trial: PoseTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        shift = self.reported * float(shape["T"] * amplitudes[0])
        if not self.drifts:
            return {self.parameter: shift}
        drift = self.reported * self.sign * float(amplitudes[1])
        begins = self._middle(trial) - float(trial.chain.time[0])
        return {self.parameter: shift - drift * begins, "drift": drift}
