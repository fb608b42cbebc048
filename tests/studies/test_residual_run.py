"""A run of residual training: it comes to the same however often it is stopped, and learns what it can."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.data.checkpoint import load_checkpoint
from samrl_core.learning.data.fit import STOPPED
from samrl_core.learning.residual.replay import End
from samrl_core.learning.residual.td3 import TD3, TD3Settings
from samrl_core.policy.agent.exploration import clip_norm
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Played
from samrl_core.studies.paper.residual_evaluation import RunSettings, evaluated, evaluated_file, weights_of
from samrl_core.studies.paper.residual_run import KIND, ResidualRun
from tests.learning import toy_cell
from tests.learning.small_cell import SMALL
from tests.studies import kinematic_peg

PLACE = EpisodeSite("toy", "optimised", None, (0.001, 0.0, -0.002))
LEARNER = TD3Settings(batch_size=4, n_step=2, warm_up=1, policy_delay=1)
SETTINGS = RunSettings(
    (0, 12, 20), LEARNER, episodes=2, first_steps=5, updates_per_step=0.3, evaluated=3, max_actions=3
)


class FakeCell:
    """Episodes of a few actions in the toy's world."""

    def __init__(self) -> None:
        self.orders: list[Order] = []
        self.break_after = 10**6

    def __call__(self, orders: Sequence[Order]) -> list[Played]:
        if len(self.orders) + len(orders) > self.break_after:
            raise KeyboardInterrupt
        self.orders += orders
        return [self.play(order) for order in orders]

    def play(self, order: Order) -> Played:
        rng = np.random.default_rng(order.seed)
        noise, actor = kinematic_peg.ordered(order)
        steps, good = [], False
        for index in range(order.max_actions):
            state, error = toy_cell.draw_state(rng, 0)
            chosen = toy_cell.chosen_residual(actor, state)
            residual = clip_norm(chosen + noise.next(), order.limit)
            steps.append(replace(state, step=index, residual=residual, executed=state.nominal + residual))
            good = toy_cell.succeeds(residual, error)
            if good:
                break
        return Played(tuple(steps), "done" if good else "action_limit", "", good, 0.001)


def run(folder: Path, play: FakeCell, settings: RunSettings = SETTINGS, seed: int = 0) -> ResidualRun:
    return ResidualRun(folder, PLACE, SMALL, toy_cell.ENCODER, seed, settings, play)


def content(one: ResidualRun) -> dict[str, torch.Tensor]:
    return one._learner.state()


def test_a_run_collects_trains_and_counts(tmp_path: Path) -> None:
    play = FakeCell()
    one = run(tmp_path, play)
    one.save_weights(tmp_path / "before.safetensors")
    before, _ = evaluated_file(play, PLACE, 0, SETTINGS, tmp_path / "before.safetensors", SMALL)
    assert one.steps == 0 and before.residual == 0.0
    assert len(before.successes) == 3 and not any(order.residual for order in play.orders)
    assert {order.exploration for order in play.orders} == {0.0} and play.orders[0].max_actions == 3
    one.advance(12)
    one.save_weights(tmp_path / "after.safetensors")
    after, info = evaluated_file(play, PLACE, 0, SETTINGS, tmp_path / "after.safetensors", SMALL)
    assert one.steps >= 12 and one._learner.updates == int(np.ceil(0.3 * (one.steps - 5)))
    trained = play.orders[3:-3]
    assert {o.exploration for o in trained} == {SETTINGS.exploration} and len(trained) == one._episodes
    scenes = [o.seed for o in trained]
    assert len(set(scenes)) == len(scenes) and not {o.seed for o in play.orders[:3]} & set(scenes)
    assert [o.seed for o in play.orders[:3]] == [o.seed for o in play.orders[-3:]]
    _, episodes, steps, ends = one._replay.outline()
    assert len(episodes) == one.steps and set(episodes) == set(range(one._episodes))
    assert (ends[np.flatnonzero(steps == 0)[1:] - 1] != End.OPEN).all()  # every episode's last step says how
    assert after.residual > 0.0
    counts = {"steps": one.steps, "updates": one._learner.updates, "episodes": one._episodes}
    assert info.figures == {**counts, "offset_x": 0.001, "offset_y": 0.0, "offset_z": -0.002}


@pytest.mark.parametrize("stopped", [1, 3, 6])
def test_a_stopped_run_comes_to_the_same(tmp_path: Path, stopped: int) -> None:
    """Bit for bit, stopped within a round or between two, with half of a round in the replay."""
    whole = run(tmp_path / "whole", FakeCell())
    whole.advance(20)
    play = FakeCell()
    first = run(tmp_path / "stopped", play)
    play.break_after = stopped
    with pytest.raises(KeyboardInterrupt):
        first.advance(20)
    state, _ = toy_cell.draw_state(np.random.default_rng(5), 77)
    first._replay.append(state)  # of a round that was cut off
    first.close()
    second = run(tmp_path / "stopped", FakeCell())
    assert second.steps < 20
    second.advance(20)
    a, b = content(whole), content(second)
    assert a.keys() == b.keys() and all(torch.equal(a[k], b[k]) for k in a)
    for mine, other in zip(whole._replay.outline(), second._replay.outline(), strict=True):
        assert np.array_equal(mine, other)


