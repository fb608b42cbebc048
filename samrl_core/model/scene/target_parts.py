"""The target by labels: what a mask tells apart is compared with an image apart, too."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.model.scene.body_motion import BodyMotion, central_differences
from samrl_core.model.scene.chain_skin import CHAIN
from samrl_core.model.scene.scene_mesh import SceneMesh
from samrl_core.model.scene.target import TargetPart


def target_parts(
    task: Task, mesh: SceneMesh, labels: Mapping[str, int], motion: BodyMotion
) -> tuple[TargetPart, ...]:
    """Parts of what the parameters move, the chain first.

    Args:
        task: whose parameters.
        mesh: of the scene.
        labels: of the frames that move.
        motion: of the task's bodies.

    Raises:
        InputError: things of several labels move with the same parameters, other than the camera's.
    """
    count = len(task.parameters())
    by_label: dict[int, set[str]] = {}
    for name, label in labels.items():
        by_label.setdefault(label, set()).add(name)
    order = sorted(by_label, key=lambda label: (CHAIN not in by_label[label], label))
    alone = len(order) == 1
    moving = [
        np.ones(count, dtype=bool) if alone else _moving(task, motion, by_label[label]) for label in order
    ]
    if (np.sum(moving, axis=0) > 1).any():
        raise InputError(
            f"task {task.name} moves things with labels {sorted(by_label)} by the same parameters; give them "
            f"one label, or parameters of their own"
        )
    camera = np.array([p.kind == "camera" for p in task.parameters()])
    faces = mesh.topology.faces
    parts = []
    for label, own in zip(order, moving, strict=True):
        vertices = torch.from_numpy(mesh.target_of(by_label[label]))
        parameters = np.flatnonzero(own | camera)
        parts.append(
            TargetPart(
                label,
                frozenset(by_label[label]),
                CHAIN in by_label[label],
                vertices,
                faces[vertices.numpy()[faces[:, 0]] > 0],
                np.unique(mesh.group[(vertices > 0) & mesh.is_grouped].numpy()),
                parameters,
                own[parameters] if alone else (own & ~camera)[parameters],
            )
        )
    return tuple(parts)


def _moving(task: Task, motion: BodyMotion, frames: set[str]) -> np.ndarray:
    """Which parameters (P,) move any of the frames where all are nominal."""
    specs = task.parameters()
    nominal, scale = np.array([[p.nominal, p.scale] for p in specs]).T
    moves = np.zeros(len(specs), dtype=bool)
    for name, jacobian in motion.jacobians(nominal).items():
        if name in frames:
            moves |= np.abs(jacobian).max(axis=0) > 0.0
    if CHAIN in frames:
        moves |= np.abs(central_differences(task.chain_angles, nominal, scale)).max(axis=0) > 0.0
        longer = central_differences(lambda v: np.array([task.chain_stretch(v)]), nominal, scale)
        moves |= np.abs(longer).max(axis=0) > 0.0
    return moves
