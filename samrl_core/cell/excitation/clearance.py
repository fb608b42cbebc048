"""Whether an arm keeps off the table and off itself: distances along the line through its link origins.

A plausibility check for motions near a pose that is known to be free, not a collision engine: links are
taken as the line from base to flange, the payload as a rod.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.robots.urdf import child_link, links_to_flange
from samrl_core.cell.types.pose import Pose

LINK_HEIGHT = 0.15  # least height of the moving line above the base's foot, half a link and margin [m]
TIP_HEIGHT = 0.10  # least height of flange and payload [m]
SELF_DISTANCE = 0.12  # least distance of two parts of the line, about one link diameter [m]
_FIXED_ARC = 0.30  # of the line from the foot on: column and shoulder, which cannot reach the table [m]
_NEIGHBOUR_ARC = 0.40  # parts of the line nearer than this along it are neighbours [m]
_SPACING = 0.05  # of the points on the line [m]


@dataclass(frozen=True)
class Clearance:
    """Worst of a motion, each less what is required: negative is too near [m]."""

    height: float
    self_distance: float

    @property
    def worst(self) -> float:
        """The smaller one [m]."""
        return min(self.height, self.self_distance)


class ArmLine:
    """The line through an arm's link origins; the foot stands on the table, as in the cell."""

    def __init__(self, spec: RobotSpec, payload: Payload | None, base_in_world: Pose | None = None) -> None:
        self.model = ArmModel(spec, base_in_world or Pose.identity(), payload)
        self._links = links_to_flange(spec)
        self._fixed_arc = self._fixed()
        # A payload's far end, were its centre of mass its middle.
        reach = np.zeros(3) if payload is None else 2.0 * np.asarray(payload.center_of_mass, dtype=np.float64)
        self._tip_in_flange = reach

    def _fixed(self) -> float:
        """Length of line that is not held against the table [m]: more where the shoulder stands that low."""
        placed = self.model.link_poses_in_world(self.model.spec.home)
        corners = np.array([placed[link].position for link in self._links])
        shoulder = self._links.index(child_link(self.model.spec, self.model.spec.joint_names[1]))
        height = corners[shoulder, 2] - corners[0, 2]
        arc = float(np.linalg.norm(np.diff(corners[: shoulder + 1], axis=0), axis=1).sum())
        return _FIXED_ARC if height >= LINK_HEIGHT else arc + LINK_HEIGHT

    def points(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points on the line (M, 3) [m] and their distance from the foot along it (M,) [m], tip last."""
        placed = self.model.link_poses_in_world(q)
        poses = [placed[link] for link in self._links]
        corners = np.array([*(p.position for p in poses), poses[-1].apply(self._tip_in_flange)])
        lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        arc = np.concatenate([[0.0], np.cumsum(lengths)])
        keep = np.concatenate([[True], lengths > 1e-9])
        at = np.linspace(0.0, arc[-1], max(2, int(np.ceil(arc[-1] / _SPACING)) + 1))
        return np.stack([np.interp(at, arc[keep], corners[keep, k]) for k in range(3)], axis=1), at

    def clearance(self, positions: np.ndarray) -> Clearance:
        """Worst over positions (N, J) [rad]."""
        height = distance = np.inf
        for q in positions:
            points, arc = self.points(q)
            moving = arc > self._fixed_arc
            least = np.where(arc[moving] > arc[-1] - 0.2, TIP_HEIGHT, LINK_HEIGHT)
            height = min(height, float((points[moving, 2] - least).min()))
            apart = np.linalg.norm(points[:, None] - points[None], axis=2)
            far = np.abs(arc[:, None] - arc[None]) > _NEIGHBOUR_ARC
            distance = min(distance, float(apart[far].min()) - SELF_DISTANCE)
        return Clearance(height, distance)
