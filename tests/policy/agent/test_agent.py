"""Algorithm 1 in the library: its loop, its learned parts, what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Frame, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate
from samrl_core.policy.agent import agent as agent_module
from samrl_core.policy.agent.agent import Agent
from samrl_core.policy.agent.episode import run_episode
from samrl_core.policy.agent.loop import LoopSettings, LoopState, stage_after_update
from samrl_core.policy.agent.settings import AgentSettings, announced_residual, trained_networks
from samrl_core.policy.networks.network_image import observed_image
from samrl_core.policy.networks.networks import ResidualActor, SensingQ, SimActor
from samrl_core.policy.networks.weights import Kind, WeightsInfo, save_weights, sha256_of
from samrl_core.policy.view.sensing_value import Networks, SensingValue
from samrl_core.policy.view.view_planning import ViewChoice

LIMIT, RESIDUAL_LIMIT = 0.005, 0.002  # [m]


def networks() -> Networks:
    generator = torch.Generator().manual_seed(5)
    return Networks(SimActor(LIMIT, generator).eval(), SensingQ(generator).eval())


def residual() -> ResidualActor:
    """Past its zero start."""
    found = ResidualActor(RESIDUAL_LIMIT, torch.Generator().manual_seed(6)).requires_grad_(False).eval()
    last = found.head[-1]
    assert isinstance(last, torch.nn.Linear)
    torch.nn.init.normal_(last.weight, std=0.2, generator=torch.Generator().manual_seed(7))
    return found


def info(model: Model, kind: Kind, limit: float) -> WeightsInfo:
    return WeightsInfo(kind, model.task.name, model.cell.intrinsics, limit, 0)


def updating_agent(model: Model) -> Agent:
    """One that nothing but updates."""
    return Agent(model, verbs=("update_model",))


class ScriptedViews:
    """Moves to the given joints one after the other, then stays."""

    def __init__(self, *joints: np.ndarray) -> None:
        self.left, self.asked = list(joints), 0

    def plan_view(self, estimate: Any, observation: Observation) -> ViewChoice:
        self.asked += 1
        move = bool(self.left)
        joints = self.left.pop(0) if move else observation.camera_arm.position
        return ViewChoice(move, Pose.identity(), joints, 0.0, 0.0, 0.0, 1, "scripted")


def test_two_actions_of_algorithm_1(model: Model, plant: Any) -> None:
    """The model follows the images; the tool goes straight to above the hole that they show."""
    agent = Agent(model, AgentSettings(policy="optimised", strategy="fixed"))
    episode = run_episode(agent, plant, LoopSettings(max_actions=2))
    assert episode.ended == "action_limit" and len(episode.steps) == 2
    np.testing.assert_allclose(episode.estimate.values, [0.51, -0.007], atol=1e-3)
    tips = [model.tip_in_base(s.observation.tool_arm.position).position for s in episode.steps]
    for step, displacement in zip(episode.steps, plant.displacements, strict=True):
        np.testing.assert_array_equal(step.choice.displacement, displacement)
        np.testing.assert_array_equal(step.choice.residual, 0.0)
    np.testing.assert_allclose(tips[1] - tips[0], plant.displacements[0], atol=1e-4)
    goal = model.task.sub_goals(np.array([0.51, -0.007]), tips[0])[0].tip_position  # where it truly is
    last = model.tip_in_base(episode.last.tool_arm.position).position
    nearer = np.linalg.norm(goal - tips[0]) - np.linalg.norm(goal - last)
    assert nearer > 0.95 * sum(np.linalg.norm(d) for d in plant.displacements) > 5e-3


def test_predictions_that_compete_are_told_apart_by_the_known_colours(
    model: Model, plant: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One alone needs no such verdict: its eq. 6 with them is not worked out."""
    alone, several = updating_agent(model), updating_agent(model)
    image = plant.observe()
    start = several.update_model(image)
    assert np.isnan(start.loss_known)
    repainted = replace(start, colors=1.0 - start.colors)
    monkeypatch.setattr(agent_module, "predictions", lambda *_: (repainted, start))
    found = several.update_model(image)
    assert np.isfinite(found.loss_known)
    alone.update_model(image)
    monkeypatch.setattr(agent_module, "predictions", lambda *_: (start,))
    once = alone.update_model(image)
    assert np.isnan(once.loss_known)
    np.testing.assert_array_equal(once.values, found.values)
    np.testing.assert_array_equal(once.colors, found.colors)


