"""What touch changes in an agent: when the camera moves, and what one episode leaves for the next."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import (
    EXACT,
    CellCorrection,
    CorrectionCovariance,
    twist_names,
)
from samrl_core.cell.calibration.seen_error import EXACTLY_SEEN
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import ArmReading
from samrl_core.model.model import Model
from samrl_core.model.real2sim.prediction import CameraErrors, loosened_by
from samrl_core.model.real2sim.real2sim import Estimate, initial_estimate
from samrl_core.model.real2sim.tip_offset import TipOffset
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.policy.contact.seen_hole import SeenHole

CELL, TASK = cell_named(), task_named("peg_insertion_hard")
SETTINGS = AgentSettings(policy="optimised", strategy="best", tip_offset=True, touch=True)


@pytest.fixture(scope="module")
def agent() -> Agent:
    return Agent(Model(TASK, CELL), SETTINGS)


def known(agent: Agent, deviation: float) -> Estimate:
    return replace(initial_estimate(agent.model), covariance=deviation**2 * np.eye(4))


def seen(deviation: float, images: int) -> TipOffset:
    return TipOffset(np.array([0.001, 0.0, 0.0, 0.0]), deviation**2 * np.eye(4), TASK.start_camera(), images)


@pytest.mark.parametrize(
    ("hole", "tip", "images", "strategy"),
    [
        (0.002, 0.001, 5, "best"),  # the hole is the less known
        (0.0002, 0.001, 5, "fixed"),  # the tip is, and a camera that moves would have to see it anew
        (0.0002, 0.005, 0, "best"),  # the tip was never seen
    ],
)
def test_the_camera_moves_for_what_is_known_least(
    agent: Agent, hole: float, tip: float, images: int, strategy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    planner = SimpleNamespace(plan=lambda *given: asked.append(given[3]))
    monkeypatch.setitem(agent.__dict__, "_view_planner", planner)
    agent.restart(SETTINGS)
    agent._tip_offset = seen(tip, images)
    joints: Any = SimpleNamespace(position=np.zeros(7))
    observation: Any = SimpleNamespace(tool_arm=joints, camera_arm=joints, stamp_ns=agent._tip_seen_ns)
    agent.plan_view(known(agent, hole), observation)
    assert asked == [strategy]


def test_the_next_episode_keeps_what_the_cell_told_and_a_new_agent_does_not(agent: Agent) -> None:
    agent.restart(SETTINGS)
    assert agent._touch is not None
    agent._tip_offset = seen(0.0003, 9)
    agent._touch.memory = replace(agent._touch.memory, error=np.array([0.001, -0.0005]))
    agent.begin_episode()
    assert agent._tip_offset is not None and agent._touch is not None
    np.testing.assert_allclose(agent._tip_offset.mean[0], 0.001, rtol=0.05)
    assert agent._touch.memory.error[0] == 0.001 and not agent._touch.in_contact
    agent.restart(SETTINGS)
    assert not agent._tip_offset.mean.any() and not agent._touch.memory.error.any()


@pytest.mark.parametrize(("sees_tip", "sees_colours"), [(True, True), (False, True), (True, False)])
def test_an_ablation_leaves_out_the_tip_or_the_colours_of_an_image(
    agent: Agent, sees_tip: bool, sees_colours: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An image corrects the tip's offset, and hole and peg's end are looked for in it, unless left out."""
    looked: list[str] = []
    joints = ArmReading(0, TASK.start_joints(CELL)["tool_arm"], np.zeros(7), np.zeros(7))
    camera = SimpleNamespace(camera_in_world=TASK.start_camera())
    image: Any = SimpleNamespace(stamp_ns=7, tool_arm=joints, camera=camera)

    def by_colour(hole: SeenHole, *given: Any) -> SeenHole:
        looked.append("colours")
        return hole

    agent.restart(replace(SETTINGS, sees_tip=sees_tip, sees_colours=sees_colours))
    fit = SimpleNamespace(update=lambda belief, *given: looked.append("tip") or seen(0.0003, 1))
    monkeypatch.setitem(agent.__dict__, "_tip_offset_fit", fit)
    monkeypatch.setattr(SeenHole, "with_image", by_colour)
    agent.act(known(agent, 0.001), image)
    assert looked == ["tip"] * sees_tip + ["colours"] * sees_colours
    agent.restart(SETTINGS)


def test_an_ablation_updates_the_model_by_the_first_image_alone_and_still_sees_tip_and_colours(
    agent: Agent, monkeypatch: pytest.MonkeyPatch
) -> None:
    tips: list[int] = []
    updated: list[int] = []
    joints = ArmReading(0, TASK.start_joints(CELL)["tool_arm"], np.zeros(7), np.zeros(7))
    camera = SimpleNamespace(camera_in_world=TASK.start_camera())

    def update(before: Estimate, image: Any, compared: bool) -> Estimate:
        updated.append(image.stamp_ns)
        return replace(before, stamp_ns=image.stamp_ns)

    def see_tip(belief: TipOffset, image: Any, encoders: np.ndarray) -> TipOffset:
        tips.append(image.stamp_ns)
        return belief

    agent.restart(replace(SETTINGS, most_updates=1))
    monkeypatch.setitem(
        agent.__dict__, "_tip_offset_fit", SimpleNamespace(update=see_tip, begin=lambda kept: kept)
    )
    monkeypatch.setitem(agent.__dict__, "_real2sim", SimpleNamespace(update=update))
    for stamp in (1, 2, 3):
        image: Any = SimpleNamespace(stamp_ns=stamp, tool_arm=joints, camera=camera)
        assert agent.update_model(image).stamp_ns == stamp
    assert updated == [1] and tips == [1, 2, 3]
    agent.begin_episode()  # has a first image of its own
    agent.update_model(image)
    assert updated == [1, 3]
    monkeypatch.undo()
    agent.restart(SETTINGS)


