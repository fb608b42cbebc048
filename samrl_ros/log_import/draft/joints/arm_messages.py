"""What fields of arms' own state messages are, as their makers document them.

Sources: `franka_msgs` of github.com/frankaemika/franka_ros and franka_ros2 with libfranka's `RobotState`,
`flexiv_msgs` of github.com/flexivrobotics/flexiv_ros2, `lbr_fri_idl` of github.com/lbr-stack, `kortex_driver`
of github.com/Kinovarobotics/ros_kortex; that Kinova's sensors give the reaction is said in its examples of
torque control: "Torque measure is reversed compared to actuator direction".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from samrl_ros.log_import.draft.column_names import SLOT, NameMeaning, words_in

_POSITION, _VELOCITY, _EFFORT = (
    NameMeaning(quantity, measured=True) for quantity in ("position", "velocity", "effort")
)
_ASKED, _ASKED_RATE = (NameMeaning(quantity, commanded=True) for quantity in ("position", "velocity"))
_ELSE = NameMeaning(computed=True)
_OF_UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    *(f"wrist_{k}_joint" for k in (1, 2, 3)),
)
# ros2's ur_robot_driver, hardware_interface.cpp: the effort of a joint is RTDE's `actual_current`.
CURRENTS_OF_UR = "ur_robot_driver publishes the motors' currents [A] as efforts"
# Motors of a leg in unitree_legged_sdk and unitree_ros2: FR_0 = 0, FR_1 = 1, FR_2 = 2, FL_0 = 3, ...
_FIELDS_OF_UNITREE = frozenset("mode q dq ddq tau temperature".split())  # of MotorState
_OF_UNITREE = tuple(
    f"{leg}_{joint}_joint" for leg in ("FR", "FL", "RR", "RL") for joint in ("hip", "thigh", "calf")
)
_NUMBERED = re.compile(r"(.*?)(\d+)$")


@dataclass(frozen=True)
class ArmMessage:
    """Arrays go from the base to the flange, torques are of sensors behind the gears; SI but for angles."""

    about: str
    fields: dict[str, NameMeaning]  # by stem; of others nothing is used
    angle: str = "rad"
    reaction: bool = False  # torques are those on the sensor, against those on the link

    def meaning(self, stem: str) -> NameMeaning:
        """Of a field; of one that is neither measured joint states nor what they follow, `computed`."""
        return self.fields.get(stem, _ELSE)


ARM_MESSAGES = {
    "franka_msgs/msg/FrankaState": ArmMessage(
        "libfranka's state of the robot",
        # tau_J_d leaves gravity out, dtau_J is a rate, tau_ext_hat_filtered an estimate, theta the motors'.
        {"q": _POSITION, "dq": _VELOCITY, "tau_J": _EFFORT, "q_d": _ASKED, "dq_d": _ASKED_RATE},
    ),
    "franka_msgs/msg/FrankaRobotState": ArmMessage(
        "libfranka's state of the robot",
        {
            "measured_joint_state.position.{}": _POSITION,
            "measured_joint_state.velocity.{}": _VELOCITY,
            "measured_joint_state.effort.{}": _EFFORT,
            "desired_joint_state.position.{}": _ASKED,
            "desired_joint_state.velocity.{}": _ASKED_RATE,
        },
    ),
    "flexiv_msgs/msg/RobotStates": ArmMessage(
        "Flexiv's state of the robot", {"q": _POSITION, "dq": _VELOCITY, "tau": _EFFORT}
    ),
    "lbr_fri_idl/msg/LBRState": ArmMessage(
        "KUKA's state of the robot (FRI)",
        {
            "measured_joint_position": _POSITION,
            "measured_torque": _EFFORT,
            "commanded_joint_position": _ASKED,
        },
    ),
    "kortex_driver/msg/BaseCyclic_Feedback": ArmMessage(
        "Kinova's state of the robot, by actuator",
        {
            "actuators.{}.position": _POSITION,
            "actuators.{}.velocity": _VELOCITY,
            "actuators.{}.torque": _EFFORT,
        },
        angle="deg",
        reaction=True,
    ),
}


def labels_of_array(count: int, joints: Sequence[str]) -> tuple[str, ...]:
    """Joints of an array from the base to the flange; numbers from 1 where the description has no such."""
    named = numbered_joints(count, joints) or (tuple(joints) if len(joints) == count else ())
    return named or tuple(str(k) for k in range(1, count + 1))


def numbered_joints(count: int, joints: Sequence[str]) -> tuple[str, ...]:
    """Joints of a description whose names end with 1 to `count`, in this order, fingers beside them or not.

    Empty where there are none, or more than one such row.
    """
    rows: dict[str, dict[int, str]] = {}
    for joint in joints:
        if found := _NUMBERED.match(joint):
            rows.setdefault(found[1], {})[int(found[2])] = joint
    whole = [row for row in rows.values() if sorted(row) == list(range(1, count + 1))]
    return tuple(whole[0][k] for k in range(1, count + 1)) if len(whole) == 1 else ()


def universal_robots(joints: Sequence[str]) -> tuple[str, ...]:
    """Joints of a description that are called as Universal Robots' are, from the base on; else empty.

    RTDE counts them in this order: "0: Base, 1: Shoulder, 2: Elbow, 3: Wrist1, 4: Wrist2, 5: Wrist3".
    """
    named = [[joint for joint in joints if joint.endswith(name)] for name in _OF_UR]
    return tuple(one[0] for one in named) if all(len(one) == 1 for one in named) else ()


def is_unitree(stem: str) -> bool:
    """Whether a column is a field of a motor in Unitree's `LowState`: rad, rad/s and N m by its guide."""
    words = [word for word in words_in(stem) if word != SLOT and not word.isdecimal()]
    return words[:2] == ["motor", "state"] and not _FIELDS_OF_UNITREE.isdisjoint(words[2:3])


def unitree_motors(stem: str, labels: Sequence[str], joints: Sequence[str]) -> dict[str, str]:
    """Labels of Unitree's motors by joint of a quadruped's description, one leg of it or all; else empty."""
    numbers = {joint: str(number) for number, joint in enumerate(_OF_UNITREE)}
    if not is_unitree(stem) or not joints or not set(joints) <= set(numbers):
        return {}
    return {joint: numbers[joint] for joint in joints if numbers[joint] in labels}


def is_libfranka(stems: Sequence[str]) -> bool:
    """Whether a log's columns are called as libfranka's `RobotState` has them: rad, rad/s and N m."""
    first = {tuple(words_in(stem)[:2]) for stem in stems}
    return ("tau", "j") in first and any(words[:1] == ("q",) for words in first)
