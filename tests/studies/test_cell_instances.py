"""The experiment over cell instances: which cells and which episodes it runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.cell.tasks import TASKS
from samrl_core.studies import cell_instances
from samrl_core.studies.cell_instances import CONDITIONS, EXPERIMENT, PER_INSTANCE, job_of
from samrl_core.studies.episodes.stopwatch import GROUPS
from samrl_core.studies.episodes.world_episodes import EpisodeJob
from samrl_core.studies.experiment import Options
from samrl_core.studies.registry import experiment_named

OPTIONS = Options(Path("out"))


def test_it_is_registered() -> None:
    assert experiment_named("cell_instances") is EXPERIMENT


def test_a_cell_serves_several_episodes_and_then_comes_another() -> None:
    jobs = [job_of(OPTIONS, "peg_insertion", "typical", k) for k in range(2 * PER_INSTANCE)]
    assert [job.instance for job in jobs] == ["typical:0"] * PER_INSTANCE + ["typical:1"] * PER_INSTANCE
    assert len({job.seed for job in jobs}) == len(jobs)


def test_conditions_of_a_purpose_share_their_episodes_and_purposes_none() -> None:
    def seeds(condition: str) -> set[int]:
        return {job_of(OPTIONS, task, condition, k).seed for task in TASKS for k in range(200)}

    assert seeds("typical") == seeds("careless") == seeds("typical_depth_x4") == seeds("nominal")
    assert seeds("typical_test") == seeds("careless_test")
    assert not seeds("typical") & seeds("typical_test")
    assert len(seeds("typical")) == 200 * len(TASKS)


@pytest.mark.parametrize("condition", sorted(CONDITIONS))
def test_every_condition_names_an_instance(condition: str) -> None:
    name = job_of(OPTIONS, "peg_insertion", condition, 7).instance
    expected = {
        "typical_depth_x4": "typical:1 depth=4",
        "typical_test": "typical:test:1",
        "nominal": "nominal",
    }
    assert name == expected.get(condition, name)
    assert ("test" in name) == condition.endswith("_test") and ("=" in name) == ("_x" in condition)


def test_an_interrupted_run_has_something_of_each_task(tmp_path: Path, monkeypatch) -> None:
    """All tasks once, then again; the summary counts by task and condition."""
    order = []

    def episode(job: EpisodeJob) -> dict:
        order.append(job.task)
        times = dict.fromkeys(GROUPS, 1.0)
        return {
            "key": job.key, "task": job.task, "condition": job.name, "seed": job.seed, "success": True,
            "believed": True, "why": "", "final_error": 0.0, "actions": 3, "camera_moves": 1,
            "simulated_s": 1.0, "cpu_s": times, "wall_s": times,
        }  # fmt: skip

    monkeypatch.setattr(
        cell_instances, "run_episodes", lambda log, jobs, workers, tell: [*map(episode, jobs)]
    )
    options = Options(tmp_path, tuple(TASKS), count=2, conditions=("typical",))
    found = EXPERIMENT.result(options, lambda line: None)
    assert order == [*TASKS, *TASKS]
    assert found["tasks"]["peg_insertion"]["typical"]["trials"] == 2
    assert (tmp_path / "cell_instances.png").stat().st_size > 5000
