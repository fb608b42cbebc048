"""Two arms in one model: a log of one of them asks nothing about the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.recordings.read import chained_joints

_LINK = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'  # noqa: E501
_JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="5" velocity="1"/></joint>'
)
PARTS = (
    ("waist", "base", "torso"), ("l1", "torso", "left1"), ("l2", "left1", "left2"),
    ("r1", "torso", "right1"), ("r2", "right1", "right2"),
)  # fmt: skip
URDF = (
    '<robot name="two"><link name="base"/>'
    + "".join(_LINK.format(child) + _JOINT.format(name, parent, child) for name, parent, child in PARTS)
    + "</robot>"
)


def test_a_chain_is_what_carries_and_what_is_carried() -> None:
    assert chained_joints(URDF, ["l1"]) == {"waist", "l1", "l2"}
    assert chained_joints(URDF, ["waist"]) == {"waist", "l1", "l2", "r1", "r2"}


def test_a_log_of_one_arm_asks_about_what_carries_it_alone(tmp_path: Path) -> None:
    time = np.arange(0, 4, 0.01)
    rows = np.stack([time, 0.4 * np.sin(time), 0.3 * np.sin(2 * time)], axis=1)
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", comments="", header="time,position_r1,position_r2")
    draft = draft_mapping([path], URDF, URDF)
    assert draft.joints == ["r1", "r2"]
    (asked,) = [q for q in draft.questions if q.startswith("joints")]
    assert "waist of the URDF" in asked and "l1" not in asked
