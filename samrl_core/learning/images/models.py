"""Models and renderers of tasks in the default cell, one per process: kernels and meshes are loaded once."""

from __future__ import annotations

from functools import cache

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.model.model import Model


@cache
def model_of(task: str) -> Model:
    """The task's model."""
    return Model(task_named(task), cell_named())


@cache
def renderer_of(task: str, device: str) -> BatchRenderer:
    """It draws `model_of(task)` on a device."""
    return BatchRenderer(model_of(task), device)