def test_an_agent_that_only_looks_rests_its_camera_once_another_one_touches() -> None:
    looks = Agent(Model(TASK, CELL), SETTINGS, verbs=("plan_view",))
    looks.note_action("above")
    assert looks._view_would_help(known(looks, 0.002))
    looks.note_action("search")
    assert not looks._view_would_help(known(looks, 0.002))
    looks.begin_episode()
    assert looks._view_would_help(known(looks, 0.002))


def test_one_image_that_the_fit_did_not_settle_in_moves_no_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mask that misses makes the hole unsure for once; the second time in a row the view is to blame."""
    looks = Agent(Model(TASK, CELL), SETTINGS, verbs=("plan_view",))
    planned: list[str] = []

    def plan(estimate: Estimate, tool: Any, camera: Any, strategy: str, rng: Any = None) -> None:
        planned.append(strategy)

    monkeypatch.setitem(looks.__dict__, "_view_planner", SimpleNamespace(plan=plan))
    monkeypatch.setattr(looks, "_see_tip", lambda image: None)
    joints = SimpleNamespace(position=np.zeros(7))
    image: Any = SimpleNamespace(tool_arm=joints, camera_arm=joints)
    sure = known(looks, 0.002)
    unsure = replace(sure, why_stopped="iteration_limit")
    for estimate in (unsure, sure, unsure, unsure):
        looks.plan_view(estimate, image)
    assert planned == ["fixed", SETTINGS.strategy, "fixed", SETTINGS.strategy]
    looks.begin_episode()
    looks.plan_view(unsure, image)
    assert planned[-1] == "fixed"


def test_a_correction_that_is_not_known_exactly_makes_images_worth_less(agent: Agent) -> None:
    """A base that is known to 4 mm and 20 mrad, half a metre away, and the same known exactly."""
    bases = CELL.camera_base_in_world.inverse() @ CELL.tool_base_in_world
    names = twist_names("tool_base_in_camera_base")
    known = CorrectionCovariance(names, np.diag([0.004**2] * 3 + [0.02**2] * 3))
    beliefs = {}
    for name, covariance in (("roughly", known), ("exactly", EXACT)):
        correction = CellCorrection(tool_base_in_camera_base=bases, covariance=covariance)
        agent.restart(SETTINGS, correction=correction)
        assert agent._tip_offset is not None and agent._touch is not None
        beliefs[name] = (
            np.sqrt(np.diag(agent._tip_offset.covariance)),
            agent._touch.memory.variance,
            agent._view_planner.camera_errors,
        )
    (tip, unknown, camera), (usual_tip, usual, usual_camera) = beliefs["roughly"], beliefs["exactly"]
    assert (tip[:2] > 1.5 * usual_tip[:2]).all() and (tip[2:] == usual_tip[2:]).all()
    assert unknown > 1.5 * usual
    assert camera.per_metre > 2.0 * usual_camera.per_metre  # the base's height is seen along another ray
    assert camera.per_radian == usual_camera.per_radian  # a base does not turn with the camera
    agent.restart(SETTINGS)
    assert usual_camera == agent._view_planner.camera_errors == CameraErrors()
    assert agent._touch.memory.variance == usual


def test_a_camera_that_is_estimated_begins_as_unknown_as_its_correction_leaves_it() -> None:
    specs = task_named("spatula_flipping_hard").parameters()
    seen = replace(EXACTLY_SEEN, position=np.diag([1e-6, 4e-6, 9e-6]))
    own = np.diag([p.scale**2 for p in specs])
    after = loosened_by(replace(known_nothing(), covariance=own), specs, seen)
    camera = np.array([p.kind == "camera" for p in specs])
    assert camera.sum() == 3
    added = np.diag(after.covariance - own)
    np.testing.assert_allclose(added[camera], [1e-6, 4e-6, 9e-6])
    assert not added[~camera].any()


def known_nothing() -> Estimate:
    return initial_estimate(Model(TASK, CELL))


def test_a_spatula_feels_first_and_its_tip_is_as_high_as_over_the_felt_plate() -> None:
    """Steps towards the plate while that is unknown; another episode knows nothing of it."""
    task = task_named("spatula_flipping_hard")
    agent = Agent(Model(task, CELL), SETTINGS, verbs=("act",))
    arm = ArmReading(1, task.start_joints(CELL)["tool_arm"], np.zeros(7), np.zeros(7))
    observation: Any = SimpleNamespace(tool_arm=arm, stamp_ns=1)
    tip = agent.model.tip_in_base(arm.position).position
    choice = agent.act(initial_estimate(agent.model), observation)
    assert choice.sub_goal == "behind" and choice.displacement[2] == 0.0  # over where it comes down, first
    np.testing.assert_allclose(agent.tip(observation), tip)
    assert agent._surface is not None
    agent._surface._touched = 0.003 + agent._surface._task.edge_height
    np.testing.assert_allclose(agent.tip(observation), tip - [0.0, 0.0, 0.003], atol=1e-12)
    agent.begin_episode()
    np.testing.assert_allclose(agent.tip(observation), tip)