def test_looks_again_until_it_stays_or_has_looked_enough(model: Model, plant: Any) -> None:
    """Lines 5 to 15: an image after every camera move; no search between two periods."""
    elsewhere = [plant.joints["camera_arm"] + d for d in (0.02, 0.04, 0.06)]
    for looks, moves, images, asked in ((1, 1, 4, 1), (2, 2, 5, 2), (5, 3, 6, 4)):
        agent = Agent(model, AgentSettings(policy="optimised", strategy="fixed", update=False))
        script = ScriptedViews(*elsewhere)
        agent.plan_view = script.plan_view
        plant.images = 0
        run_episode(agent, plant, LoopSettings(max_actions=2, view_period=2, views_per_search=looks))
        assert (plant.images, script.asked) == (images, asked)
        np.testing.assert_array_equal(plant.joints["camera_arm"], elsewhere[moves - 1])


def test_stages() -> None:
    """Each end before the next stage; the first that applies."""
    loop = LoopSettings(max_actions=4, view_period=2, views_per_search=1, max_lost_updates=1)
    no = staticmethod(lambda values, tip: False)
    task: Any = type(
        "T", (), {"is_done": staticmethod(lambda values, tip: bool(values[0])), "needs_aim": no}
    )()

    def stage(done: float, **counts: int) -> str:
        return stage_after_update(task, np.array([done]), np.zeros(3), LoopState(**counts), loop)

    assert stage(0.0) == stage(0.0, step=2) == "view"
    assert stage(0.0, view_searches=1) == stage(0.0, step=1) == "act"
    assert stage(0.0, step=4) == "action_limit"
    assert stage(1.0, step=1) == stage(1.0, step=4) == stage(1.0) == "again"
    assert stage(1.0, step=4, confirmed=1) == stage(1.0, confirmed=1) == "done"
    assert stage(1.0, step=1, confirmed=1, lost_updates=1) == "act"  # that is a prediction, no image
    first = LoopState(step=3).confirmed_once()
    assert first.confirmed == 1 and first.acted().confirmed == first.view_searched().confirmed == 0
    blind = replace(loop, stop_on_model_success=False)
    assert stage_after_update(task, np.array([1.0]), np.zeros(3), LoopState(step=1), blind) == "act"
    assert stage_after_update(task, np.array([1.0]), np.zeros(3), LoopState(step=4), blind) == "action_limit"
    assert stage(1.0, lost_updates=2) == "lost"
    assert stage(0.0, lost_updates=1, step=1) == "act"


def test_a_view_is_searched_before_an_action_that_needs_the_aim() -> None:
    """Whichever action it is, and more than once; of a view that is held nothing is asked."""
    no, yes = (staticmethod(lambda values, tip, word=word: word) for word in (False, True))
    task: Any = type("T", (), {"is_done": no, "needs_aim": yes})()

    def stage(loop: LoopSettings, **counts: int) -> str:
        return stage_after_update(task, np.zeros(1), np.zeros(3), LoopState(**counts), loop)

    loop = LoopSettings(max_actions=9, view_period=3, views_per_search=1, views_to_aim=2)
    assert stage(loop, step=1) == stage(loop, step=1, view_searches=1) == "view"
    assert stage(loop, step=1, view_searches=2) == "act"
    assert stage(replace(loop, views_per_search=0), step=1) == "act"


