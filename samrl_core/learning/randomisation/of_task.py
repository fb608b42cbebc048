"""What of a task's model is randomised, and the model that a point stands for.

`start/...` are the task's parameters at the start of an episode, `look/...` colours, light and camera noise,
`log/...` logarithms of factors on physical parameters. What a space leaves out is as the model has it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.learning.images.appearance import AppearancePoints, Appearances, appearances_at
from samrl_core.learning.randomisation.distributions import ParameterDistribution
from samrl_core.learning.randomisation.space import Dimension, Space
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.physical_parameters import parameters_of, with_factors
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics

START, APPEARANCE, LOG = "start", "look", "log"
_FACTOR = math.log(2.0)  # a physical parameter is off by a factor of 2 at most; ASSUMPTION
# About three standard deviations of `AppearanceSettings`, and none to twice the camera's noise; ASSUMPTIONS.
_APPEARANCES = (
    ("exposure", 0.0, -0.45, 0.45),
    ("paint", 0.0, 0.0, 0.35),
    ("light_x", 0.0, -0.6, 0.6),
    ("light_y", 0.0, -0.6, 0.6),
    ("noise", 1.0, 0.0, 2.0),
)
_AMBIENT = 0.3  # about the model's own


def starts_of(task: Task) -> Space:
    """The parameters that differ between starts."""
    lower, upper = task.start_range
    return Space(
        tuple(
            Dimension(f"{START}/{spec.name}", spec.unit, float(0.5 * (a + b)), float(a), float(b))
            for spec, a, b in zip(task.parameters(), lower, upper, strict=True)
            if a < b
        )
    )


def appearances_of(model: Model) -> Space:
    """Appearance of the model, and noise of the camera."""
    own = model.settings.ambient
    ambient = Dimension(f"{APPEARANCE}/ambient", "-", own, max(0.0, own - _AMBIENT), min(1.0, own + _AMBIENT))
    return Space((*(Dimension(f"{APPEARANCE}/{name}", "-", *rest) for name, *rest in _APPEARANCES), ambient))


def physical_parameter_space(dynamics: TaskDynamics) -> Space | None:
    """Factors on the physical parameters that the model can vary; None where there are none."""
    names = parameters_of(dynamics)
    if not names:
        return None
    return Space(tuple(Dimension(f"{LOG}/{name}", "-", 0.0, -_FACTOR, _FACTOR) for name in names))


def together(*spaces: Space | None) -> Space:
    """One space of all dimensions."""
    return Space(tuple(d for space in spaces if space is not None for d in space.dimensions))


def start_values(task: Task, space: Space, points: np.ndarray) -> np.ndarray:
    """The task's parameters (N, P) that episodes of these points begin with."""
    names = [spec.name for spec in task.parameters()]
    values = np.tile(np.mean(task.start_range, axis=0), (len(points), 1))
    for k in space.columns(START):
        values[:, names.index(space.names[k].split("/")[1])] = points[:, k]
    return values


def appearance_points(model: Model, space: Space, points: np.ndarray) -> AppearancePoints:
    """Appearances of the images at these points."""
    own = {d.name: d.nominal for d in appearances_of(model).dimensions}

    def column(name: str) -> np.ndarray:
        found = f"{APPEARANCE}/{name}"
        here = found in space.names
        return points[:, space.names.index(found)] if here else np.full(len(points), own[found])

    light = np.column_stack([column("light_x"), column("light_y"), np.zeros(len(points))])
    return AppearancePoints(column("exposure"), column("paint"), light, column("ambient"), column("noise"))


def dynamics_at(dynamics: TaskDynamics, space: Space, points: np.ndarray) -> TaskDynamics:
    """The model's motion at points that agree on its physical parameters.

    Args:
        dynamics: with the scene's own physical parameters.
        space: of the points.
        points: (N, P), N at least 1.

    Raises:
        InputError: they do not agree, or the model lacks such a physical parameter.
    """
    columns = space.columns(LOG)
    if np.ptp(points[:, columns], axis=0).any():
        raise InputError(
            f"{len(points)} points differ in {[space.names[k] for k in columns]}; run those apart that differ"
        )
    return with_factors(dynamics, {space.names[k].split("/")[1]: math.exp(points[0, k]) for k in columns})


def alike(space: Space, points: np.ndarray) -> list[np.ndarray]:
    """Rows of the points that agree on the physical parameters, each group in order."""
    columns = space.columns(LOG)
    if not columns:
        return [np.arange(len(points))]
    _, group = np.unique(points[:, columns], axis=0, return_inverse=True)
    return [np.flatnonzero(group.ravel() == k) for k in range(int(group.max(initial=-1)) + 1)]


def with_one_set_of_parameters(space: Space, points: np.ndarray) -> np.ndarray:
    """The points, all with the first one's physical parameters: what one group of episodes can have."""
    found = points.copy()
    columns = space.columns(LOG)
    found[:, columns] = found[:1, columns]
    return found


@dataclass(frozen=True, eq=False)
class AppearancesOf:
    """A `AppearanceSource`: appearances of a distribution."""

    distribution: ParameterDistribution

    def sample(self, model: Model, rng: np.random.Generator, count: int) -> Appearances:
        """See `AppearanceSource`."""
        points = self.distribution.sample(rng, count)
        return appearances_at(model, rng, appearance_points(model, self.distribution.space, points))


@dataclass(frozen=True, eq=False)
class AppearancesAt:
    """A `AppearanceSource`: appearances of given points, in order."""

    space: Space
    points: np.ndarray  # (N, P)

    def sample(self, model: Model, rng: np.random.Generator, count: int) -> Appearances:
        """See `AppearanceSource`.

        Raises:
            InputError: another number of appearances than points.
        """
        if count != len(self.points):
            raise InputError(f"{count} appearances were asked for, there are {len(self.points)} points")
        return appearances_at(model, rng, appearance_points(model, self.space, self.points))
