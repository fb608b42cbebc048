"""Strategies by name, as a training of a task begins with them."""

from __future__ import annotations

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.adr import Adr, AdrSettings
from samrl_core.learning.randomisation.found import FoundSettings, Real2SimUpdated, found_starts
from samrl_core.learning.randomisation.of_task import (
    appearances_of,
    physical_parameter_space,
    starts_of,
    together,
)
from samrl_core.learning.randomisation.simopt import SimOpt, SimOptSettings
from samrl_core.learning.randomisation.strategy import (
    ADR,
    RANDOMISATIONS,
    REAL2SIM,
    SIMOPT,
    Strategy,
    Uniform,
)
from samrl_core.learning.states.visited import VisitedStates
from samrl_core.model.model import Model


def begin(
    name: str,
    model: Model,
    visited: VisitedStates | None,
    adr: AdrSettings,
    simopt: SimOptSettings,
    found: FoundSettings,
) -> Strategy:
    """A strategy before its first question.

    Args:
        name: of `RANDOMISATIONS`.
        model: of the task.
        visited: what Real2Sim has estimated in the cell: starts for "real2sim", trajectories for "simopt".
        adr: settings of "adr".
        simopt: settings of "simopt".
        found: settings of "real2sim".

    Raises:
        InputError: no such strategy, one that needs states of the cell or uses none of them, or a model
            without what it fits.
    """
    if name not in RANDOMISATIONS:
        raise InputError(f"no randomisation is named {name!r}; there are: {', '.join(RANDOMISATIONS)}")
    task = model.task
    if name == REAL2SIM:
        strategy = Real2SimUpdated.begin(starts_of(task), found)
        return strategy if visited is None else strategy.update(found_starts(task, visited))
    physical = physical_parameter_space(model.dynamics)
    starts_and_appearances = together(starts_of(task), appearances_of(model))
    if name == SIMOPT:
        if physical is None:
            raise InputError(
                f"the model of {task.name} has no physical parameter that 'simopt' could fit; take 'uniform' "
                f"or 'adr'"
            )
        if visited is None:
            raise InputError("'simopt' compares the model with the cell; hand in the cell's visited states")
        return SimOpt.begin(physical, starts_and_appearances, simopt)
    if visited is not None:
        raise InputError(f"{name!r} uses no states of the cell; leave the visited ones out")
    everything = together(starts_and_appearances, physical)
    return Adr.begin(everything, adr) if name == ADR else Uniform(everything)
