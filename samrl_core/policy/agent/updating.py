"""Lines 3 and 8 of Algorithm 1: the model follows the images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import SolveError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.prediction import likeliest, predictions
from samrl_core.model.real2sim.real2sim import Estimate, Real2Sim, initial_estimate
from samrl_core.policy.agent.settings import Tell, silent


class Updating:
    """Images in; the belief is kept between them."""

    def __init__(self, model: Model, enabled: bool = True, tell: Tell = silent) -> None:
        """`enabled` False leaves the model as it starts."""
        self._model, self._enabled, self._tell = model, enabled, tell
        self._real2sim = Real2Sim(model)
        self.begin()

    def begin(self) -> None:
        """Forget: an episode starts."""
        self.estimate: Estimate = initial_estimate(self._model)
        self._tip: np.ndarray | None = None  # when the last image was taken, None before the first [m]

    def prepare(self) -> None:
        """Compile the physics now instead of in the first prediction."""
        self._model.dynamics.prepare()

    def update(self, observation: Observation) -> Estimate:
        """The belief after an image: eq. 8 in each way that it may have gone, then eq. 7 from each."""
        if self._enabled:
            found = self._predictions(observation)
            several = len(found) > 1
            updates = [self._real2sim.update(one, observation, compared=several) for one in found]
            self.estimate = likeliest(updates)
        else:
            self.estimate = replace(self.estimate, stamp_ns=observation.stamp_ns, why_stopped="disabled")
        return self.estimate

    def _predictions(self, observation: Observation) -> tuple[Estimate, ...]:
        tip = self._model.tip_in_base(observation.tool_arm.position).position
        before, self._tip = self._tip, tip
        if before is None:
            return (self.estimate,)
        specs = self._model.task.parameters()
        try:
            return predictions(self._model.dynamics, specs, self.estimate, before, tip)
        except SolveError as error:
            self._tell(f"the last estimate stands in for a prediction: {error}")
            return (self.estimate,)
