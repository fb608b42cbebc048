"""Table I and Fig. 8d in the world: which episodes are run, and what is made of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, ReachError
from samrl_core.policy.networks.networks import ResidualActor
from samrl_core.policy.networks.weights import WeightsInfo, save_weights
from samrl_core.studies.episodes import world_episodes
from samrl_core.studies.episodes.stopwatch import GROUPS
from samrl_core.studies.episodes.world_episodes import HELD, Condition, EpisodeJob, episode_cases
from samrl_core.studies.experiment import Case, CaseLog, Options
from samrl_core.studies.paper import fig8d
from samrl_core.studies.paper.table1 import table1_world
from samrl_core.studies.paper.table1.held_views import HeldView

TASK = "peg_insertion"
VIEWS = tuple(
    HeldView(Pose(np.array([0.1 * k, 0.2 * k, 0.3]), np.array([0.0, 0.0, 0.0, 1.0])), (np.full(7, 0.1 * k),))
    for k in range(6)
)
SEARCH = table1_world.SearchSettings(views=4, seeds=2, finalists=2, final_seeds=3, first_seed=1000)
JOBS: list[EpisodeJob] = []


def made_up(job: EpisodeJob) -> list[Case]:
    """Views 0 and 4 succeed, 4 with fewer actions; active succeeds; nothing else does."""
    JOBS.append(job)
    success = job.name == "active" or job.view in (0, 4)
    case: Case = {"key": job.key, "task": job.task, "condition": job.name, "seed": job.seed}
    case |= {"view": job.view, "success": success, "believed": True, "ended": "done"}
    case |= {"why": "" if success else "done", "final_error": 0.0, "actions": 20 - job.view}
    case |= {"camera_moves": 0, "simulated_s": 1.0}
    return [case | {k: dict.fromkeys(GROUPS, 0.1) for k in ("cpu_s", "wall_s")}]


@pytest.fixture(autouse=True)
def no_episodes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases are made up, but for the slow test."""
    JOBS.clear()
    if not request.node.get_closest_marker("slow"):
        monkeypatch.setattr(world_episodes, "episode_cases", made_up)
        monkeypatch.setattr(table1_world, "held_views", lambda task, cell: VIEWS)


def table(folder: Path, **more: Any) -> dict[str, Any]:
    folder.mkdir(exist_ok=True)
    options = Options(folder, tasks=(TASK,), count=4, workers=1, **more)
    return table1_world.run(options, lambda line: None, SEARCH)


def test_table_1_runs_every_condition_on_the_same_seeds(tmp_path: Path) -> None:
    summary = table(tmp_path, seed=3)
    seeds = {n: [j.seed for j in JOBS if j.name == n] for n in (*table1_world.LOOKING, "search")}
    assert seeds["active"] == seeds["best_fixed"] == [3, 4, 5, 6]
    assert all(seeds[n] == [3, 4] for n in ("fixed", "held_random", "random", "optimised"))
    assert len({job.key for job in JOBS}) == len(JOBS)
    assert not set(seeds["search"]) & set(seeds["active"])
    assert {n: summary["tasks"][TASK][n]["trials"] for n in table1_world.LOOKING} == {
        n: len(seeds[n]) for n in table1_world.LOOKING
    }
    assert summary["against_best_fixed"][TASK]["active"]["pairs"] == 4
    assert (tmp_path / "table1_world.png").is_file()
    json.dumps(summary)
    JOBS.clear()
    assert table(tmp_path, seed=3) == summary and not JOBS  # all cases are known


def test_some_conditions_alone_and_then_the_others(tmp_path: Path) -> None:
    """Those that were not asked for are not run; asked for later, they do not run the first ones again."""
    without_search = table(tmp_path, conditions=("held_random", "active"))
    assert {job.name for job in JOBS} == {"active", "held_random"} == set(without_search["tasks"][TASK])
    assert without_search["against_best_fixed"] == without_search["best_fixed"] == {}
    two = table(tmp_path, conditions=("active", "best_fixed"))
    assert [job.name for job in JOBS].count("active") == 4 and list(two["tasks"][TASK]) == [
        "active",
        "best_fixed",
    ]
    assert list(two["against_best_fixed"][TASK]) == ["active"] and two["best_fixed"][TASK]["of"] == len(VIEWS)
    whole = table(tmp_path)
    assert whole["tasks"][TASK]["best_fixed"] == two["tasks"][TASK]["best_fixed"]
    assert len({job.key for job in JOBS}) == len(JOBS)
    assert whole == table(tmp_path / "at_once")


