"""Where a peg's tip goes when displaced near a block with a round hole (eq. 3 for peg insertion).

The peg is rigid, upright and held rigidly, and the arm is stiff against everything but the block, so
the state is the tip alone. Peg and hole are round with parallel axes; so the peg shrinks to its tip if the
block grows by the peg's radius: a hole of the clearance's radius c, an outside of radius outer + r.
A displacement is followed exactly in free space. Where it meets the block:

* crossing the top between hole and outside: the tip stays on the top and slides (no friction);
* inside the hole: the lateral part is held within c; outside the block: held out of it;
* the table stops the tip at its height.

Two smoothings make this differentiable. A wall gives way by at most half of `softness` (quadratic
first touch, then stiff). Whether the peg meets the rim is a soft step over the lateral distance of
width `rim`, so that near the rim the next height depends on the lateral position. ASSUMPTION: both
widths, chosen well below the clearance of 2 mm.
Valid for displacements of one control period (about 1 cm); jamming and friction are not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.types.scene import Body, Box, Cylinder, Tool
from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class PegAndHole:
    """Sizes of the upright peg and of the block, whose origin is on the hole's axis."""

    peg_radius: float  # [m]
    hole_radius: float  # [m]
    outer_radius: float  # of the block [m]
    top: float  # height of the block's top above its origin [m]
    softness: float = 1.0e-4  # [m]
    rim: float = 1.0e-4  # [m]

    def __post_init__(self) -> None:
        if not 0 < self.peg_radius < self.hole_radius < self.outer_radius:
            raise InputError(
                f"peg radius {self.peg_radius}, hole radius {self.hole_radius}, outer radius "
                f"{self.outer_radius} m must be positive and grow in this order"
            )
        if not (self.top > 0 and self.softness > 0 and self.rim > 0):
            raise InputError(f"top {self.top}, softness {self.softness}, rim {self.rim} m must be positive")


def sizes_from(tool: Tool, body: Body) -> PegAndHole:
    """Reads the sizes off a tool whose cylinder ends at the tip, and a body made of a ring of boxes.

    Raises:
        InputError: the tool has no such cylinder, or the body is not a ring of boxes with radial x axes.
    """
    tip = tool.tip_in_flange.position
    pegs = []
    for part in tool.parts:
        if isinstance(part, Cylinder):
            end = part.part_in_body.apply(np.array([0.0, 0.0, 0.5 * part.length]))
            if np.linalg.norm(end - tip) < 1e-6:
                pegs.append(part.radius)
    if len(pegs) != 1:
        raise InputError(f"tool {tool.name} has {len(pegs)} cylinders that end at its tip, must be one")
    inner, outer, top = [], [], []
    for part in body.parts:
        if not isinstance(part, Box):
            raise InputError(f"body {body.name} has a part that is no box; only rings of boxes have a model")
        pose, half = part.part_in_body, part.half_extents
        distance = float(np.hypot(pose.position[0], pose.position[1]))
        axis = pose.rotation[:, 0]
        if distance < 1e-9 or axis[:2] @ pose.position[:2] < distance * (1.0 - 1e-6):
            raise InputError(f"body {body.name} is not a ring: a box's x axis is not radial")
        inner.append(distance - half[0])
        outer.append(distance + half[0])
        top.append(pose.position[2] + half[2])
    if not inner:
        raise InputError(f"body {body.name} has no parts")
    return PegAndHole(pegs[0], min(inner), max(outer), max(top))


def _beyond(x: torch.Tensor, softness: float) -> torch.Tensor:
    """How far a wall pushes back: 0 for x <= 0, then quadratic, then x - softness / 2."""
    x = x.clamp_min(0.0)
    return torch.where(x < softness, x.square() / (2 * softness), x - 0.5 * softness)


def step(
    tip: torch.Tensor, action: torch.Tensor, origin: torch.Tensor, sizes: PegAndHole, table_height: float
) -> torch.Tensor:
    """Tip after one displacement; differentiable in all three tensors.

    Args:
        tip: (..., 3) [m], in a frame whose z axis is the peg's and the hole's.
        action: (..., 3) displacement [m].
        origin: (3,) of the block: on the hole's axis, at its base [m].
        sizes: of peg and block.
        table_height: z of the table in the same frame [m].

    Returns:
        (..., 3) [m], equal to tip + action wherever nothing is touched.
    """
    clearance = sizes.hole_radius - sizes.peg_radius
    outside = sizes.outer_radius + sizes.peg_radius
    top = origin[2] + sizes.top
    aim = tip + action
    above0, above1 = tip[..., 2] - top, aim[..., 2] - top
    # Share of the displacement after which the tip is level with the top, and where that is.
    fall = above0 - above1
    going_down = fall > 1e-12
    share = torch.where(going_down, above0 / torch.where(going_down, fall, torch.ones_like(fall)), 0.0 * fall)
    level = tip[..., :2] + share.clamp(0.0, 1.0)[..., None] * action[..., :2] - origin[:2]
    radius_there = _norm(level)
    on_block = torch.sigmoid((radius_there - clearance) / sizes.rim) * torch.sigmoid(
        (outside - radius_there) / sizes.rim
    )
    # Deeper than a tip can sink into the top: it is in the hole or beside the block, not on the top.
    resting = torch.sigmoid((above0 + 5 * sizes.softness) / (0.5 * sizes.softness))
    lift = on_block * resting * _beyond(-above1, sizes.softness)
    height = above1 + lift
    # Walls act on the part of the tip that is below the top.
    offset = aim[..., :2] - origin[:2]
    radius = _norm(offset)
    start_inside = _norm(tip[..., :2] - origin[:2]) < 0.5 * (clearance + outside)
    push = torch.where(
        start_inside,
        -_beyond(radius - clearance, sizes.softness),
        _beyond(outside - radius, sizes.softness),
    )
    below = torch.sigmoid((-height - 3 * sizes.softness) / (0.2 * sizes.softness))  # not when resting on it
    walled = torch.where(height < 0.0, below, torch.zeros_like(below))
    lateral = aim[..., :2] + offset * (walled * push / radius)[..., None]
    z = aim[..., 2] + lift
    z = z + _beyond(table_height - z, sizes.softness)
    return torch.cat([lateral, z[..., None]], dim=-1)


def _norm(v: torch.Tensor) -> torch.Tensor:
    """Length, with a finite gradient at zero."""
    return (v.square().sum(dim=-1) + 1e-18).sqrt()
