"""The chosen view as markers: where the camera shall stand, what it looks at, and what that is worth."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from samrl_ros.conversions import from_message, to_message

REACH = 0.15  # length of the arrow along the optical axis [m]
ABOVE = 0.05  # of the text over the camera [m]
MOVES = ColorRGBA(r=0.0, g=0.62, b=0.45, a=1.0)
STAYS = ColorRGBA(r=0.6, g=0.6, b=0.6, a=1.0)


def view_marks(target: Any) -> MarkerArray:
    """An arrow from the camera's place along its axis, and its score beside the present one's.

    Args:
        target: samrl_msgs/ViewTarget.
    """
    pose = from_message.pose(target.camera_in_world)
    color = MOVES if target.move else STAYS
    arrow = _marker(target, 0, Marker.ARROW, color)
    arrow.points = [_point(pose.position), _point(pose.position + REACH * pose.rotation[:, 2])]
    arrow.scale.x, arrow.scale.y, arrow.scale.z = 0.012, 0.03, 0.04  # shaft, head, head's length [m]
    text = _marker(target, 1, Marker.TEXT_VIEW_FACING, color)
    text.pose = to_message.pose(pose)
    text.pose.position.z += ABOVE
    text.scale.z = 0.05  # height of a letter [m]
    verb = "move" if target.move else "stay"
    text.text = f"{verb}: {target.score:.3f}, here {target.present_score:.3f}"
    return MarkerArray(markers=[arrow, text])


def _marker(target: Any, number: int, kind: int, color: ColorRGBA) -> Marker:
    stamp_ns = from_message.stamp_ns(target)
    marker = Marker(header=to_message.header(stamp_ns, "world"), ns="view", id=number, type=kind)
    marker.action, marker.color = Marker.ADD, color
    marker.pose.orientation.w = 1.0
    return marker


def _point(position: Any) -> Point:
    return Point(x=float(position[0]), y=float(position[1]), z=float(position[2]))