def test_what_is_not_finite_stops_with_the_state_saved(tmp_path: Path) -> None:
    """The last whole round stays what a run goes on from."""
    one = run(tmp_path, FakeCell())
    one.advance(12)
    updates, steps = one._learner.updates, one.steps
    assert isinstance(one._learner, TD3)
    with torch.no_grad():
        one._learner.critic.get_parameter("first.0.bias")[0] = torch.nan
    with pytest.raises(SolveError, match=f"update {updates}: the critic's loss is nan"):
        one.advance(20)
    one.close()
    saved, about = load_checkpoint(tmp_path / STOPPED, KIND)
    assert bool(torch.isnan(saved["critic.first.0.bias"][0])) and int(saved["updates"]) == updates
    assert about["steps"] > steps
    again = run(tmp_path, FakeCell())
    assert again.steps == steps and again._learner.updates == updates
    again.advance(20)


def test_rounds_grow_with_what_there_is_and_end_at_the_point(tmp_path: Path) -> None:
    """By the share asked for, and by no more episodes than the steps that are left may need."""
    rounds: list[int] = []
    cell = FakeCell()

    def play(orders: Sequence[Order]) -> list[Played]:
        rounds.append(len(orders))
        return cell(orders)

    settings = replace(SETTINGS, points=(60,), growth=0.5)
    one = ResidualRun(tmp_path, PLACE, SMALL, toy_cell.ENCODER, 0, settings, play)
    one.advance(60)
    before = np.cumsum([0, *rounds[:-1]])
    assert all(2 <= n <= max(2, 0.5 * b) for n, b in zip(rounds, before, strict=True))
    assert max(rounds) >= 4 and 60 <= one.steps < 60 + 2 * 3


def test_seeds_differ(tmp_path: Path) -> None:
    cells = [FakeCell(), FakeCell()]
    for seed, play in enumerate(cells):
        run(tmp_path / str(seed), play, seed=seed).advance(4)
    assert not {o.seed for o in cells[0].orders} & {o.seed for o in cells[1].orders}
    assert not {o.noise_seed for o in cells[0].orders} & {o.noise_seed for o in cells[1].orders}


def test_a_folder_of_another_run_is_refused(tmp_path: Path) -> None:
    one = run(tmp_path, FakeCell())
    one.advance(6)
    one.close()
    with pytest.raises(InputError, match="another settings"):
        run(tmp_path, FakeCell(), replace(SETTINGS, exploration=0.002))
    with pytest.raises(InputError, match="another seed"):
        run(tmp_path, FakeCell(), seed=1)
    (tmp_path / "replay.bin").unlink()
    with pytest.raises(InputError, match="put the replay back"):
        run(tmp_path, FakeCell())


@pytest.mark.parametrize(
    "bad", [{"points": ()}, {"points": (5, 2)}, {"episodes": 0}, {"exploration": 0.0}, {"growth": -0.1}]
)
def test_settings_out_of_range_are_refused(bad: dict) -> None:
    with pytest.raises(InputError, match=next(iter(bad))):
        replace(SETTINGS, **bad)


