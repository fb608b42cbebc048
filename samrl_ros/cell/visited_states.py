"""What Real2Sim found in a recorded run: the bag's model states, each with the tool's tip of its image."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.learning.states.visited import FITTED, VisitedStates
from samrl_ros.bags.reader import Bag, BagDecoder, RawMessage, open_bag
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import from_message

STATE, JOINTS = cell_topic("model_updater/state"), arm_topic("tool_arm", "joint_states")
_SLOP_NS = 20_000_000  # between an image and the joint state that goes with it


def visited_in_bag(bag: Path, task: Task, cell: CellSpec) -> VisitedStates:
    """The last state of each step that an image was fitted to.

    Args:
        bag: of a run of the cell.
        task: that it ran.
        cell: that it ran in.

    Raises:
        InputError: no bag, one of another task, or a state without joints of its time.
    """
    names = tuple(spec.name for spec in task.parameters())
    source = open_bag(bag)
    last: dict[tuple[int, int], Any] = {}
    for _, message in source.decoded((STATE,)):
        if message.why_stopped in FITTED:
            if message.task != task.name:
                raise InputError(f"bag {bag} holds states of {message.task}, not of {task.name}")
            last[int(message.episode), int(message.step)] = message
    joints = _joints_nearest(source, sorted({from_message.stamp_ns(m) for m in last.values()}))
    tips = _Tips(task, cell)
    rows = []
    for key, message in sorted(last.items()):
        values, covariance = from_message.model_values(message, names)
        at = from_message.stamp_ns(message)
        if at not in joints:
            raise InputError(
                f"bag {bag} has no joint state within {_SLOP_NS / 1e6:.0f} ms of {at / 1e9:.3f} s"
            )
        rows.append((values, covariance, tips.of(joints[at]), *key))
    size = len(names)
    return VisitedStates(
        task.name,
        np.array([row[0] for row in rows]).reshape(-1, size),
        np.array([row[1] for row in rows]).reshape(-1, size, size),
        np.array([row[2] for row in rows]).reshape(-1, 3),
        np.array([row[3] for row in rows], dtype=np.int64),
        np.array([row[4] for row in rows], dtype=np.int64),
    )


def _joints_nearest(bag: Bag, stamps: list[int]) -> dict[int, Any]:
    """Joint states by the stamp [ns] that each is nearest to; none where there is none within `_SLOP_NS`.

    Only these are kept and decoded: an hour of joint states would take a gigabyte.
    """
    nearest: dict[int, tuple[int, RawMessage]] = {}
    for raw in bag.messages((JOINTS,)):
        at = header_stamp_ns(raw.type, raw.data)
        if at is None:
            continue
        for stamp in stamps[bisect_left(stamps, at - _SLOP_NS) : bisect_right(stamps, at + _SLOP_NS)]:
            distance = abs(at - stamp)
            if stamp not in nearest or distance < nearest[stamp][0]:
                nearest[stamp] = (distance, raw)
    decode = BagDecoder(bag)
    return {stamp: decode(raw) for stamp, (_, raw) in nearest.items()}


class _Tips:
    """The tool's tip from joint states."""

    def __init__(self, task: Task, cell: CellSpec) -> None:
        self._names = cell.tool_arm.joint_names
        self._arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
        self._tip_in_flange = task.scene(cell).tool.tip_in_flange

    def of(self, message: Any) -> np.ndarray:
        """(3,) in the tool arm's base frame [m]."""
        reading = from_message.arm_reading(message, self._names)
        return (self._arm.flange_in_base(reading.position) @ self._tip_in_flange).position
