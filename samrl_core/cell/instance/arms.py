"""Arms: what drives and loads do that the controller's model does not foresee."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.instance.difference import difference

_FRICTION = (
    "FrankaEmikaPandaDynModel issue 6: Coulomb 0.245 N m in a Panda's joint 1 after its own compensation,"
    " 0.3 % of 87 N m; joints without it have ten times as much"
)
_OFFSET = (
    "`Tolerances` of recordings, 0.4 % of the effort limit; franka_ros issue 404 for what calibration leaves"
)
_GAIN = "Kinova, Flexiv and Franka publish none; ASSUMPTION: torque sensors of 1 % class"
_LOAD = "ASSUMPTION: a load weighed on kitchen scales, its centre by eye; careless: what the drawing says"


@dataclass(frozen=True, eq=False)
class ArmDifferences:
    """Per joint, shares of the effort limit unless said otherwise."""

    tool_friction: np.ndarray = difference(
        "Coulomb friction in the tool arm's joints", "-", "share", 0.003, 0.010, _FRICTION, ("tool_arm",)
    )
    camera_friction: np.ndarray = difference(
        "Coulomb friction in the camera arm's joints", "-", "share", 0.003, 0.010, _FRICTION, ("camera_arm",)
    )
    tool_torque_offset: np.ndarray = difference(
        "torque that the tool arm's drives add", "-", "normal", 0.003, 0.012, _OFFSET, ("tool_arm",)
    )
    camera_torque_offset: np.ndarray = difference(
        "torque that the camera arm's drives add", "-", "normal", 0.003, 0.012, _OFFSET, ("camera_arm",)
    )
    tool_gain: np.ndarray = difference(
        "true over commanded torque less 1, tool arm", "-", "normal", 0.008, 0.03, _GAIN, ("tool_arm",)
    )
    camera_gain: np.ndarray = difference(
        "true over commanded torque less 1, camera arm", "-", "normal", 0.008, 0.03, _GAIN, ("camera_arm",)
    )
    tool_sensor_offset: np.ndarray = difference(
        "torque that the tool arm's sensors read too much",
        "-",
        "normal",
        0.003,
        0.012,
        _OFFSET,
        ("tool_arm",),
    )
    camera_sensor_offset: np.ndarray = difference(
        "torque that the camera arm's sensors read too much",
        "-",
        "normal",
        0.003,
        0.012,
        _OFFSET,
        ("camera_arm",),
    )
    payload_mass: np.ndarray = difference(
        "mass of tool and of camera, share of what the controller is told",
        "-",
        "normal",
        0.03,
        0.12,
        _LOAD,
        (2,),
    )
    payload_centre: np.ndarray = difference(
        "centre of mass of tool and of camera, flange axes", "m", "normal", 0.003, 0.012, _LOAD, (2, 3)
    )

    def friction(self, role: str) -> np.ndarray:
        """(J,) shares of the effort limit."""
        return {"tool_arm": self.tool_friction, "camera_arm": self.camera_friction}[role]

    def torque_offset(self, role: str) -> np.ndarray:
        """(J,) shares of the effort limit."""
        return {"tool_arm": self.tool_torque_offset, "camera_arm": self.camera_torque_offset}[role]

    def gain(self, role: str) -> np.ndarray:
        """(J,) shares."""
        return {"tool_arm": self.tool_gain, "camera_arm": self.camera_gain}[role]

    def sensor_offset(self, role: str) -> np.ndarray:
        """(J,) shares of the effort limit."""
        return {"tool_arm": self.tool_sensor_offset, "camera_arm": self.camera_sensor_offset}[role]