@pytest.mark.thorough
def test_the_experiment_goes_on_where_it_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every point of every seed once, the picture, the weights, and nothing done twice."""
    from samrl_core.studies.experiment import Options
    from samrl_core.studies.paper import calibration_gap, residual_trainings, sample_efficiency

    cells: list[FakeCell] = []

    nominal: list[Order] = []

    def here(orders: Sequence[Order]) -> list[Played]:
        if len(orders) == calibration_gap.EPISODES:  # of the search for the gap
            nominal.extend(orders)
            return [Played((), "done", "", o.site.offset[0] < 0.48 * 0.0045, 0.0) for o in orders]
        cells[-1].orders += orders
        return [cells[-1].play(order) for order in orders]

    def settings(points: tuple[int, ...], max_actions: int) -> RunSettings:
        assert max_actions == 40  # of a task with 100
        return replace(SETTINGS, points=points)

    monkeypatch.setattr(residual_trainings, "cell_named", lambda name: SMALL)
    monkeypatch.setattr(residual_trainings, "nominal_encoder", lambda *_: toy_cell.ENCODER)
    monkeypatch.setattr(residual_trainings.Player, "__call__", lambda _, orders: here(orders))
    monkeypatch.setattr(sample_efficiency, "RunSettings", settings)
    monkeypatch.setattr(sample_efficiency, "POINTS", (0, 6))

    told: list[str] = []
    results = []
    for _ in range(2):
        cells.append(FakeCell())
        options = Options(tmp_path, ("peg_insertion",), count=12, workers=1)
        results.append(sample_efficiency.EXPERIMENT.result(options, told.append))
    assert cells[0].orders and not cells[1].orders and results[0] == results[1]
    found = json.loads((tmp_path / "sample_efficiency.json").read_text())
    curve = found["tasks"]["peg_insertion"]["curve"]
    assert [one["point"] for one in curve] == [0, 6, 12] and curve[0]["steps"] == 0
    assert all(one["success"]["trials"] == 9 and len(one["by_seed"]) == 3 for one in curve)
    assert (tmp_path / "sample_efficiency.png").stat().st_size > 1000
    assert (
        len(list((tmp_path / "weights").rglob("peg_insertion_residual_actor.safetensors"))) == 9
    )  # of every point
    assert found["gap"]["peg_insertion"]["length"] == 0.005
    # No larger error was tried, and the scenes are the same at each.
    assert len(nominal) == 4 * calibration_gap.EPISODES
    assert len({o.seed for o in nominal}) == calibration_gap.EPISODES
    assert {order.site.offset for order in cells[0].orders} == {calibration_gap.offset_of(0.005)}
    assert sum("real steps" in line for line in told) == 9


def test_kept_weights_are_judged_long_after_they_were_trained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A point whose case is missing comes to the same, though the run has gone on since."""
    from samrl_core.studies.paper import residual_trainings

    monkeypatch.setattr(residual_trainings, "cell_named", lambda name: SMALL)
    play = FakeCell()
    settings = replace(SETTINGS, points=(6, 12))
    job = residual_trainings.TrainingJob(PLACE, 3, settings)
    one = ResidualRun(tmp_path / "run", PLACE, SMALL, toy_cell.ENCODER, 3, settings, play)
    at_once = []
    for point in settings.points:
        one.advance(point)
        one.save_weights(residual_trainings.weights_at(tmp_path, "toy", 3, point))
        weights = weights_of(one._learner.actor, one._learner.updates)
        now = evaluated(play, PLACE, 3, settings, weights)
        at_once.append((one.steps, one._episodes, sum(now.successes), now.residual))
    for point, (steps, episodes, successes, residual) in zip(settings.points, at_once, strict=True):
        case = residual_trainings.evaluate_at(job, point, tmp_path, play)
        assert (case["steps"], case["episodes"], case["successes"]) == (steps, episodes, successes)
        assert case["key"] == job.key(point) and residual > 0.0
        assert case["residual"] == pytest.approx(residual, rel=1e-2)
    with pytest.raises(InputError, match="steps_99"):
        residual_trainings.evaluate_at(job, 99, tmp_path, play)


@pytest.mark.parametrize("processes", [1, 25, 200])
@pytest.mark.parametrize(("fails_from", "taken"), [(0.004, 0.004), (0.0, 0.0), (1.0, 0.016)])
def test_the_gap_is_the_smallest_at_which_nominal_actions_fail(
    tmp_path: Path, fails_from: float, taken: float, processes: int
) -> None:
    """None where they fail without, and the largest where they never do; however many play at once."""
    from samrl_core.studies.experiment import CaseLog
    from samrl_core.studies.paper.calibration_gap import EPISODES, LADDER, gaps, offset_of

    site = EpisodeSite("peg_insertion", "optimised", None, (0.0, 0.0, 0.0))
    orders: list[Order] = []

    def play(some: Sequence[Order]) -> list[Played]:
        orders.extend(some)
        good = [np.linalg.norm(order.site.offset) < fails_from - 1e-9 for order in some]
        return [Played((), "done", "", bool(one), 0.0) for one in good]

    for _ in range(2):
        found = gaps(CaseLog(tmp_path), [site], play, lambda text: None, processes)["peg_insertion"]
        assert found["length"] == taken and tuple(found["offset"]) == offset_of(taken)
    needed = [n for n in LADDER if n <= taken]
    at_once = max(1, processes // EPISODES)
    played = min(len(LADDER), -(-len(needed) // at_once) * at_once)
    assert len(found["success"]) == len(needed) and len(orders) == played * EPISODES  # once


def test_the_kinematic_peg_fails_at_times_without_a_residual() -> None:
    """What settings of the learner are tried on: there is something to learn."""
    settings = RunSettings((0, 10), evaluated=40)
    nominal = evaluated(kinematic_peg.play, PLACE, 0, settings, {})
    assert 0.25 < np.mean(nominal.successes) < 0.65 and nominal.successes == nominal.detected
