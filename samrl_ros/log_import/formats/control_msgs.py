"""Definitions of what ros2_control's controllers publish, for bags that carry none (sqlite3 before Iron).

Fields of control_msgs' releases: github.com/ros-controls/control_msgs.
"""

from __future__ import annotations

_JOINT_TRAJECTORY = "control_msgs/msg/JointTrajectoryControllerState"
_POINT = "trajectory_msgs/JointTrajectoryPoint"
_FREE_POINT = "trajectory_msgs/MultiDOFJointTrajectoryPoint"
_COMMON = {
    "control_msgs/msg/JointControllerState": (
        "std_msgs/Header header\nfloat64 set_point\nfloat64 process_value\nfloat64 process_value_dot\n"
        "float64 error\nfloat64 time_step\nfloat64 command\nfloat64 p\nfloat64 i\nfloat64 d\n"
        "float64 i_clamp\nbool antiwindup\n"
    ),
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
}


def _state(points: list[str], free: list[str]) -> str:
    lines = ["std_msgs/Header header", "string[] joint_names", *(f"{_POINT} {name}" for name in points)]
    if free:
        lines += ["string[] multi_dof_joint_names", *(f"{_FREE_POINT} multi_dof_{name}" for name in free)]
    return "\n".join(lines) + "\n"


_NEW = ["reference", "feedback", "error", "output"]
_OLD = ["desired", "actual"]
# One release each: a bag without definitions does not say which; the one that fits its bytes is taken.
RELEASES = tuple(
    {**_COMMON, _JOINT_TRAJECTORY: _state(points, free)}
    for points, free in (
        ([*_OLD, "error"], []),  # Foxy, Galactic
        ([*_NEW, *_OLD], [*_NEW, *_OLD]),  # between: both names
        (_NEW, _NEW),  # Iron and later
    )
)
