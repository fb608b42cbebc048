"""Lines 5 to 15 of Algorithm 1: where to look from."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.observation import Observation
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.policy.agent.settings import AgentSettings, required
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.policy.view.view_ascent import ViewAscent
from samrl_core.policy.view.view_planning import ViewChoice, ViewPlanner


class Looking:
    """Chooses views as the strategy says."""

    def __init__(self, model: Model, settings: AgentSettings, networks: Networks | None = None) -> None:
        """`networks` for strategy "q".

        Raises:
            InputError: strategy "q" without networks.
        """
        self._strategy = settings.strategy
        self.begin(settings.seed)
        self._planner: ViewPlanner | None = None
        self._ascent: ViewAscent | None = None
        if settings.strategy == "q":
            found = required(networks, "strategy 'q'")
            self._ascent = ViewAscent(model, model.cell, model.task, found, settings.ascent)
        else:
            self._planner = ViewPlanner(model, model.cell, model.task, settings.information)

    def begin(self, seed: int) -> None:
        """Draw anew from a seed: what strategy "random" does next does not depend on what it did before."""
        self._rng = np.random.default_rng(seed)

    def prepare(self) -> None:
        """Solve the reachable views now (seconds)."""
        planner = self._ascent or self._planner
        assert planner is not None
        planner.prepare()

    def choose(self, estimate: Estimate, observation: Observation) -> ViewChoice:
        """The next view, or to stay; where the arms are is taken from the observation."""
        tool, camera = observation.tool_arm.position, observation.camera_arm.position
        if self._ascent is not None:
            return self._ascent.plan(estimate, tool, camera)
        assert self._planner is not None
        return self._planner.plan(estimate, tool, camera, self._strategy, self._rng)
