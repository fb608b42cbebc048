"""Worlds by kind. `pybullet` is imported only when it is asked for."""

from __future__ import annotations

from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.scene import Scene
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError

WORLDS = ("pybullet", "mock")
DEFAULT_WORLD = WORLDS[0]


def make_world(
    kind: str,
    task: Task,
    cell: CellSpec,
    settings: WorldSettings | None = None,
    scene: Scene | None = None,
    instance: CellInstance | None = None,
) -> SimulatedWorld:
    """A world with the cell and the task in it.

    Args:
        kind: `pybullet` (physics and noise) or `mock` (perfect tracking, grey image).
        task: whose scene is laid.
        cell: the two arms and the camera.
        settings: of the physics and the noise; the mock has neither.
        scene: in place of the task's own, as with a heavier tool.
        instance: in what the cell really differs from `cell`; None for nothing.

    Raises:
        InputError: no such kind, PyBullet is not installed, or a mock of a cell that differs.
    """
    if kind == "mock":
        from samrl_core.cell.world.mock_world import MockWorld

        if instance is not None and not instance.is_nominal:
            raise InputError(f"world 'mock' has no instance {instance.name}; use world 'pybullet'")
        return MockWorld(task, cell, scene)
    if kind == "pybullet":
        try:
            import pybullet  # noqa: F401
        except ImportError as error:
            raise InputError(
                "world 'pybullet' needs the package pybullet, which is not installed. Wheels exist up to "
                "Python 3.11; on 3.12 build it once (README, 'PyBullet on Python 3.12'), or use world 'mock'"
            ) from error
        from samrl_core.cell.world.pybullet.world import PyBulletWorld

        return PyBulletWorld(task, cell, settings, scene, instance)
    raise InputError(f"no world is of kind {kind!r}; there are: {', '.join(WORLDS)}")
