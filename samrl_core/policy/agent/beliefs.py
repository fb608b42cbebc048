"""Which belief about its cell an agent's model is updated by: that it is calibrated, or that nobody did.

No one tells an agent. Both are followed through the first images of an episode, each as if it were right,
and the evidence chooses (multiple models: Magill 1965). Until then, and ever after in a calibrated cell, the
usual one rules, as if there were no other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.calibration.seen_error import SeenError
from samrl_core.cell.tasks.task import ParameterSpec, Task
from samrl_core.cell.types.observation import Observation
from samrl_core.common.errors import SolveError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.prediction import (
    CameraErrors,
    PredictionSettings,
    camera_kept,
    likeliest,
    loosened_by,
    moved_by_contact,
    predictions,
    seen_from_elsewhere,
)
from samrl_core.model.real2sim.real2sim import Estimate, Real2Sim, Real2SimSettings, initial_estimate
from samrl_core.model.real2sim.rival_belief import log_evidence_ratio
from samrl_core.policy.agent.settings import Log


@dataclass(frozen=True)
class ChoiceSettings:
    """When the wider belief takes over."""

    evidence: float = 1.5  # natural logarithm of how much more the images speak for it
    images: int = 6  # that may choose; what contact does is seen in later ones, too


@dataclass(frozen=True, eq=False)
class Moved:
    """What has moved since the last image."""

    tips: tuple[np.ndarray, np.ndarray] | None  # the tool's (3,) then and now [m]; None at the first image
    way: float  # of the camera [m]
    turn: float  # of the camera [rad]
    errors: CameraErrors  # how what it shows beside its place changes meanwhile


@dataclass(frozen=True, eq=False)
class Belief:
    """How images correct a model of a cell of which this much is believed."""

    physics: Model  # whose dynamics predict
    model: Model  # of the same, with what is believed
    real2sim: Real2Sim
    prediction: PredictionSettings
    camera_times: float  # the camera's error changes so many times as much as usual from view to view [-]
    # Whether what has entered stays in though an image in which no fit settles shows it outside.
    holds_entered: bool = False

    @property
    def specs(self) -> tuple[ParameterSpec, ...]:
        """What is believed before any image."""
        return self.model.task.parameters()

    def initial(self, seen: SeenError) -> Estimate:
        """Before any image, of a camera that a correction of the cell leaves known this well."""
        return loosened_by(initial_estimate(self.model), self.specs, seen)

    def update(self, estimate: Estimate, observation: Observation, moved: Moved, log: Log) -> Estimate:
        """After an image: eq. 8 predicts each way that the last action may have gone, eq. 7 corrects it."""
        before = self._elsewhere(estimate, moved)
        found = self._predicted(before, moved, log)
        several = len(found) > 1
        after = likeliest([self.real2sim.update(one, observation, compared=several) for one in found])
        if self.holds_entered and moved.tips is not None and not after.converged:
            after = _still_inside(self.model.task, found[0], after, moved.tips[1])
        if any(moved_by_contact(before, one, self.specs) for one in found):
            return camera_kept(before, after, self.specs)
        return after

    def _elsewhere(self, estimate: Estimate, moved: Moved) -> Estimate:
        if moved.tips is None:
            return estimate
        times, usual = self.camera_times, moved.errors
        errors = replace(usual, per_metre=times * usual.per_metre, per_radian=times * usual.per_radian)
        return seen_from_elsewhere(estimate, self.specs, moved.way, moved.turn, errors)

    def _predicted(self, estimate: Estimate, moved: Moved, log: Log) -> tuple[Estimate, ...]:
        if moved.tips is None:
            return (estimate,)
        try:
            dynamics = self.physics.dynamics_at(estimate.values)
            return predictions(dynamics, self.specs, estimate, *moved.tips, self.prediction)
        except SolveError as error:
            log(f"the last estimate stands in for a prediction: {error}")
            return (estimate,)


def _still_inside(task: Task, predicted: Estimate, after: Estimate, tip: np.ndarray) -> Estimate:
    """An update; where it takes through a wall what was to stay within it, the prediction in its place."""
    left = task.entered(predicted.values, tip) and not task.entered(after.values, tip)
    return replace(after, values=predicted.values, covariance=predicted.covariance) if left else after


def usual_belief(model: Model) -> Belief:
    """Of a cell as calibrated as the task has it."""
    return Belief(model, model, Real2Sim(model), PredictionSettings(), 1.0)


def uncalibrated_belief(model: Model) -> Belief | None:
    """Of a cell that nobody calibrated; None of a task that makes no difference (`Task.uncalibrated`)."""
    task = model.task.uncalibrated()
    if task is None:
        return None
    wider, settings = model.believing(task), Real2SimSettings()
    settings = replace(settings, parts=settings.parts.uncalibrated())
    pairs = zip(task.parameters(), model.task.parameters(), strict=True)
    times = max((wide.scale / usual.scale for wide, usual in pairs if wide.kind == "camera"), default=1.0)
    # A thread that is believed in the wall of its eye is flung out by the prediction; the image decides.
    return Belief(
        model, wider, Real2Sim(wider, settings), replace(PredictionSettings(), jump=2.0), times, True
    )


class BeliefChoice:
    """The belief in force, from the usual one on.

    Args:
        model: of the usual belief.
        settings: when the wider one takes over.
    """

    def __init__(self, model: Model, settings: ChoiceSettings | None = None) -> None:
        self._settings = settings or ChoiceSettings()
        self._usual, self._wider = usual_belief(model), uncalibrated_belief(model)
        self.current = self._usual
        self.evidence = float("nan")  # for the wider belief after the last image, natural logarithm
        self._before: tuple[Estimate, Estimate] | None = None  # both, before any image
        self._rival: Estimate | None = None  # by the wider belief, as long as nothing is chosen
        self._images = 0  # of this episode

    @property
    def uncalibrated(self) -> bool:
        """Whether images have spoken for a cell that nobody calibrated."""
        return self.current is not self._usual

    def begin(self, seen: SeenError) -> Estimate:
        """A new episode: the usual belief before any image."""
        self.current, self._images, self.evidence = self._usual, 0, float("nan")
        first = self._usual.initial(seen)
        self._rival = None if self._wider is None else self._wider.initial(seen)
        self._before = None if self._rival is None else (first, self._rival)
        return first

    def update(self, estimate: Estimate, observation: Observation, moved: Moved, log: Log) -> Estimate:
        """What is believed after an image, by the belief that rules then.

        Raises:
            InputError: see `Real2Sim.update`.
        """
        after = self.current.update(estimate, observation, moved, log)
        if self._rival is None:
            return after
        assert self._wider is not None and self._before is not None  # as long as there is a rival
        self._images += 1
        self._rival = rival = self._wider.update(self._rival, observation, moved, log)
        usual, wide = self._before
        self.evidence = -log_evidence_ratio(usual, wide, rival)
        # Parts that do not fit leave what is believed of them wide, which speaks for neither.
        chosen = self.evidence > self._settings.evidence
        if chosen or self._images >= self._settings.images:
            self._rival = None
        if not chosen:
            return after
        self.current = self._wider
        return rival
