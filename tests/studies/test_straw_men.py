"""Episodes without a loop: what they look at, how they step, and what the script makes of one image."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.needle_threading.task import NEEDLE, NeedleThreading
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.world.evaluation import ending_now, true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import unwatched
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.studies.episodes import straw_men
from samrl_core.studies.episodes.locate import locate_parts
from samrl_core.studies.episodes.straw_men import REST, STRAW_MEN, run_straw_man
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL = cell_named()


class Rail:
    """A plant that moves by a share of what it is told, and counts images."""

    def __init__(self, task: Task, share: float = 1.0) -> None:
        self.place, self.share = np.array([0.5, 0.0, 0.14]), share
        self.images: list[int] = []  # steps made before each
        self.steps: list[np.ndarray] = []

    def observe(self) -> Any:
        self.images.append(len(self.steps))
        return SimpleNamespace()

    def tip(self) -> np.ndarray:
        return self.place.copy()

    def displace_tool(self, displacement: np.ndarray, /) -> None:
        self.steps.append(displacement)
        self.place = self.place + self.share * displacement


def agent_of(task: Task, values: np.ndarray | None = None) -> Any:
    return SimpleNamespace(
        model=SimpleNamespace(task=task),
        settings=AgentSettings(policy="optimised"),
        begin_episode=lambda: None,
        update_model=lambda observation: SimpleNamespace(values=values),
    )


def play(kind: str, plant: Rail, task: Task, most: int = 60, values: np.ndarray | None = None) -> bool:
    return run_straw_man(kind, agent_of(task, values), plant, most, unwatched)


def test_one_update_is_one_image_and_then_straight_steps() -> None:
    task, hole = task_named("peg_insertion"), np.array([0.53, -0.02])
    plant = Rail(task)
    assert play("one_update", plant, task, values=hole)
    assert plant.images == [0] + [len(plant.steps)] * REST
    assert task.is_done(hole, plant.tip())
    assert max(np.linalg.norm(step) for step in plant.steps) <= task.action_limit + 1e-12


def test_who_takes_no_image_goes_by_the_drawing() -> None:
    task = task_named("peg_insertion")
    plant = Rail(task)
    assert play("no_image", plant, task)
    assert plant.images == [len(plant.steps)] * REST
    np.testing.assert_allclose(plant.tip()[:2], [0.5, 0.0], atol=1e-9)


def test_a_tool_that_is_held_up_ends_the_episode_within_its_actions() -> None:
    """Half of each step gets through: it goes on. None does: it gives goals up, and stops at the limit."""
    task = task_named("peg_insertion")
    assert play("no_image", Rail(task, 0.5), task)
    stuck = Rail(task, 0.0)
    assert play("no_image", stuck, task, most=100)
    assert 10 < len(stuck.steps) < 60
    assert not play("no_image", Rail(task, 0.0), task, most=12)


def test_unknown_kinds_and_tasks_are_refused() -> None:
    with pytest.raises(InputError, match="no straw man is called 'scarecrow'"):
        play("scarecrow", Rail(task_named("peg_insertion")), task_named("peg_insertion"))
    other: Any = SimpleNamespace(name="juggling", parameters=lambda: ())
    frame = SimpleNamespace(depth=np.ones((2, 2)), mask=np.zeros((2, 2)))
    camera = SimpleNamespace(unproject=lambda depth: np.zeros((2, 2, 3)))
    with pytest.raises(InputError, match="no script knows task juggling"):
        locate_parts(other, SimpleNamespace(frame=frame, camera=camera), np.zeros(3))


@pytest.mark.parametrize(("name", "most"), [("peg_insertion", 0.003), ("spatula_flipping_hard", 0.003)])
def test_the_script_finds_round_bodies_in_a_nominal_cell(name: str, most: float) -> None:
    """By truth; a pixel is 2.2 mm wide."""
    task = task_named(name)
    world = PyBulletWorld(task, CELL)
    plant = WorldPlant(world, task, CELL)
    plant.begin(4)
    _, values = locate_parts(task, plant.observe(), plant.tip())
    error = values[:2] - true_values(task, world.truth())[:2]
    world.close()
    assert np.linalg.norm(error) < most
    assert np.linalg.norm(values[:2] - [p.nominal for p in task.parameters()[:2]]) > 2 * most


def test_the_script_finds_needle_and_loose_end() -> None:
    task = task_named("needle_threading_hard")
    world = PyBulletWorld(task, CELL)
    plant = WorldPlant(world, task, CELL)
    plant.begin(1)
    found, values = locate_parts(task, plant.observe(), plant.tip())
    truth = world.truth()
    world.close()
    assert isinstance(found, NeedleThreading)
    assert np.linalg.norm(found.eye_at(values)[:2] - truth.body_position[NEEDLE][:2]) < 0.004
    end = found.thread_points(values, truth.tip_position)[-1]
    assert np.linalg.norm((end - truth.chain_points[-1])[:2]) < 0.008


def test_every_kind_has_a_line_in_the_text() -> None:
    assert all(f"- {kind}:" in (straw_men.__doc__ or "") for kind in STRAW_MEN)


@pytest.mark.slow
def test_a_script_with_touch_inserts_from_one_image() -> None:
    """In a nominal cell: the search knows when it has ended, and presses gently."""
    task = task_named("peg_insertion_hard")
    settings = AgentSettings(policy="optimised", strategy="fixed", tip_offset=True, touch=True)
    agent = Agent(Model(task, CELL), settings)
    world = PyBulletWorld(task, CELL)
    plant = WorldPlant(world, task, CELL)
    plant.begin(3)
    passed = run_straw_man("script", agent, plant, task.max_actions, unwatched)
    ending = ending_now(world.truth())
    world.close()
    assert passed and task.succeeded(ending)
    assert ending.peak_contact_force < 25.0
