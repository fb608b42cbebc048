"""Lines 4, 9 and 18 of Algorithm 1: the nominal action, and the residual on the real image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.policy.agent.exploration import Exploration, shortened, within_reach
from samrl_core.policy.agent.settings import AgentSettings, Tell, required, silent
from samrl_core.policy.networks.network_image import observed_image
from samrl_core.policy.networks.networks import ResidualActor
from samrl_core.policy.planning.expert import label_of
from samrl_core.policy.view.sensing_value import Networks, SensingValue


@dataclass(frozen=True, eq=False)
class ActionChoice:
    """What the tool shall do next."""

    sub_goal: str  # of eq. 22 that is next in the estimate; "none" when none is left
    nominal: np.ndarray  # (3,) eq. 12 [m]
    residual: np.ndarray  # (3,) eq. 13 [m]

    @property
    def displacement(self) -> np.ndarray:
        """Eq. 14, (3,) [m]."""
        return self.nominal + self.residual


class Acting:
    """Chooses actions as the policy says."""

    def __init__(
        self,
        model: Model,
        settings: AgentSettings,
        networks: Networks | None = None,
        tell: Tell = silent,
    ) -> None:
        """`networks` for policy "learned".

        Raises:
            InputError: policy "learned" without networks, or a task whose actions are too long for the tool.
        """
        if model.task.action_limit > settings.longest:
            raise InputError(
                f"{model.task.name} has actions of up to {model.task.action_limit} m, the tool moves at most "
                f"{settings.longest} m; shorten the task's steps or allow longer ones"
            )
        self._model, self._settings, self._tell = model, settings, tell
        self._networks = required(networks, "policy 'learned'") if settings.policy == "learned" else None
        self.explore_from(0)
        self.residual: ResidualActor | None = None  # None is the zero residual of eq. 15

    def prepare(self) -> None:
        """Compile the physics now instead of in the first plan."""
        if self._networks is None:
            self._model.dynamics.prepare()

    def begin(self) -> None:
        """An episode starts."""
        self._exploration.begin()

    def explore_from(self, steps: int) -> None:
        """Draw what a run explores with, which begins with so many steps collected: no two have the same."""
        s = self._settings
        rng = np.random.default_rng([s.seed, steps])
        self._exploration = Exploration(s.exploration, s.exploration_memory, rng)

    def choose(self, estimate: Estimate, observation: Observation) -> ActionChoice:
        """The next action, in the state of the estimate and the observation's joints.

        Raises:
            InputError: networks whose answer is not finite.
        """
        tip = self._model.tip_in_base(observation.tool_arm.position).position
        if self._networks is None:
            name, nominal = self._planned(estimate.values, tip)
        else:
            name, nominal = self._imitated(self._networks, estimate, tip, observation)
        return ActionChoice(name, nominal, self._residual(observation, tip, nominal))

    def _planned(self, values: np.ndarray, tip: np.ndarray) -> tuple[str, np.ndarray]:
        """Name of the next sub-goal, and the first action (3,) [m] of a plan; "none" and 0 when done."""
        label = label_of(self._model.dynamics, self._model.task, values, tip, self._settings.plan)
        if label.why_straight:
            self._tell(f"no plan, straight to the next sub-goal instead: {label.why_straight}")
        return label.sub_goal, label.action

    def _imitated(
        self, networks: Networks, estimate: Estimate, tip: np.ndarray, observation: Observation
    ) -> tuple[str, np.ndarray]:
        if self._settings.actor_image == "real":
            image = observed_image(observation, tip, self._model.cell)[None]
        else:
            value = SensingValue(self._model, networks, estimate, observation.tool_arm.position)
            image = value.view(observation.camera.camera_in_world)
        with torch.no_grad():
            action = networks.actor(image)[0].numpy()
        goals = self._model.task.sub_goals(estimate.values, tip)
        return goals[0].name if goals else "none", _finite(action, "actor")

    def _residual(self, observation: Observation, tip: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        residual = np.zeros(3)
        if self.residual is not None:
            image = observed_image(observation, tip, self._model.cell)[None]
            with torch.no_grad():
                found = self.residual(image, torch.from_numpy(nominal).to(torch.float32)[None])[0]
            residual = _finite(found.numpy(), "residual policy")
        s = self._settings
        if s.exploration > 0.0:
            limit = s.exploration_limit if self.residual is None else self.residual.limit
            residual = shortened(residual + self._exploration.next(), limit)
        return within_reach(nominal, residual, s.longest)


def _finite(action: np.ndarray, who: str) -> np.ndarray:
    if not np.isfinite(action).all():
        raise InputError(f"the {who} says {action}, which is not finite; train it anew")
    return action.astype(np.float64)
