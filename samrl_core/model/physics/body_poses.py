"""Where the bodies are: forward kinematics in torch, for rendering and measurements of a state."""

from __future__ import annotations

import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physics.layout import Layout
from samrl_core.model.physics.scene import WORLD, JointKind


def body_poses(layout: Layout, q: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Pose of each body in the world, differentiable in the coordinates.

    Args:
        layout: of the scene.
        q: (..., Q) coordinates; quaternions of unit length.

    Returns:
        rotation matrices (..., N, 3, 3) and positions (..., N, 3) [m].
    """
    if q.shape[-1] != len(layout.start_q):
        raise InputError(f"coordinates {tuple(q.shape)} must end in {len(layout.start_q)}")

    def constant(values: object) -> torch.Tensor:
        return torch.as_tensor(values, dtype=q.dtype, device=q.device)

    turns: list[torch.Tensor] = []
    positions: list[torch.Tensor] = []
    for link, kind in enumerate(layout.kind):
        parent, first = int(layout.parent[link]), int(layout.first_q[link])
        if kind == JointKind.FREE:
            turns.append(rotation_of(q[..., first + 3 : first + 7]))
            positions.append(q[..., first : first + 3])
            continue
        if parent == WORLD:
            turn = torch.eye(3, dtype=q.dtype, device=q.device).expand(*q.shape[:-1], 3, 3)
            position = q.new_zeros((*q.shape[:-1], 3))
        else:
            turn, position = turns[parent], positions[parent]
        position = position + turn @ constant(layout.offset[link])
        turn = turn @ constant(layout.turn[link])
        axis = constant(layout.axis[link])
        if kind == JointKind.PRISMATIC:
            position = position + (turn @ axis) * q[..., first, None]
        elif kind == JointKind.REVOLUTE:
            half = 0.5 * q[..., first, None]
            turn = turn @ rotation_of(torch.cat([axis * torch.sin(half), torch.cos(half)], dim=-1))
        turns.append(turn)
        positions.append(position)
    links = [int(link) for link in layout.link_of_body]
    return torch.stack([turns[i] for i in links], dim=-3), torch.stack([positions[i] for i in links], dim=-2)


def rotation_of(quat_xyzw: torch.Tensor) -> torch.Tensor:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    x, y, z, w = quat_xyzw.unbind(dim=-1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], dim=-1),
        torch.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], dim=-1),
        torch.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], dim=-1),
    ]
    return torch.stack(rows, dim=-2)