def test_the_fixed_view_is_chosen_on_other_seeds(tmp_path: Path) -> None:
    """First round: 4 views on 2 seeds; second: 2 of them on 3, of which 2 are known."""
    summary = table(tmp_path)
    searched = [job for job in JOBS if job.name == "search"]
    first, second = searched[:8], searched[8:]
    tried = {job.view for job in first}
    assert len(tried) == 4 and {0, 4} & tried
    assert len(second) == 2 and {job.seed for job in second} == {1002}
    best = 4 if 4 in tried else 0
    assert summary["best_fixed"][TASK]["view"] == best
    held = [job for job in JOBS if job.name == "best_fixed"]
    assert {job.view for job in held} == {best}
    assert all(job.way == (tuple(VIEWS[best].way[0].tolist()),) for job in held)
    assert {job.condition.strategy for job in held} == {HELD}


def test_drawn_views_are_those_of_the_seed(tmp_path: Path) -> None:
    table(tmp_path / "a")
    first = {j.seed: j.view for j in JOBS if j.name == "held_random"}
    JOBS.clear()
    table(tmp_path / "b", seed=1)
    again = {j.seed: j.view for j in JOBS if j.name == "held_random"}
    assert first[1] == again[1] and all(0 <= view < len(VIEWS) for view in first.values())


@pytest.mark.parametrize("with_residual", [False, True])
def test_ablations(tmp_path: Path, with_residual: bool) -> None:
    """In the world that differs, on equal seeds; without a residual's file only those that need none."""
    weights = tmp_path / "weights"
    weights.mkdir()
    file = weights / f"{TASK}_residual_actor.safetensors"
    if with_residual:
        figures = {"offset_x": 0.001, "offset_y": 0.0, "offset_z": -0.002}
        lens = cell_named().intrinsics
        info = WeightsInfo("residual_actor", TASK, lens, 0.003, 0, figures)
        save_weights(file, ResidualActor(0.003), info)
    options = Options(tmp_path, tasks=(TASK,), count=2, workers=1, weights=weights)
    summary = fig8d.run(options, lambda line: None)
    names = list(fig8d.ABLATIONS) if with_residual else ["without_residual", "without_both"]
    assert list(summary["tasks"][TASK]) == names
    assert list(summary["first_against"][TASK]) == names[1:]
    assert all(job.differs and job.seed in (0, 1) for job in JOBS) and len(JOBS) == 2 * len(names)
    # The world is the one that the residual was trained in, for all conditions alike.
    assert {j.offset for j in JOBS} == {(0.001, 0.0, -0.002) if with_residual else (0.0, 0.0, 0.0)}
    assert {j.residual for j in JOBS} == {file if with_residual else None}
    assert bool(summary["residual_sha256"][TASK]) == with_residual
    assert (tmp_path / "fig8d.png").is_file()


def test_ablations_that_are_asked_for(tmp_path: Path) -> None:
    options = Options(tmp_path, tasks=(TASK,), count=2, workers=1, conditions=("without_both",))
    assert list(fig8d.run(options, lambda line: None)["tasks"][TASK]) == ["without_both"]
    assert {job.name for job in JOBS} == {"without_both"}
    options = replace(options, conditions=("without_both", "full"))
    with pytest.raises(InputError, match="full of peg_insertion needs .*residual_actor.*not there"):
        fig8d.run(options, lambda line: None)
    assert len(JOBS) == 2


JOB = EpisodeJob("k", TASK, "held", Condition("optimised", HELD), 2)


