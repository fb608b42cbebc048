"""The training's folder: what it holds, how it goes on after a stop or a kill, and what it refuses."""

from __future__ import annotations

import csv
import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.data.checkpoint import load_checkpoint, save_checkpoint
from samrl_core.learning.residual import training as residual_training
from samrl_core.learning.residual import worker
from samrl_core.learning.residual.td3 import TD3, TD3Settings
from samrl_core.learning.residual.training import KIND, ResidualTraining, TrainingSettings, announced
from samrl_core.policy.networks.weights import load_weights, sha256_of
from tests.learning import toy_cell
from tests.learning.small_cell import SMALL

LEARNER = TD3Settings(batch_size=4, n_step=1, warm_up=1, policy_delay=1)
SETTINGS = toy_cell.settings(LEARNER, publish_every=2)


def trained(folder: Path, updates: int, settings: TrainingSettings = SETTINGS) -> ResidualTraining:
    training = toy_cell.training(folder, settings)
    while training.updates < updates:
        assert training.due()
        training.step()
    return training


def test_versions_are_named_announced_and_loadable(tmp_path: Path) -> None:
    toy_cell.start(tmp_path, SETTINGS, 30)
    assert announced(tmp_path, toy_cell.TASK).version == 0
    training = trained(tmp_path, 5)
    said = announced(tmp_path, toy_cell.TASK)
    assert said.version == training.version == 2
    file = Path(said.file)
    assert file.name == "residual_v000002.safetensors" and said.sha256 == sha256_of(file)
    actor, info = load_weights(file, "residual_actor", toy_cell.TASK, SMALL)
    assert info.limit == LEARNER.limit and info.figures["updates"] == 4
    state, _ = toy_cell.draw_state(np.random.default_rng(0), 0)
    residual = toy_cell.chosen_residual(actor, state)
    assert 0 < np.linalg.norm(residual) <= LEARNER.limit
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["updates"] == 4 and summary["version"] == 2
    assert summary["episodes"] == summary["steps"] == summary["episodes_ended"] == 30
    with (tmp_path / "training.csv").open() as rows:
        table = list(csv.DictReader(rows))
    assert [int(row["update"]) for row in table] == [1, 2, 3, 4, 5]
    assert float(table[-1]["critic_loss"]) >= 0 and table[0]["actor_value"] == ""


def test_old_versions_make_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(residual_training, "KEPT_VERSIONS", 5)
    toy_cell.start(tmp_path, SETTINGS, 30)
    trained(tmp_path, 14)
    files = sorted(file.name for file in tmp_path.glob("residual_v*"))
    assert files == [f"residual_v{k:06d}.safetensors" for k in range(3, 8)]


@pytest.mark.parametrize("killed", [False, True])
def test_interrupted_training_comes_to_the_same(tmp_path: Path, killed: bool) -> None:
    """Bit for bit; a killed one does the updates since its last checkpoint once more."""
    folders = tmp_path / "whole", tmp_path / "interrupted"
    for folder in folders:
        toy_cell.start(folder, SETTINGS, 30).close()
    whole = trained(folders[0], 8)
    first = trained(folders[1], 5)
    if not killed:
        first.save()
    second = toy_cell.training(folders[1], SETTINGS)
    assert second.updates == (4 if killed else 5) and second.version == 2
    second = trained(folders[1], 8)
    assert second.version == whole.version == 4
    a, b = whole.learner.state(), second.learner.state()
    assert all(torch.equal(a[name], b[name]) for name in a)
    assert (folders[0] / "training.csv").read_text() == (folders[1] / "training.csv").read_text()
    hashes = [announced(folder, toy_cell.TASK).sha256 for folder in folders]
    assert hashes[0] == hashes[1]


def test_updates_wait_for_steps(tmp_path: Path) -> None:
    settings = replace(SETTINGS, first_steps=10, updates_per_step=0.5)
    replay = toy_cell.start(tmp_path, settings, 9)
    training = toy_cell.training(tmp_path, settings)
    assert not training.due()
    rng = np.random.default_rng(1)
    toy_cell.act(replay, rng, 2, lambda _: np.zeros(3), 0.001, 0.003)
    assert training.due()
    training.step()
    assert not training.due()
    toy_cell.act(replay, rng, 1, lambda _: np.zeros(3), 0.001, 0.003)
    assert training.due()


def test_another_replay_beside_the_checkpoint_is_said_and_counted_anew(tmp_path: Path) -> None:
    """Its first steps allow updates at once: they do not wait until it is as long as the one before."""
    settings = replace(SETTINGS, updates_per_step=0.5, publish_every=100)
    toy_cell.start(tmp_path, settings, 30).close()
    first = toy_cell.training(tmp_path, settings)
    while first.due():
        first.step()
    first.save()
    assert first.updates == 15
    (tmp_path / "replay.bin").unlink()
    replay = toy_cell.start(tmp_path, settings, 4)
    told: list[str] = []
    for expected in (1, 0):  # a restart remembers, and has nothing to say
        training = ResidualTraining(tmp_path, toy_cell.TASK, SMALL, toy_cell.ENCODER, settings, told.append)
        assert len(told) == 1 and "30 steps" in told[0] and "holds 4" in told[0]
        before = training.updates
        while training.due():
            training.step()
        assert (training.updates - before > 0) == bool(expected) and training.updates == 17
        training.save()
    toy_cell.act(replay, np.random.default_rng(1), 2, lambda _: np.zeros(3), 0.001, 0.003)
    assert training.due()


