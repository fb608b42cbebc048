"""The cell's own nodes bring a blade down onto a plate of unknown height: the arm stops where it touches."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from samrl_core.cell.control.touch_stop import TOUCH_DOWN
from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_ros.cell.local_graph import LocalGraph
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import from_message

pytestmark = pytest.mark.ros

TASK, CARELESS = "spatula_flipping_hard", "careless:1"  # its plate lies 7.5 mm over the drawn one
EXECUTED, STATUS = cell_topic("manipulator/executed_action"), arm_topic("tool_arm", "motion_status")
ACTIONS = 12


def test_a_blade_stops_at_the_plate_and_every_node_knows_its_height(tmp_path: Path) -> None:
    heard: dict[str, list[Any]] = {EXECUTED: [], STATUS: []}
    loop = {"policy": {"policy": "optimised", "touch": True}, "view_planner": {"strategy": "fixed"}}
    settings: dict[str, Any] = {"supervisor": {"seed": 3, "episodes": 1, "max_actions": ACTIONS}, **loop}
    graph = LocalGraph(TASK, settings, tmp_path / "truth.jsonl", instance=CARELESS)
    graph.listener = lambda topic, message: heard[topic].append(message) if topic in heard else None
    try:
        graph.run()
        truth = graph.world.truth()
        heights = {
            name: node._agent._surface.height  # ty: ignore[missing-attribute]
            for name, node in graph.nodes.items()
            if name in ("policy", "model_updater")
        }
    finally:
        graph.close()
    downs = [m for m in heard[EXECUTED] if m.sub_goal == TOUCH_DOWN]
    ways = [(from_message.vector(m.nominal)[2], from_message.vector(m.executed)[2]) for m in downs]
    assert len(ways) >= 1 and all(asked == pytest.approx(-0.010) for asked, _ in ways)
    assert ways[-1][1] > -0.0095, "the last of them was stopped"
    assert {message.message for message in heard[STATUS]} == {"reached"}
    assert truth.peak_contact_force < 0.75 * task_named(TASK).force_limit  # ty: ignore[missing-attribute]
    surface = instance_named(CARELESS, cell_named()).parts.surface
    assert np.allclose(list(heights.values()), surface, atol=1.5e-3) and len(set(heights.values())) == 1
