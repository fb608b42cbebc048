"""Shared by the figures about the networks: a task's renderer and networks, once per process."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from multiprocessing import current_process
from pathlib import Path

import torch

from samrl_core.common.executor import Workers
from samrl_core.learning.images.batch_render import BatchRenderer, renderer_of
from samrl_core.policy.agent.settings import trained_networks
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.studies.experiment import Options

DEVICE_PROCESSES = 8  # that share a GPU: each has a context of its own there


@dataclass(frozen=True, eq=False)
class ViewBench:
    """On one device."""

    renderer: BatchRenderer
    networks: Networks


@cache
def view_bench(task: str, cell: str, device: str, weights: Path | None) -> ViewBench:
    """Networks of a folder, or those of the package.

    Args:
        task: its name.
        cell: its name.
        device: torch's name. Where "cuda" alone is asked for, a pool's processes share out the GPUs.
        weights: the folder; None takes the package's.

    Raises:
        InputError: a file is missing or does not fit.
    """
    renderer = renderer_of(task, cell, _own_device(device))
    networks = trained_networks(task, renderer.model.cell, weights)
    for network in (networks.actor, networks.q):
        network.to(renderer.device)
    return ViewBench(renderer, networks)


def _own_device(device: str) -> str:
    """Processes take turns where "cuda" alone is asked for."""
    if device != "cuda":
        return device
    number = re.search(r"\d+$", current_process().name)  # of pools' processes, from 1
    return f"cuda:{(int(number.group()) if number else 0) % torch.cuda.device_count()}"


def spread(options: Options) -> Workers:
    """How many to use."""
    if options.device == "cpu" or options.ray:
        return options.spread
    return min(options.processes, DEVICE_PROCESSES)
