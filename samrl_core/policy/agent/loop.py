"""Which stage of Algorithm 1 comes next; the library's loop and the cell's supervisor ask here."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from samrl_core.cell.tasks.task import Task

# "forced": what the model takes for done, but joints felt more force than the task allows (`run_episode`).
Stage = Literal["view", "act", "again", "retake", "done", "action_limit", "lost", "forced"]


@dataclass(frozen=True)
class LoopSettings:
    """When to search for a view, and when to stop."""

    max_actions: int  # per episode
    view_period: int = 3  # actions from one search for a better view to the next
    views_per_search: int = 1  # camera moves in one search; an update follows each (line 5's loop)
    views_to_aim: int = 2  # the same before an action that needs the task's aim, whichever action it is
    max_lost_updates: int = 5  # updates in a row that may miss the target
    # Misfit up to which "done" counts, over the episode's median. True successes had at most 1.9; a pancake
    # that had rolled out of sight had 34.
    most_misfit: float = 5.0
    # Consecutive updates that must report "done": a pancake may still be falling at the first one.
    done_confirmations: int = 2
    stop_on_model_success: bool = True  # off where the model is not updated and cannot know


@dataclass(frozen=True)
class LoopState:
    """Where an episode stands."""

    step: int = 0  # actions executed
    view_searches: int = 0  # answers of the view search since the last action
    lost_updates: int = 0  # in a row
    confirmed: int = 0  # images in a row after which the model reported "done"
    unsettled: bool = False  # whether the last image left the fit on its way
    retaken: bool = False  # whether an image from this view and place was taken again for it
    misfits: tuple[float, ...] = ()  # eq. 6 after the updates of this episode that saw the target

    def updated(self, why_stopped: str, misfit: float) -> LoopState:
        """After an update that ended so; `misfit` is eq. 6, of any value where nothing was fitted."""
        if why_stopped == "no_target":
            return replace(self, lost_updates=self.lost_updates + 1, unsettled=False)
        fitted, unsettled = (misfit,) if math.isfinite(misfit) else (), why_stopped == "iteration_limit"
        return replace(self, lost_updates=0, unsettled=unsettled, misfits=self.misfits + fitted)

    def view_searched(self) -> LoopState:
        """After an answer of the view search."""
        return replace(self, view_searches=self.view_searches + 1, confirmed=0, retaken=False)

    def acted(self) -> LoopState:
        """After an action."""
        return replace(self, step=self.step + 1, view_searches=0, confirmed=0, retaken=False)

    def confirmed_once(self) -> LoopState:
        """After an update that reported "done", when another one has to confirm it."""
        return replace(self, confirmed=self.confirmed + 1)

    def retaken_once(self) -> LoopState:
        """After an update whose image is taken again; it did not report "done"."""
        return replace(self, retaken=True, confirmed=0)

    def interrupted(self) -> LoopState:
        """After a stop in the middle of whatever it was: the action that was cut off does not count."""
        return replace(self, confirmed=0, retaken=False)

    def fits(self, most: float) -> bool:
        """Whether the last fit's misfit is at most so many times the episode's median."""
        return not self.misfits or self.misfits[-1] <= most * float(np.median(self.misfits))


def stage_after_update(
    task: Task, values: np.ndarray, tip_position: np.ndarray, state: LoopState, settings: LoopSettings
) -> Stage:
    """What follows an update of the model.

    Args:
        task: decides from the estimate whether it is done.
        values: (P,) estimated.
        tip_position: (3,) in the tool arm's base frame [m].
        state: counts, this update included.
        settings: limits.

    Returns:
        "view" or "act"; "again" for an update from another image, before "done" counts; "retake" for one
        where the last image did not settle and the next action needs the aim, once from each view; or how
        the episode ends: "done" by the model, "action_limit", "lost".
    """
    if state.lost_updates > settings.max_lost_updates:
        return "lost"
    # Where an image missed the target, the values are what was predicted.
    counts = settings.stop_on_model_success and not state.lost_updates and state.fits(settings.most_misfit)
    if counts and task.is_done(values, tip_position):
        return "done" if state.confirmed + 1 >= settings.done_confirmations else "again"
    if state.step >= settings.max_actions:
        return "action_limit"
    allowed = settings.views_per_search if state.step % settings.view_period == 0 else 0
    if task.needs_aim(values, tip_position):
        # Another image costs no action; one that did not settle may send the tool aside.
        if state.unsettled and not state.retaken:
            return "retake"
        if settings.views_per_search:
            allowed = max(allowed, settings.views_to_aim)
    return "view" if state.view_searches < allowed else "act"