def test_truth_is_asked_once_when_the_episode_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """The world's truth raises while the agent runs."""
    order: list[str] = []

    def episode(agent: Any, plant: Any, loop: Any, watch: Any) -> Any:
        assert loop.views_per_search == 0
        observation = plant.observe()
        order.append("episode")
        assert not hasattr(plant, "truth") and not hasattr(observation, "truth")
        raise ReachError("out of reach")

    class Watched(world_episodes.PyBulletWorld):
        def truth(self) -> Any:
            order.append("truth")
            return super().truth()

    monkeypatch.setattr(world_episodes, "run_episode", episode)
    monkeypatch.setattr(world_episodes, "PyBulletWorld", Watched)
    case = episode_cases(JOB)[0]
    assert order == ["episode", "truth"]
    assert (case["success"], case["believed"], case["why"]) == (False, False, "out of reach")
    assert case["final_error"] > 0.05


@pytest.mark.parametrize("update", [True, False])
def test_a_model_that_is_not_updated_does_not_end_an_episode(
    update: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def episode(agent: Any, plant: Any, loop: Any, watch: Any) -> Any:
        assert loop.stop_on_model_success is update
        return SimpleNamespace(ended="action_limit")

    monkeypatch.setattr(world_episodes, "run_episode", episode)
    condition = Condition("optimised", HELD, update=update)
    assert not episode_cases(EpisodeJob("k", TASK, "held", condition, 2))[0]["believed"]


def test_episodes_of_a_cell_whose_agent_remembers_are_one_piece_of_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In their order, the first one anew. Cases come as the jobs were given."""
    begun: list[tuple[str, bool]] = []

    def episode(job: EpisodeJob, anew: bool = True) -> list[Case]:
        begun.append((job.key, anew))
        return [{"key": job.key}]

    monkeypatch.setattr(world_episodes, "episode_cases", episode)
    alone, shared = Condition("optimised"), Condition("optimised", remembers=True)
    jobs = [
        EpisodeJob(f"{name}{k}", TASK, name, how, k, instance=f"typical:{k // 2}")
        for k in range(4)
        for name, how in (("alone", alone), ("shared", shared))
    ]
    found = world_episodes.run_episodes(CaseLog(tmp_path), jobs, 1, lambda line: None)
    assert [case["key"] for case in found] == [job.key for job in jobs]
    assert [one for one in begun if one[0].startswith("shared")] == [
        ("shared0", True),
        ("shared1", False),
        ("shared2", True),
        ("shared3", False),
    ]
    assert begun.index(("shared1", False)) == begun.index(("shared0", True)) + 1
    assert all(anew for key, anew in begun if key.startswith("alone"))


def test_weights_that_are_missing_are_named(tmp_path: Path) -> None:
    job = EpisodeJob("k", TASK, "active", Condition(), 0, weights=tmp_path)
    with pytest.raises(InputError, match="sim_actor"):
        episode_cases(job)


def test_the_camera_is_where_it_is_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """The way is driven before the episode starts, and is no part of its time."""
    seen: list[np.ndarray] = []

    def episode(agent: Any, plant: Any, loop: Any, watch: Any) -> Any:
        assert (loop.view_period, loop.views_per_search, loop.max_actions) == (2, 0, 100)
        seen.append(plant.observe().camera_arm.position)
        return SimpleNamespace(ended="done")

    monkeypatch.setattr(world_episodes, "run_episode", episode)
    start = world_episodes.task_named(TASK).start_joints(world_episodes.cell_named())["camera_arm"]
    stops = (start + 0.03, start + 0.05)
    condition = Condition("optimised", HELD, view_period=2)
    job = EpisodeJob("k", TASK, "held", condition, 2, 0, tuple(tuple(s.tolist()) for s in stops))
    case = episode_cases(job)[0]
    np.testing.assert_allclose(seen[0], stops[-1], atol=3e-3)
    assert case["simulated_s"] == pytest.approx(0.3, abs=1e-3)


@pytest.mark.slow
def test_an_episode_is_the_same_each_time() -> None:
    """Peg insertion with a held view, judged by truth; time is all that differs."""
    first, second = episode_cases(JOB)[0], episode_cases(JOB)[0]
    assert first["success"] and first["believed"] and first["camera_moves"] == 0
    assert 5 < first["actions"] <= 100 and first["final_error"] < 0.003
    times = ("cpu_s", "wall_s")
    assert all(first[k] == second[k] for k in first if k not in times)
    assert all(first[t][g] > 0.0 for t in times for g in ("update", "act", "move"))
    assert first["cpu_s"]["view"] == 0.0
