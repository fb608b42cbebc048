"""The page `add_a_task.md`: its task is registered, drawn, and run by the whole agent."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell import tasks
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.world import make_world
from samrl_core.cell.world.evaluation import evaluate_now, true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.tool_motion import ToolMotion
from samrl_core.model.model import Model
from tests.guide.pages import register

NAME = "puck_pushing"
CELL = cell_named()


@pytest.fixture(scope="module")
def task() -> Iterator[Task]:
    with pytest.MonkeyPatch.context() as patch:
        register("add_a_task.md", patch, tasks, "TASKS")
        yield task_named(NAME)


def test_the_model_renders_the_scene(task: Task) -> None:
    model = Model(task, CELL)
    nominal = torch.tensor([p.nominal for p in task.parameters()])
    camera = Camera(CELL.intrinsics, task.start_camera())
    joints = task.start_joints(CELL)["tool_arm"]
    seen = model.render(nominal, torch.as_tensor(model.initial_colors()), camera, joints)
    assert {1, 2} <= set(seen.label.unique().tolist())  # puck and tool


def test_an_expert_who_knows_the_truth_succeeds_in_the_world(task: Task) -> None:
    world = PyBulletWorld(task, CELL)
    try:
        world.reset(3)
        assert not evaluate_now(world, task).success
        motion = ToolMotion(world, task, CELL, period_s=0.1)
        for _ in range(task.max_actions):
            goals = task.sub_goals(true_values(task, world.truth()), motion.tip())
            if not goals:
                break
            way = goals[0].tip_position - motion.tip()
            motion.displace(way * min(1.0, goals[0].max_step / max(float(np.linalg.norm(way)), 1e-9)))
        assert evaluate_now(world, task).success
    finally:
        world.close()


def test_the_gripper_of_the_page_is_a_tool_that_worlds_hold(task: Task) -> None:
    page = import_module("samrl_core.cell.tasks.puck_pushing.gripper")
    tool = page.gripper_with_peg(0.01, 0.06, friction=0.3, label=2)
    scene = replace(task.scene(CELL), tool=tool)
    assert 0.05 < tool.center_of_mass[2] < 0.07 and np.linalg.eigvalsh(tool.inertia).min() > 0
    world = make_world("pybullet", task, CELL, scene=scene)
    try:
        world.reset(3)
        world.advance()
        seen = world.read_camera().mask
        assert {1, 2} <= set(np.unique(seen).tolist())  # puck and tool
    finally:
        world.close()


@pytest.mark.slow
@pytest.mark.ros
def test_an_episode_of_the_whole_agent(task: Task, tmp_path: Path) -> None:
    from samrl_ros.cell.local_graph import LocalGraph
    from samrl_ros.contract.topics import cell_topic

    said: dict[str, list[object]] = {"manipulator/executed_action": [], "model_updater/state": []}

    def listen(topic: str, message: object) -> None:
        for name, messages in said.items():
            if topic == cell_topic(name):
                messages.append(message)

    settings = {
        "supervisor": {"seed": 1, "max_actions": 3, "view_period": 100},
        "policy": {"policy": "optimised"},
        "view_planner": {"strategy": "fixed"},
    }
    truth = tmp_path / "truth.jsonl"
    graph = LocalGraph(NAME, settings, truth, listener=listen)
    try:
        graph.run()
    finally:
        graph.close()
    assert not [entry for entry in graph.logs if entry[1] == "error"]
    assert len(said["manipulator/executed_action"]) == 3
    start = json.loads(truth.read_text().splitlines()[0])["body_position"]["puck"]
    estimate = said["model_updater/state"][0].values  # ty: ignore[missing-attribute]
    np.testing.assert_allclose(estimate, start[:2], atol=0.003)  # 3 mm off at most, as seen from one side
