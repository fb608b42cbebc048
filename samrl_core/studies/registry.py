"""The experiments by name; each one's module is read when it is asked for."""

from __future__ import annotations

from importlib import import_module

from samrl_core.common.errors import InputError
from samrl_core.studies.experiment import Experiment

MODULES: dict[str, str] = {  # module of `samrl_core.studies`, by the experiment's name
    "cell_instances": "cell_instances",
    "cell_residual": "cell_residual",
    "cell_sensitivity": "cell_sensitivity",
    "fig6": "paper.fig6",
    "fig7": "paper.fig7",
    "fig8d": "paper.fig8d",
    "sample_efficiency": "paper.sample_efficiency",
    "restored_success": "restored_success",
    "table1": "paper.table1.table1",
    "table1_world": "paper.table1.table1_world",
}


def experiment_named(name: str) -> Experiment:
    """The experiment.

    Raises:
        InputError: there is none of this name.
    """
    if name not in MODULES:
        raise InputError(f"no experiment is named {name!r}; there are: {', '.join(sorted(MODULES))}")
    found = import_module(f"samrl_core.studies.{MODULES[name]}").EXPERIMENT
    assert isinstance(found, Experiment)
    return found
