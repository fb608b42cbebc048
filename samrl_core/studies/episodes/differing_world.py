"""The world that the model does not know: what the residual is trained in, and the ablations evaluated in.

Three things differ from the nominal world, none of which the model knows. The tool arm's
impedance is soft, its joints have friction and its gravity compensation falls short, so that small
displacements are lost and the tool gives way. The light falls from another side and bodies cast shadows.
Depth and colour are noisier. Where it is asked for, the calibration is off as well: the camera arm's base
is not where the calibration has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.sensor_noise import RgbdNoise
from samrl_core.cell.world.settings import WorldSettings

# ASSUMPTIONS, all of them: chosen to be such as a laboratory meets, before any result was known.
STIFFNESS_SHARE = 0.25  # of the nominal joint stiffness; damping falls by its root and keeps its ratio
JOINT_FRICTION = 0.003  # of the effort limits: 0.26 N m in joints 1 to 4; the nominal world has none
UNCOMPENSATED = 0.03  # of the weight that the arms carry, their own links included
TOWARDS_LIGHT = (-0.5, 0.9, 0.8)  # nominal: (0.6, 0.4, 1.2)
NOISE = RgbdNoise(
    subpixel=0.24,  # three times the nominal: 1.7 mm at 0.4 m
    correlated_share=0.7,
    edge_dropout=0.7,
    speckle=0.01,
    color_read=4.0,
    color_shot=0.06,
    mask_boundary=0.8,
    mask_blobs=0.6,
)


def differing_settings() -> WorldSettings:
    """Light, noise, friction, and a weight that the gravity compensation does not know."""
    nominal = WorldSettings()
    x, y, z = nominal.gravity
    heavier = 1.0 + UNCOMPENSATED
    return replace(
        nominal,
        gravity=(heavier * x, heavier * y, heavier * z),
        joint_friction=JOINT_FRICTION,
        light_direction=TOWARDS_LIGHT,
        shadow=True,
        rgbd_noise=NOISE,
    )


def differing_cell(cell: CellSpec, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> CellSpec:
    """The cell as it really is where `cell` is what is known of it: a soft tool arm, and a camera arm that
    stands off by (3,) in world [m].
    """
    nominal = cell.tool_arm.controller
    soft = replace(
        nominal,
        stiffness=STIFFNESS_SHARE * nominal.stiffness,
        damping=STIFFNESS_SHARE**0.5 * nominal.damping,
    )
    base = cell.camera_base_in_world
    moved = Pose(base.position + np.asarray(offset, dtype=np.float64), base.quat_xyzw)
    return replace(cell, tool_arm=replace(cell.tool_arm, controller=soft), camera_base_in_world=moved)


def differing_world(task: Task, cell: CellSpec, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> PyBulletWorld:
    """The world; whoever acts in it keeps the nominal `cell`.

    `offset` (3,) is how far off the camera arm's base is in world [m].
    """
    return PyBulletWorld(task, differing_cell(cell, offset), differing_settings())


def trained_offset(metrics: Mapping[str, float]) -> tuple[float, float, float]:
    """The offset (3,) [m] of the world that a residual was trained in, from its weight file."""
    x, y, z = (metrics.get(f"offset_{axis}", 0.0) for axis in "xyz")
    return x, y, z
