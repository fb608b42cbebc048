"""Mass and friction of a pushed disc from whole trajectories (paper eqs. 9-11), with intervals.

Eq. 10 compares one final pose and eq. 11 follows its gradient. Here every sighting of the disc and every
reading of the arm counts by its noise, and the step is Gauss-Newton's with damping, on the gradients of the
physics model. What the model gets wrong is estimated from what the fit leaves over (`discrepancy`), and what
the data leave open is filled by priors, and named as such.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physical_parameters.comparison import PushComparison
from samrl_core.model.physical_parameters.discrepancy import Wander, WanderSettings, responses, wandering
from samrl_core.model.physical_parameters.identifiability import (
    Combination,
    PhysicalParameter,
    combinations_of,
    parameters_of,
)
from samrl_core.model.physical_parameters.least_squares import LeastSquaresSettings, least_squares
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord
from samrl_core.model.physical_parameters.push_scene import (
    LATENCY,
    MASS,
    NAMES,
    START,
    PushContactSettings,
    PushScene,
)
from samrl_core.model.physical_parameters.sensitivity import Sensitivity, sensitivity, trajectory

# Above it residuals are more than twice the noise: what acted is not this model.
MISFIT_LIMIT = 4.0


@dataclass(frozen=True)
class Priors:
    """What is believed before the push: medians, and standard deviations of logarithms. ASSUMPTION, all."""

    mass_spread: float = 0.7  # a factor of 2 either way; its median is the guess
    table_friction: float = 0.4  # [-]
    table_friction_spread: float = 0.5
    inertia_ratio_spread: float = 0.2  # about the uniform disc's
    blade_friction: float = 0.15  # [-]
    blade_friction_spread: float = 0.7
    blade_stiffness: float = 1.0e5  # between blade and rim [N/m]
    blade_stiffness_spread: float = 1.0
    blade_dissipation: float = 50.0  # dough hardly bounces [s/m]
    blade_dissipation_spread: float = 1.0
    arm_mass_spread: float = 0.01  # of the arm's effective mass by its URDF
    force_spread: float = 0.01  # of the drives' force; also where on the rim the blade touches
    # Of the readings behind the drive's action: where in a control period each of them falls is not known.
    latency_spread: float = 0.001  # [s]
    start_spread: float = 0.005  # of the disc's start about its first sighting [m]


@dataclass(frozen=True)
class IdentifySettings:
    """Noise, priors and contacts."""

    seen_noise: float = 0.001  # standard deviation of a sighting [m]
    tip_noise: float = 1.0e-4  # of the tip: encoders, and what the model leaves out of the contact [m]
    tip_period_s: float = 0.010  # between readings of the tip that are compared [s]
    priors: Priors = field(default_factory=Priors)
    wander: WanderSettings = field(default_factory=WanderSettings)
    contact: PushContactSettings = field(default_factory=PushContactSettings)
    # A step of 0.3 standard deviations may be left: the step to what the wandering makes of it takes it too.
    solver: LeastSquaresSettings = field(default_factory=lambda: LeastSquaresSettings(least_decrease=0.1))

    def __post_init__(self) -> None:
        if not (self.seen_noise > 0 and self.tip_noise > 0 and self.tip_period_s > 0):
            raise InputError(
                f"noise {self.seen_noise} m, {self.tip_noise} m and tip period {self.tip_period_s} s must be "
                f"positive"
            )


@dataclass(frozen=True, eq=False)
class Identified:
    """Result of `identify`."""

    parameters: tuple[PhysicalParameter, ...]  # in the order of `push_scene.NAMES`
    combinations: tuple[Combination, ...]  # of mass and table friction, the best determined first
    mass_path: np.ndarray  # (K,) at the start, after each iteration, and with the model's errors [kg]
    misfit: float  # mean squared residual in units of the noise, 1 when the model explains the data [-]
    why_stopped: str  # converged | iteration_limit | no_descent | diverged | no_motion
    wander: Wander  # by how much the contacts' forces stray from the model's

    @property
    def explained(self) -> bool:
        """Whether the model explains the data; otherwise no value here means anything."""
        return self.why_stopped != "diverged" and self.misfit <= MISFIT_LIMIT

    def parameter(self, name: str) -> PhysicalParameter:
        """One of them."""
        return self.parameters[NAMES.index(name)]


def identify(
    pushes: Sequence[PushRecord],
    disc: Disc,
    mass_guess: float,
    settings: IdentifySettings | None = None,
    before: Identified | None = None,
) -> Identified:
    """Fit all parameters to all pushes together.

    Intervals are of 95 %, from the information of the data and the priors where the fit ended, with the
    model's errors as the recording shows them. When no push has moved the disc, nothing is fitted:
    "no_motion", and the intervals are the priors'.

    Args:
        pushes: one or more, of the same disc on the same table.
        disc: its shape.
        mass_guess: where the fit begins and the median of the mass's prior [kg].
        settings: noise, priors and contacts.
        before: found from the first few of these pushes; the search begins there, with the guess's priors.

    Raises:
        InputError: no push, or a guess that is no mass.
    """
    s = settings or IdentifySettings()
    if not pushes:
        raise InputError("nothing to identify from: no push was handed in")
    if not (np.isfinite(mass_guess) and mass_guess > 0):
        raise InputError(f"mass guess {mass_guess} kg must be positive and finite")
    median, spread = _prior(s.priors, mass_guess, pushes)
    if not any(push.has_moved(s.seen_noise) for push in pushes):
        return _unknown(median, spread, np.array([mass_guess]), 1.0, "no_motion")

    scenes = [PushScene(disc, push, s.contact) for push in pushes]
    compared = [PushComparison(scene, s.tip_noise, s.seen_noise, s.tip_period_s) for scene in scenes]

    newest: list[Sensitivity] = []

    def residual(theta: np.ndarray) -> np.ndarray:
        parts = [
            rows.residual(trajectory(scene, _own(theta, i)).numpy(), theta[LATENCY])
            for i, (scene, rows) in enumerate(zip(scenes, compared, strict=True))
        ]
        return np.concatenate([*parts, (theta - median) / spread])

    def residual_and_jacobian(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts, blocks = [], []
        newest[:] = [sensitivity(scene, _own(theta, i)) for i, scene in enumerate(scenes)]
        for i, (found, rows) in enumerate(zip(newest, compared, strict=True)):
            states, change = found.states.numpy(), found.jacobian.numpy()
            parts.append(rows.residual(states, theta[LATENCY]))
            here = rows.jacobian(states, change, theta[LATENCY])  # (M, START + 1)
            block = np.zeros((len(here), theta.size))
            block[:, :START], block[:, START + i] = here[:, :START], here[:, START]
            blocks.append(block)
        whole = np.concatenate([*parts, (theta - median) / spread])
        return whole, np.concatenate([*blocks, np.diag(1.0 / spread)])

    begin = median.copy()
    if before is not None:
        begin[: before.wander.parameters.size] = before.wander.parameters
    found = least_squares(residual, residual_and_jacobian, begin, s.solver)
    path = np.exp(found.path[:, MASS])
    if found.why_stopped == "diverged":
        return _unknown(found.parameters, spread, path, np.inf, "diverged")
    data = len(found.residual) - len(spread)
    # Parameters that the data settle take up as many residuals; the priors' own rows stand against the rest.
    misfit = float(found.residual @ found.residual) / max(1, data)
    latency = float(found.parameters[LATENCY])
    of_pushes = [
        responses(scene, sensitivity_of_push, rows, latency, s.wander.bin_s)
        for scene, sensitivity_of_push, rows in zip(scenes, newest, compared, strict=True)
    ]
    wander = wandering(
        found.residual[:data], found.jacobian[:data], found.parameters, median, spread, of_pushes, s.wander
    )
    return _identified(wander, spread, path, misfit, found.why_stopped)


def _prior(p: Priors, mass_guess: float, pushes: Sequence[PushRecord]) -> tuple[np.ndarray, np.ndarray]:
    """Medians and standard deviations of theta."""
    medians = [mass_guess, p.table_friction, 1.0, p.blade_friction, p.blade_stiffness, p.blade_dissipation]
    logs = np.log([*medians, 1.0, 1.0])
    spreads = [
        p.mass_spread,
        p.table_friction_spread,
        p.inertia_ratio_spread,
        p.blade_friction_spread,
        p.blade_stiffness_spread,
        p.blade_dissipation_spread,
        p.arm_mass_spread,
        p.force_spread,
        p.latency_spread,
    ]
    starts = [float(push.seen[0]) for push in pushes]
    return np.concatenate([logs, [0.0], starts]), np.array([*spreads, *[p.start_spread] * len(pushes)])


def _own(theta: np.ndarray, push: int) -> torch.Tensor:
    """The part of theta that one push has: the parameters and its own start."""
    return torch.as_tensor(np.append(theta[:START], theta[START + push]))


def _identified(wander: Wander, spread: np.ndarray, path: np.ndarray, misfit: float, why: str) -> Identified:
    parameters = parameters_of(NAMES, wander.parameters, wander.covariance, spread)
    path = np.append(path, parameters[MASS].value)
    return Identified(parameters, combinations_of(wander.covariance, NAMES), path, misfit, why, wander)


def _unknown(theta: np.ndarray, spread: np.ndarray, path: np.ndarray, misfit: float, why: str) -> Identified:
    return _identified(Wander(theta, np.diag(spread**2), 0.0, 0.0, 0.0), spread, path, misfit, why)
