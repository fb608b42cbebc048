"""Who touches whom, read off the parts.

A chain's capsules and a cylinder's rims are rows of balls against all solids that stand fixed. Where an
edge may press into a cylinder (the blade's, the lip's, the rim of a hole), balls along it meet that
cylinder's solid. Friction is the geometric mean of two bodies' figures, as in the tasks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.scene import Body, Box, Capsule, ChainLink, Cylinder, Part, Tool
from samrl_core.common.errors import InputError
from samrl_core.model.physics.scene import WORLD, ContactPair
from samrl_core.model.task_dynamics.settings import ContactSettings
from samrl_core.model.task_dynamics.solids import capsule_balls, edge_balls, rim_balls, ring_of


@dataclass(frozen=True, eq=False)
class SceneBody:
    """A body of the scene and its index in the physics model."""

    index: int
    solids: int  # number of its shapes
    friction: float  # [-]


class ContactPairs:
    """Collects the pairs of a scene in `found`."""

    def __init__(self, settings: ContactSettings) -> None:
        self._settings = settings
        self.found: list[ContactPair] = []

    def chain(self, links: tuple[ChainLink, ...], first: int, fixed: list[SceneBody]) -> None:
        """Links, the first of which is body `first`, against what stands fixed; the table is out of reach."""
        s = self._settings
        for k, link in enumerate(links):
            for part in link.parts:
                if not isinstance(part, Capsule):
                    raise InputError(f"link {link.name} has a part that is no capsule; chains need capsules")
                balls = capsule_balls(part, s.link_balls)
                me = SceneBody(first + k, 0, link.friction)
                for other in fixed:
                    self._meet(me, balls, part.radius, other, s.chain_stiffness)

    def movable(self, body: Body, me: SceneBody, fixed: list[SceneBody], tool: SceneBody) -> None:
        """A movable body of cylinders with rounded rims, against the table, the fixed and what is held."""
        for part in body.parts:
            if not isinstance(part, Cylinder) or body.rounding <= 0.0:
                raise InputError(f"movable body {body.name} must be made of cylinders with rounded rims")
            balls = rim_balls(part, body.rounding, self._settings.rim_balls)
            for other in (*self._table(), *fixed, tool):
                self._meet(me, balls, body.rounding, other)

    def edges(self, body: Body, me: SceneBody, others: list[SceneBody]) -> None:
        """The upper edges of a fixed body against cylinders: of a single box, or of a hole."""
        s = self._settings
        ring = ring_of(body)
        if ring is not None:
            inner, _, top = ring
            angle = 2 * np.pi * np.arange(s.rim_balls) / s.rim_balls
            circle = (inner + s.edge) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            balls = np.column_stack([circle, np.full(len(angle), top - s.edge)])
        elif len(body.parts) == 1 and isinstance(body.parts[0], Box):
            half = body.parts[0].half_extents
            axis = 0 if half[0] >= half[1] else 1
            balls = edge_balls(body.parts[0], s.edge, axis, ((-1, 1), (1, 1)), 2 * s.edge_balls)
        else:
            return
        for other in others:
            self._meet(me, balls, s.edge, other)

    def held(
        self, tool: Tool, part: Part | None, me: SceneBody, fixed: list[SceneBody], moved: list[SceneBody]
    ) -> None:
        """What is held: a box's leading edges against movable bodies, a cylinder's end against all else."""
        s = self._settings
        flange_in_tip = tool.tip_in_flange.inverse()
        if isinstance(part, Box):
            ahead = 1 if part.part_in_body.inverse().apply(tool.tip_in_flange.position)[0] > 0 else -1
            balls = edge_balls(part, s.edge, 1, ((ahead, -1), (ahead, 1)), s.edge_balls)
            others = moved
        elif isinstance(part, Cylinder):
            balls = rim_balls(part, s.edge, s.rim_balls, both=False)
            others = [*self._table(), *fixed, *moved]
        else:
            return
        for other in others:
            self._meet(me, flange_in_tip.apply(balls), s.edge, other)

    def _table(self) -> list[SceneBody]:
        return [SceneBody(WORLD, 1, self._settings.table_friction)]

    def _meet(
        self, me: SceneBody, balls: np.ndarray, radius: float, other: SceneBody, stiffness: float = 0.0
    ) -> None:
        s = self._settings
        friction = float(np.sqrt(me.friction * other.friction))
        for solid in range(other.solids):
            self.found.append(
                ContactPair(
                    me.index,
                    balls,
                    other.index,
                    solid,
                    radius,
                    friction,
                    stiffness or s.stiffness,
                    s.dissipation,
                )
            )
