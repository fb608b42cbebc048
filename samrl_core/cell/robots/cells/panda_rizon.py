"""The default two-arm cell: a Panda holds the tool, a Rizon 4 opposite carries the camera.

World z up, table top at z = 0, Panda at the origin, Rizon 1 m ahead and facing it.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.robots.rizon.spec import RIZON4
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose

IMAGE_SIZE = 128  # [px], SAM-RL section IV
VERTICAL_FOV = math.radians(42.0)  # ASSUMPTION: about a RealSense D435's colour camera

PANDA_RIZON = CellSpec(
    name="panda_rizon",
    tool_arm=PANDA,
    camera_arm=RIZON4,
    tool_base_in_world=Pose.identity(),
    camera_base_in_world=Pose.from_rpy(np.array([1.0, 0.0, 0.0]), (0.0, 0.0, math.pi)),
    # ASSUMPTION: hand-eye of a bracket that puts the optical centre on the flange's axis.
    camera_in_flange=Pose(np.array([0.0, 0.0, 0.05]), np.array([0.0, 0.0, 0.0, 1.0])),
    intrinsics=Intrinsics.from_fov(IMAGE_SIZE, IMAGE_SIZE, VERTICAL_FOV),
    camera_mass=0.3,  # ASSUMPTION: RealSense D435 (0.072 kg, datasheet), bracket and cable
    camera_center_of_mass=np.array([0.0, 0.0, 0.03]),  # ASSUMPTION: between bracket and camera
    # ASSUMPTION: solid box 90 x 40 x 60 mm of that mass.
    camera_inertia=0.3 / 12.0 * np.diag([0.04**2 + 0.06**2, 0.09**2 + 0.06**2, 0.09**2 + 0.04**2]),
)
