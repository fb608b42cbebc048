"""The unit of measured positions, by message, name or numbers."""

from __future__ import annotations

import numpy as np

from samrl_ros.log_import.draft.column_names import words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.arm_messages import ARM_MESSAGES, is_libfranka, is_unitree
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock
from samrl_ros.log_import.draft.joints.whole_turns import unit_of_steps

RTDE = ("actual_q_{}", "target_q_{}")  # Universal Robots, Real-Time Data Exchange guide
_COUNTED = frozenset("counts count encoder enc tick ticks".split())
_FULL_TURNS = 4 * np.pi  # [rad] more than a joint of an arm turns: degrees


def position_unit(position: NamedBlock, draft: Draft) -> str:
    """The unit in which measured positions are drafted, with its reason or a question."""
    key, values = "channels.states.position", position.block.values
    if (message := ARM_MESSAGES.get(position.part.kind)) is not None:
        draft.note(key, f"{message.about}: in {message.angle}, as its makers say")
        return message.angle
    if position.part.ros:
        draft.note(key, "ROS messages are in rad and m (REP-103)")
        return "rad"
    if position.meaning.unit in ("rad", "deg", "mm"):
        draft.note(key, f"the name says {position.meaning.unit}")
        return position.meaning.unit
    if position.block.stem in RTDE:
        draft.note(key, "Universal Robots' RTDE gives joint positions in rad")
        return "rad"
    if is_unitree(position.block.stem):
        draft.note(key, "fields of Unitree's LowState: rad, rad/s, N m")
        return "rad"
    if is_libfranka([block.stem for block in position.part.blocks]):
        draft.note(key, "columns are called as libfranka's: rad, rad/s, N m")
        return "rad"
    largest = float(np.abs(values).max())
    if words_in(position.block.stem)[-2:] == ["pos", "estimate"]:
        question = "is the unit rev, as of ODrive's firmware from 0.5 on, and not counts, rad, deg, m or mm?"
        draft.note(key, "called as ODrive's estimate, in turns of the motor", question, "unit")
        return "rev"
    if (values == np.round(values)).all() and set(words_in(position.block.stem)) & _COUNTED:
        draft.note(
            key, f"counts up to {largest:g}", "how many counts make a turn, 4096? Which one is zero?",
            "counts",
        )  # fmt: skip
        return "counts/4096"
    if (values == np.round(values)).all() and largest > 100:
        unit = "counts/4096" if values.min() >= 0 and largest < 4096 else "deg"
        draft.note(
            key, f"whole numbers up to {largest:g}", f"is the unit {unit}? Or deg, mm? Is zero at 0?",
            "counts",
        )  # fmt: skip
        return unit
    stepped = unit_of_steps(values)
    unit = stepped or ("deg" if largest > _FULL_TURNS else "rad")
    others = "rad" if unit == "deg" else "deg"
    question = f"is the unit {unit}, and not {others}, rev, m or mm?"
    why = f", in steps that {unit} of an encoder have" if stepped else ""
    draft.note(key, f"numbers up to {largest:.3g}{why}", question, "unit")
    return unit
