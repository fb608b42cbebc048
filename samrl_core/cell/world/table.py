"""The cell's table in a PyBullet client."""

from __future__ import annotations

import numpy as np
import pybullet

from samrl_core.cell.types.pose import Pose

TABLE_SIZE = (0.8, 1.0, 0.05)  # [m]
TABLE_IN_WORLD = Pose(np.array([0.5, 0.0, -0.025]), np.array([0.0, 0.0, 0.0, 1.0]))  # its top is z = 0
TABLE_COLOR = (0.55, 0.50, 0.45)
TABLE_FRICTION = 0.3  # ASSUMPTION [-]


def build_table(client: int, solid: bool, seen: bool = True, height: float = 0.0) -> int:
    """Number of a new body that does not move.

    Args:
        client: physics client.
        solid: things rest on it; else it is there to be seen.
        seen: its top is drawn by the camera; else somebody paints it behind the picture.
        height: of its top over the drawn one [m].
    """
    half = [0.5 * size for size in TABLE_SIZE]
    collision = -1  # PyBullet's number for none
    if solid:
        collision = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    # Without any visual shape, a camera would draw the collision shape.
    shown = half if seen else [1e-4] * 3
    visual = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=shown, rgbaColor=[*TABLE_COLOR, 1.0], physicsClientId=client
    )
    position = (TABLE_IN_WORLD.position + [0.0, 0.0, height]).tolist()
    return pybullet.createMultiBody(0.0, collision, visual, position, physicsClientId=client)
