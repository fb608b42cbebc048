"""What figures that look at the networks share: a task's renderer and networks, once per process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch

from samrl_core.agent.settings import trained_networks
from samrl_core.experiments.experiment import Options
from samrl_core.learn.batch_render import BatchRenderer
from samrl_core.learn.sensing_value import Networks
from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named

DEVICE_PROCESSES = 8  # that share a GPU: each has a context of its own there


@dataclass(frozen=True, eq=False)
class ViewBench:
    """On one device."""

    renderer: BatchRenderer
    networks: Networks


@cache
def model_of(task: str) -> Model:
    """In the default cell."""
    return Model(task_named(task), default_cell())


@cache
def view_bench(task: str, device: str, weights: Path | None) -> ViewBench:
    """Networks of a folder, or those of the package.

    Raises:
        InputError: a file is missing or does not fit.
    """
    model = model_of(task)
    networks = trained_networks(task, model.cell, weights)
    for network in (networks.actor, networks.q):
        network.to(torch.device(device))
    return ViewBench(BatchRenderer(model, device), networks)


def processes(options: Options) -> int:
    """How many to use."""
    return options.processes if options.device == "cpu" else min(options.processes, DEVICE_PROCESSES)