def test_an_image_that_did_not_settle_is_taken_again_before_an_action_that_needs_the_aim() -> None:
    """In `careless:4` the search kept the camera, and the tool went 6 mm aside by such an image."""
    no, yes = (staticmethod(lambda values, tip, word=word: word) for word in (False, True))
    aimed, free = (type("T", (), {"is_done": no, "needs_aim": word})() for word in (yes, no))
    loop, settled = LoopSettings(max_actions=9), LoopState(step=1, view_searches=2)

    def stage(task: Any, state: LoopState) -> str:
        return stage_after_update(task, np.zeros(1), np.zeros(3), state, loop)

    moved = settled.updated("iteration_limit", 0.7)
    assert stage(aimed, moved) == "retake" and stage(free, moved) == "act"
    assert stage(aimed, settled.updated("converged", 0.1)) == "act"
    assert stage(aimed, moved.updated("no_target", 0.0)) == "act"
    once = moved.confirmed_once().retaken_once()
    assert once.confirmed == 0  # what is taken again said nothing of "done"
    assert stage(aimed, once.updated("iteration_limit", 0.7)) == "act"
    for later in (once.acted(), once.view_searched(), once.interrupted()):
        assert not later.retaken


def test_an_episode_takes_an_image_again_where_it_stands(
    model: Model, plant: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One more image, and no action more."""
    monkeypatch.setattr(type(model.task), "needs_aim", lambda *_: True)
    agent = Agent(model, AgentSettings(policy="optimised", strategy="fixed", update=False))
    update = agent.update_model
    agent.update_model = lambda observation: replace(
        update(observation), why_stopped="iteration_limit" if plant.images == 1 else "converged"
    )
    episode = run_episode(agent, plant, LoopSettings(max_actions=1, views_per_search=0))
    assert (episode.ended, len(episode.steps), plant.images) == ("action_limit", 1, 3)


def test_two_images_in_a_row_have_to_agree(model: Model, plant: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(model.task), "is_done", lambda *_: plant.images in (2, 4, 5))
    agent = Agent(model, AgentSettings(strategy="fixed", update=False), networks())
    episode = run_episode(agent, plant, LoopSettings(max_actions=9, views_per_search=0))
    assert (episode.ended, len(episode.steps), plant.images) == ("done", 2, 5)


def test_a_verdict_from_a_fit_of_something_else_is_not_believed() -> None:
    """A pancake that rolled out of sight was seen to what was left of it, and was "flipped" there."""
    loop = LoopSettings(max_actions=9, done_confirmations=1)
    yes, no = (staticmethod(lambda values, tip, word=word: word) for word in (True, False))
    task: Any = type("T", (), {"is_done": yes, "needs_aim": no})()
    state = LoopState(step=1)
    for misfit in (0.04, 0.05, 0.045):
        state = state.updated("converged", misfit)
    bad = state.updated("iteration_limit", 1.47)
    assert stage_after_update(task, np.zeros(1), np.zeros(3), state, loop) == "done"
    assert stage_after_update(task, np.zeros(1), np.zeros(3), bad, loop) == "act"
    unseen = bad.updated("no_target", 0.04)
    assert unseen.lost_updates == 1 and unseen.misfits == bad.misfits
    again = unseen.updated("converged", 0.06)
    assert again.lost_updates == 0
    assert stage_after_update(task, np.zeros(1), np.zeros(3), again, loop) == "done"
    # Nothing was ever seen: the model's word is all there is.
    assert LoopState().updated("disabled", float("nan")).misfits == ()
    assert stage_after_update(task, np.zeros(1), np.zeros(3), LoopState(step=1), loop) == "done"


def test_the_learned_action_is_the_actors_on_the_models_image(model: Model, plant: Any) -> None:
    """Eq. 12, from where the real camera stands."""
    trained, estimate, observation = networks(), initial_estimate(model), plant.observe()
    choice = Agent(model, AgentSettings(policy="learned"), trained).act(estimate, observation)
    value = SensingValue(model, trained, estimate, observation.tool_arm.position)
    with torch.no_grad():
        expected = trained.actor(value.view(observation.camera.camera_in_world))[0].numpy()
    np.testing.assert_array_equal(choice.nominal, expected.astype(np.float64))
    assert 0.0 < np.linalg.norm(choice.nominal) <= LIMIT
    assert choice.sub_goal == model.task.sub_goals(estimate.values, np.array([0.5, 0.0, 0.2]))[0].name


def test_an_actor_of_a_randomised_model_reads_the_real_image(model: Model, plant: Any) -> None:
    """It goes by the camera alone: whatever the model believes, the action is the same."""
    trained, observation = networks(), plant.observe()
    acting = Agent(model, AgentSettings(policy="learned", update=False, actor_image="real"), trained)
    believed = initial_estimate(model)
    wrong = replace(believed, values=believed.values + 0.03)
    tip = model.tip_in_base(observation.tool_arm.position).position
    with torch.no_grad():
        expected = trained.actor(observed_image(observation, tip, model.cell)[None])[0].numpy()
    for estimate in (believed, wrong):
        nominal = acting.act(estimate, observation).nominal
        np.testing.assert_array_equal(nominal, expected.astype(np.float64))
    rendered = Agent(model, AgentSettings(policy="learned"), trained)
    assert not np.allclose(
        rendered.act(wrong, observation).nominal, rendered.act(believed, observation).nominal, atol=1e-7
    )
    with pytest.raises(InputError, match="rendered, real"):
        AgentSettings(policy="learned", actor_image="imagined")
    with pytest.raises(InputError, match="most_updates is 0, must be at least 1"):
        AgentSettings(most_updates=0)
    with pytest.raises(InputError, match="no actor to read"):
        AgentSettings(policy="optimised", actor_image="real")


def test_the_residual_is_that_of_the_real_image(model: Model, plant: Any) -> None:
    """Eqs. 13 to 15: zero at first; then the network's, added to the nominal action."""
    estimate, observation = initial_estimate(model), plant.observe()
    acting = Agent(model, AgentSettings(policy="learned"), networks())
    before = acting.act(estimate, observation)
    acting.residual = ResidualActor(RESIDUAL_LIMIT)
    np.testing.assert_array_equal(acting.act(estimate, observation).displacement, before.nominal)
    acting.residual = residual()
    after = acting.act(estimate, observation)
    tip = model.tip_in_base(observation.tool_arm.position).position
    image = observed_image(observation, tip, model.cell)[None]
    nominal = torch.tensor(after.nominal, dtype=torch.float32)[None]
    with torch.no_grad():
        expected = acting.residual(image, nominal)[0].numpy()
    np.testing.assert_array_equal(after.residual, expected.astype(np.float64))
    np.testing.assert_array_equal(after.nominal, before.nominal)
    assert 1e-5 < np.linalg.norm(after.residual) <= RESIDUAL_LIMIT


def test_a_camera_turned_over_changes_no_residual(model: Model, plant: Any) -> None:
    """The same place, the sensor upside down."""
    seen = plant.observe()
    half_turn = Pose(np.zeros(3), np.array([0.0, 0.0, 1.0, 0.0]))
    frame = Frame(
        seen.stamp_ns,
        *(a[::-1, ::-1].copy() for a in (seen.frame.color, seen.frame.depth)),
        seen.frame.mask[::-1, ::-1].copy(),
    )
    turned = Observation(
        frame,
        Camera(seen.camera.intrinsics, seen.camera.camera_in_world @ half_turn),
        seen.tool_arm,
        seen.camera_arm,
    )
    acting = Agent(model, AgentSettings(policy="learned"), networks())
    acting.residual = residual()
    one, other = (acting.act(initial_estimate(model), o) for o in (seen, turned))
    np.testing.assert_allclose(one.residual, other.residual, atol=2e-6)
    np.testing.assert_allclose(one.nominal, other.nominal, atol=2e-5)


def test_exploration_is_seeded_and_bounded(model: Model, plant: Any) -> None:
    settings = AgentSettings(policy="learned", exploration=0.004, exploration_limit=0.003, seed=3)
    observation, estimate = plant.observe(), initial_estimate(model)

    def draws(seed: int) -> list[np.ndarray]:
        acting = Agent(model, replace(settings, seed=seed), networks())
        return [acting.act(estimate, observation).residual for _ in range(3)]

    first = draws(3)
    np.testing.assert_array_equal(first, draws(3))
    assert not np.allclose(first, draws(4))
    assert all(1e-6 < np.linalg.norm(r) <= 0.003 + 1e-12 for r in first)


def test_exploration_has_a_stream_of_its_own(model: Model) -> None:
    """Not that of strategy "random", whose views would follow from the same bits."""
    acting = Agent(model, AgentSettings(policy="optimised", strategy="random", exploration=1.0, seed=3))
    noise = acting._exploration.next()
    assert not np.allclose(noise, np.random.default_rng(3).standard_normal(3))


def test_exploration_starts_anew_with_each_episode(model: Model, plant: Any) -> None:
    """With full memory an episode has one noise, the next one another."""
    settings = AgentSettings(policy="learned", exploration=0.0005, exploration_memory=1.0)
    observation, estimate = plant.observe(), initial_estimate(model)
    acting = Agent(model, settings, networks())

    def residual() -> np.ndarray:
        return acting.act(estimate, observation).residual

    first = residual()
    np.testing.assert_array_equal(residual(), first)
    acting.begin_episode()
    assert not np.allclose(residual(), first)


def test_an_action_is_never_longer_than_the_tool_may_move(model: Model, plant: Any) -> None:
    """Whatever the residual adds; a task whose own actions are too long is refused."""
    longest = model.task.action_limit
    settings = AgentSettings(
        policy="learned", exploration=0.05, exploration_limit=0.02, longest=longest, exploration_memory=0.0
    )
    acting = Agent(model, settings, networks())
    observation, estimate = plant.observe(), initial_estimate(model)
    choices = [acting.act(estimate, observation) for _ in range(5)]
    assert all(np.linalg.norm(one.displacement) <= longest for one in choices)
    assert any(np.linalg.norm(one.residual) > 0.001 for one in choices)
    with pytest.raises(InputError, match="the tool moves at most"):
        Agent(model, replace(settings, longest=0.9 * longest), networks())


def test_networks_come_from_a_folder(model: Model, tmp_path: Path) -> None:
    """By task and kind; what is missing is named."""
    given, cell, name = networks(), model.cell, model.task.name
    save_weights(tmp_path / f"{name}_sim_actor.safetensors", given.actor, info(model, "sim_actor", LIMIT))
    with pytest.raises(InputError, match="sensing_q"):
        trained_networks(name, cell, tmp_path)
    save_weights(tmp_path / f"{name}_sensing_q.safetensors", given.q, info(model, "sensing_q", LIMIT))
    found = trained_networks(name, cell, tmp_path)
    image = torch.randn((1, 6, 128, 128), generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        np.testing.assert_allclose(found.actor(image), given.actor(image), atol=1e-5)  # half precision
    assert not any(p.requires_grad for net in (found.actor, found.q) for p in net.parameters())


def test_an_announced_residual_is_that_file_or_none(model: Model, tmp_path: Path) -> None:
    file, cell, name = tmp_path / "r.safetensors", model.cell, model.task.name
    save_weights(file, residual(), info(model, "residual_actor", RESIDUAL_LIMIT))
    assert announced_residual(file, sha256_of(file), name, cell).limit == RESIDUAL_LIMIT
    for args, words in (
        ((file, "0" * 64, name), "nothing of it is used"),
        ((file, sha256_of(file), "needle_threading"), "wanted is residual_actor of needle_threading"),
        ((tmp_path / "no", "0" * 64, name), "no residual weights"),
    ):
        with pytest.raises(InputError, match=words):
            announced_residual(*args, cell)


def test_what_needs_networks_says_so(model: Model) -> None:
    with pytest.raises(InputError, match="policy 'learned' needs trained networks"):
        Agent(model, AgentSettings(policy="learned", strategy="fixed"))
    with pytest.raises(InputError, match="strategy 'q' needs trained networks"):
        Agent(model, AgentSettings(policy="optimised", strategy="q"))
    with pytest.raises(InputError, match="learned, optimised"):
        AgentSettings(policy="clever")
    with pytest.raises(InputError, match="q, best, fixed, random"):
        AgentSettings(strategy="nearest")
