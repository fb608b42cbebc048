"""The page `add_a_robot.md`: its UR5, from a URDF that others wrote, in a cell that is built and run."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell.robots import cells
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named, robot_with_joints
from samrl_core.cell.robots.geometry import Capsules, clearance, link_shapes
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.robots.urdf import description_of, links_to_flange
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import look_at
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.tool_motion import ToolMotion
from samrl_core.common.errors import InputError
from samrl_core.learning.sim.prepare import prepare_states
from samrl_core.learning.sim.sample_states import StateSource
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.learning.states.explore import ExploreSettings
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.states import StateSamples
from samrl_core.model.model import Model
from samrl_core.studies.experiment import Options
from tests.guide.pages import register

NAME = "ur5_rizon"
TASK = task_named("peg_insertion")


@pytest.fixture(scope="module")
def cell() -> Iterator[CellSpec]:
    with pytest.MonkeyPatch.context() as patch:
        register("add_a_robot.md", patch, cells, "CELLS")
        yield cell_named(NAME)


def test_the_arm_has_six_joints_and_shapes_in_place_of_meshes(cell: CellSpec) -> None:
    spec = cell.tool_arm
    assert robot_with_joints(spec.joint_names) is spec and len(spec.joint_names) == 6
    shapes = link_shapes(spec)
    assert set(shapes) >= set(links_to_flange(spec)) - {"world", "base_link", "tool0"}
    forearm = shapes["forearm_link"][0]
    assert max(forearm.half_extents) == pytest.approx(0.245, abs=0.005)


def test_the_description_ends_at_the_flange(cell: CellSpec) -> None:
    """Whoever reads a bag takes the last link for the flange; the file has three frames behind the wrist."""
    links = [e.get("name") for e in ElementTree.fromstring(description_of(cell.tool_arm)).findall("link")]
    assert links and set(links) == set(links_to_flange(cell.tool_arm))
    assert description_of(cell.camera_arm) == cell.camera_arm.urdf.read_text()


def test_home_and_start(cell: CellSpec) -> None:
    arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
    at_home = arm.flange_in_world(cell.tool_arm.home)
    np.testing.assert_allclose(at_home.position, [0.5, 0.0, 0.3034], atol=1e-3)
    np.testing.assert_allclose(at_home.rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-3)
    start = TASK.start_joints(cell)
    tip = arm.flange_in_base(start["tool_arm"]) @ TASK.scene(cell).tool.tip_in_flange
    np.testing.assert_allclose(tip.position, [0.5, 0.0, 0.14], atol=1e-4)
    sets = [
        Capsules.of_arm(
            link_shapes(cell.arm(role)),
            ArmModel(cell.arm(role), cell.base_in_world(role), None).link_poses_in_world(start[role]),
        )
        for role in ROLES
    ]
    assert clearance(*sets) > 0.05


def test_the_controller_is_stable_when_sampled(cell: CellSpec) -> None:
    spec, tool = cell.tool_arm, TASK.scene(cell).tool
    arm = ArmModel(spec, cell.tool_base_in_world, Payload(tool.mass, tool.center_of_mass, tool.inertia))
    h, k, d = spec.controller.period_s, np.diag(spec.controller.stiffness), np.diag(spec.controller.damping)
    one, rng = np.eye(len(spec.home)), np.random.default_rng(0)
    for q in [spec.home, *rng.uniform(spec.limits.lower, spec.limits.upper, (100, len(spec.home)))]:
        m = np.linalg.inv(arm.mass_matrix(q))
        step = np.block([[one - h * h * m @ k, h * (one - h * m @ d)], [-h * m @ k, one - h * m @ d]])
        assert np.abs(np.linalg.eigvals(step)).max() < 1.0


def test_the_model_renders_the_arm(cell: CellSpec) -> None:
    model = Model(TASK, cell)
    nominal = torch.tensor([p.nominal for p in TASK.parameters()])
    joints = TASK.start_joints(cell)["tool_arm"]
    camera = Camera(cell.intrinsics, look_at(np.array([1.4, 0.9, 0.9]), np.array([0.4, 0.0, 0.2])))
    seen = model.render(nominal, torch.as_tensor(model.initial_colors()), camera, joints)
    assert torch.isfinite(seen.color).all()
    assert {1, 2, 3} <= set(seen.label.unique().tolist())  # block, tool and tool arm


def test_an_action_moves_the_tool_by_what_is_asked(cell: CellSpec) -> None:
    world = PyBulletWorld(TASK, cell)
    try:
        world.reset(0)
        motion = ToolMotion(world, TASK, cell, period_s=0.1)
        for displacement in ([0.01, 0.0, 0.0], [0.0, -0.01, 0.0], [0.0, 0.0, 0.008]):
            before = motion.tip()
            motion.displace(np.array(displacement))
            motion.rest()
            motion.rest()
            np.testing.assert_allclose(motion.tip() - before, displacement, atol=1e-3)
        assert np.unique(world.read_camera().mask).size > 2
    finally:
        world.close()


def test_a_training_is_of_the_cell_that_is_asked_for(cell: CellSpec, tmp_path: Path) -> None:
    def states(name: str) -> StateSamples:
        return prepare_states(
            TASK.name, 4, tmp_path, 7, 1, StateSource(ExploreSettings(slots=2, longest=6)), cell=name
        )

    names = SceneFrames(Model(TASK, cell)).names
    assert any("forearm_link" in name for name in names) and states(NAME).frames.shape[1] == len(names)
    with pytest.raises(InputError, match="its settings"):
        states(DEFAULT_CELL)
    assert TrainSettings(cell=NAME).cell == Options(tmp_path, cell=NAME).cell == NAME


@pytest.mark.thorough
@pytest.mark.ros
def test_an_episode_of_the_whole_agent(cell: CellSpec, tmp_path: Path) -> None:
    from samrl_ros.cell.local_graph import LocalGraph
    from samrl_ros.contract.topics import cell_topic

    executed = []

    def listen(topic: str, message: object) -> None:
        if topic == cell_topic("manipulator/executed_action"):
            executed.append(message)

    settings = {
        "supervisor": {"seed": 1, "max_actions": 2, "view_period": 100},
        "policy": {"policy": "optimised"},
        "view_planner": {"strategy": "best"},
    }
    truth = tmp_path / "truth.jsonl"
    graph = LocalGraph("peg_insertion", settings, truth, cell=NAME, listener=listen)
    try:
        graph.run()
    finally:
        graph.close()
    assert not [entry for entry in graph.logs if entry[1] == "error"]
    assert len(executed) == 2
    start, end = (json.loads(line)["tip_position"] for line in truth.read_text().splitlines())
    assert np.linalg.norm(np.subtract(end, start)) > 0.005


@pytest.mark.slow
@pytest.mark.ros
def test_recordings_of_the_arm_are_diagnosed(cell: CellSpec, tmp_path: Path) -> None:
    from samrl_ros.cli.main import run

    bags, out = tmp_path / "bags", tmp_path / "diagnosis"
    assert run(["excite", "--cell", NAME, "--set", "A", "--duration", "6", "--out", str(bags)]) == 0
    assert run(["diagnose", str(bags), "--out", str(out)]) == 0
    report = json.loads((out / "report.json").read_text())
    assert report["verdict"] == "no_gap"  # the world is built to the nominal cell
