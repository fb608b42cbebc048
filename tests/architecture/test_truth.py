"""Ground truth has one door, and a list of who goes through it."""

from __future__ import annotations

import ast
from functools import cache

import pytest

from tests.architecture.import_rules import ROOT, imports_of_project

# Who may call SimulatedWorld.truth(): the log that evaluation reads, and evaluations themselves.
MAY_CALL_TRUTH = {
    "samrl_core/cell/world/evaluation.py",
    "samrl_core/studies/model/model_updating.py",
    "samrl_core/studies/model/view_score.py",
    "samrl_core/cell/world/pose_sensor.py",
}
# Who may read what the log wrote.
MAY_READ_TRUTH = {
    "samrl_core/cell/world/evaluation.py",
    "samrl_ros/cell/summary.py",
    "samrl_ros/cell/bench_photograph.py",  # for people, when the run has ended
}
# Who may turn truth into what a task judges or estimates; the second is for tests too, which stand beside
# the world.
MAY_END = {
    "ending_of": {"samrl_ros/cell/summary.py", "samrl_ros/cell/bench_photograph.py"},
    "ending_now": {"samrl_core/cell/world/evaluation.py"},
    "true_values": {"samrl_core/studies/model/model_updating.py"},
}
# Who may ask for success and reward: the environment of the compared learners while an episode runs, whose
# observations have no part in it, and an experiment when an episode has ended.
MAY_BE_REWARDED = {
    "samrl_core/studies/baselines/gym_env.py",
    "samrl_core/studies/episodes/residual_episodes.py",
    "samrl_core/studies/episodes/world_episodes.py",
}
# Who may sample a start or evaluate with truth through the task border.
MAY_JUDGE = {
    "values_from_truth": {"samrl_core/cell/world/evaluation.py"},
    "sample_start": {"samrl_core/cell/world/pybullet/world.py", "samrl_core/cell/world/mock_world.py"},
    "succeeded": {"samrl_ros/cell/summary.py", "samrl_core/cell/world/evaluation.py"},
    # The second and third of these make a reward of it, which the fourth hands on.
    "final_error": {
        "samrl_ros/cell/summary.py",
        "samrl_core/cell/tasks/peg_insertion/task.py",
        "samrl_core/cell/tasks/needle_threading/task.py",
        "samrl_core/cell/world/evaluation.py",
    },
    "shaped_reward": {"samrl_core/cell/world/evaluation.py"},
}
# Who may import cell instances: worlds, whoever builds one or says which, and the tasks' border for parts.
MAY_KNOW_INSTANCES = {
    "samrl_core/cell/instance/": "",
    "samrl_core/cell/world/": "",
    "samrl_core/cell/tasks/": "parts.Parts",  # the type alone
    "samrl_core/blind_test/camera_worlds/": "",  # sealed worlds: what they hold is no input of a diagnosis
    "samrl_core/studies/cell_instances.py": "",
    "samrl_core/studies/cell_residual.py": "cell_instance.InstanceName",  # says which
    "samrl_core/studies/cell_sensitivity.py": "",
    "samrl_core/studies/episodes/residual_episodes.py": "cell_instance.instance_named",  # builds the world
    "samrl_core/studies/episodes/world_episodes.py": "",
    "samrl_core/studies/restored_success.py": "",  # its answers are held against truth
    "samrl_core/studies/speed/camera_pictures.py": "",
    "samrl_ros/nodes/bridge/sim_bridge.py": "",
    "samrl_ros/cell/options.py": "",
    "samrl_ros/cell/local_graph.py": "",
    "samrl_ros/cell/summary.py": "",
    "samrl_ros/cell/bench_photograph.py": "",
    "samrl_ros/cell/run.py": "",
    "samrl_ros/docs.py": "",
}
# Who may draw one, build from one, or open what was sealed.
MAY_DRAW = {
    "draw_instance": {
        "samrl_core/cell/instance/cell_instance.py",
        "samrl_core/cell/world/pybullet/world.py",
    },
    "instance_named": {
        "samrl_core/blind_test/camera_worlds/plan.py",
        "samrl_ros/nodes/bridge/sim_bridge.py",
        "samrl_ros/cell/local_graph.py",
        "samrl_core/studies/episodes/residual_episodes.py",
        "samrl_core/studies/episodes/world_episodes.py",
        "samrl_core/studies/restored_success.py",
        "samrl_core/studies/speed/camera_pictures.py",
        "samrl_ros/cell/bench_photograph.py",
    },
    "as_made": {"samrl_core/cell/world/true_cell.py"},
    "seal_instance": {"samrl_ros/nodes/bridge/sim_bridge.py"},
    "read_instance_file": {"samrl_ros/cell/summary.py", "samrl_ros/cell/bench_photograph.py"},
}