def test_what_is_not_finite_stops_with_the_state_saved(tmp_path: Path) -> None:
    toy_cell.start(tmp_path, SETTINGS, 30)
    training = trained(tmp_path, 2)
    assert isinstance(training.learner, TD3)
    with torch.no_grad():
        training.learner.critic.get_parameter("first.0.bias")[0] = math.nan
    assert training.due()
    with pytest.raises(SolveError, match="not|nan"):
        training.step()
    tensors, _ = load_checkpoint(tmp_path / "stopped.safetensors", KIND)
    assert bool(torch.isnan(tensors["critic.first.0.bias"][0])) and int(tensors["updates"]) == 2
    assert "nan" in json.loads((tmp_path / "summary.json").read_text())["stopped"]
    good, _ = load_checkpoint(tmp_path / "checkpoint.safetensors", KIND)
    assert all(bool(torch.isfinite(value.double()).all()) for value in good.values())
    assert announced(tmp_path, toy_cell.TASK).version == 1


@pytest.mark.parametrize("who", ["critic", "actor"])
def test_from_the_state_of_a_stop_the_same_batch_is_drawn_again(tmp_path: Path, who: str) -> None:
    toy_cell.start(tmp_path, SETTINGS, 30)
    training = trained(tmp_path, 2)
    with torch.no_grad():
        part = {"critic": "first.0.bias", "actor": "head.0.bias"}[who]
        getattr(training.learner, who).get_parameter(part)[0] = math.nan
    assert training.due()
    before = training.learner.state()
    with pytest.raises(SolveError, match=f"update 2: the {who}'s loss is nan"):
        training.step()
    saved, _ = load_checkpoint(tmp_path / "stopped.safetensors", KIND)
    assert saved.keys() == before.keys()
    for name, value in saved.items():  # no weight was changed, and the generator is as it was
        assert torch.equal(value.nan_to_num(7.0), before[name].nan_to_num(7.0)), name


def test_what_is_corrupt_or_foreign_is_refused(tmp_path: Path) -> None:
    toy_cell.start(tmp_path, SETTINGS, 30)
    trained(tmp_path, 2).save()
    other = replace(SETTINGS, learner=replace(LEARNER, gamma=0.5))
    with pytest.raises(InputError, match="asked for is"):
        toy_cell.training(tmp_path, other)
    with pytest.raises(InputError, match="another"):
        announced(tmp_path, "needle_threading")
    checkpoint = tmp_path / "checkpoint.safetensors"
    whole = checkpoint.read_bytes()
    weights = Path(announced(tmp_path, toy_cell.TASK).file).read_bytes()
    for bad in (b"", whole[:-9], b"\x80\x04pickle", weights):
        checkpoint.write_bytes(bad)
        with pytest.raises(InputError, match="checkpoint"):
            toy_cell.training(tmp_path, SETTINGS)
    checkpoint.write_bytes(whole)
    for bad in ("", "[1]", '{"version": 1}'):
        (tmp_path / "announced.json").write_text(bad)
        with pytest.raises(InputError, match="announced"):
            announced(tmp_path, toy_cell.TASK)


def test_it_keeps_to_its_share_and_stops_when_told(tmp_path: Path) -> None:
    settings = replace(SETTINGS, cpu_share=0.2, publish_every=1000)
    toy_cell.start(tmp_path, settings, 30)
    training = toy_cell.training(tmp_path, settings)
    began, used = time.monotonic(), time.process_time()
    training.run(lambda: training.updates >= 4)
    # The share is of time that passes; how fast the machine is does not matter.
    assert time.process_time() - used <= 0.3 * (time.monotonic() - began) + 0.2
    assert (tmp_path / "checkpoint.safetensors").is_file()


@pytest.mark.parametrize(
    "bad", [{"capacity": 0}, {"first_steps": 0}, {"publish_every": 0}, {"cpu_share": 0.0}, {"cpu_share": 1.5}]
)
def test_settings_out_of_range_are_refused(bad: dict) -> None:
    with pytest.raises(InputError, match=next(iter(bad))):
        replace(SETTINGS, **bad)


def test_files_of_earlier_versions_go_on(tmp_path: Path) -> None:
    """A checkpoint and weights with the names that settings and tensors had then."""
    toy_cell.start(tmp_path, SETTINGS, 30)
    whole = trained(tmp_path, 4)
    path = tmp_path / "checkpoint.safetensors"
    tensors, about = load_checkpoint(path, KIND)
    assert "keep_prob" in tensors
    about["learner"] = {
        "limit": 0.003,
        "gamma": 0.97,
        "n_step": 1,
        "batch": 4,
        "critic_rate": 3e-4,
        "actor_rate": 6e-5,
        "episodes_per_feature": 4.0,
        "blur": 0.1,
        "average": 0.01,
        "target_noise": 0.2,
        "target_noise_clip": 0.5,
        "effort": 0.1,
        "behaviour": 1.0,
        "few_episodes": 25.0,
        "delay": 1,
        "warm_up": 1,
        "max_gradient": 10.0,
    }
    tensors["seen"] = tensors.pop("keep_prob")
    save_checkpoint(path, KIND, tensors, about)
    again = toy_cell.training(tmp_path, SETTINGS)
    assert again.updates == 4
    mine, other = whole.learner.state(), again.learner.state()
    assert mine.keys() == other.keys() and all(torch.equal(mine[name], other[name]) for name in mine)


def test_settings_of_a_worker_name_their_learner(tmp_path: Path) -> None:
    worker.write_settings(tmp_path, SETTINGS)
    assert json.loads((tmp_path / "settings.json").read_text())["learner"]["name"] == "td3"
    assert worker.read_settings(tmp_path) == SETTINGS
    (tmp_path / "settings.json").write_text('{"learner": {"name": "luck"}}')
    with pytest.raises(InputError, match="learner is 'luck', must be one of: td3"):
        worker.read_settings(tmp_path)