def called_attributes(source: str) -> set[str]:
    """Names of all methods and functions that a source calls."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Attribute):
                names.add(node.func.attr)
            elif isinstance(node.func, ast.Name):
                names.add(node.func.id)
    return names


@cache
def sources() -> dict[str, str]:
    """Every file of the package."""
    return {
        path.relative_to(ROOT).as_posix(): path.read_text()
        for package in ("samrl_core", "samrl_ros")
        for path in (ROOT / package).rglob("*.py")
    }


@cache
def calls(file: str) -> set[str]:
    """What a file of the package calls."""
    return called_attributes(sources()[file])


def callers(name: str) -> set[str]:
    """Files of the package that call something of that name."""
    return {file for file, source in sources().items() if name in source and name in calls(file)}


def test_only_evaluation_asks_for_truth() -> None:
    assert callers("truth") <= MAY_CALL_TRUTH
    assert "samrl_core/cell/world/evaluation.py" in callers("truth"), "the search must find the door itself"


def test_only_evaluation_reads_truth() -> None:
    assert callers("read_truth") <= MAY_READ_TRUTH
    assert "samrl_ros/cell/summary.py" in callers("read_truth")


@pytest.mark.parametrize("name", sorted(MAY_END))
def test_only_evaluation_makes_endings(name: str) -> None:
    assert callers(name) == MAY_END[name]


@pytest.mark.parametrize("name", sorted(MAY_JUDGE))
def test_the_task_border_keeps_truth_with_world_and_evaluation(name: str) -> None:
    assert callers(name) <= MAY_JUDGE[name], f"{name} is called by {callers(name) - MAY_JUDGE[name]}"


def test_only_the_compared_learners_are_rewarded_by_truth() -> None:
    assert callers("evaluate_now") == MAY_BE_REWARDED


def test_the_search_catches_a_breach() -> None:
    assert "truth" in called_attributes("def peek(world):\n    return world.truth().body_position")


def knows_instances(file: str, module: str) -> bool:
    """Whether a file may import a module of the cell instances."""
    place = "samrl_core.cell.instance"
    return any(
        file.startswith(start) and (not alone or module == f"{place}.{alone}")
        for start, alone in MAY_KNOW_INSTANCES.items()
    )


def imports_of_instances() -> set[tuple[str, str]]:
    """Files of the package and what they import of the cell instances, lazily or not."""
    found = imports_of_project()
    return {(one.file, one.module) for one in found if one.module.startswith("samrl_core.cell.instance")}


def test_model_learner_and_diagnosis_know_no_instance() -> None:
    found = imports_of_instances()
    assert "samrl_ros/nodes/bridge/sim_bridge.py" in {file for file, _ in found}, (
        "the search must find the worlds"
    )
    assert not sorted(one for one in found if not knows_instances(*one))


def test_the_search_for_instances_catches_a_breach() -> None:
    assert not knows_instances("samrl_core/model/model.py", "samrl_core.cell.instance.parts.Parts")
    assert not knows_instances("samrl_core/cell/tasks/task.py", "samrl_core.cell.instance.grip.Grip")
    assert knows_instances("samrl_core/cell/tasks/task.py", "samrl_core.cell.instance.parts.Parts")


@pytest.mark.parametrize("name", sorted(MAY_DRAW))
def test_only_worlds_draw_instances_and_evaluation_opens_them(name: str) -> None:
    assert callers(name) == MAY_DRAW[name]


def test_no_topic_carries_truth() -> None:
    from samrl_ros.contract.topics import TOPICS

    assert not [name for name in TOPICS if "truth" in name or "seed" in name or "instance" in name]
