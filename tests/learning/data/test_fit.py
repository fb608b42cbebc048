"""The regression loop learns, goes on after a kill to the same weights, and stops where numbers end."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.data.checkpoint import load_checkpoint, save_checkpoint
from samrl_core.learning.data.fit import CHECKPOINT, LOG, STOPPED, FitSettings, fit
from samrl_core.learning.sim.regressions import (
    Q_LOSSES,
    Imitation,
    fit_actor,
    fit_q,
    likelihood,
    squared_error,
)
from samrl_core.policy.networks.networks import SensingQ, SimActor
from tests.learning import tiny
from tests.waiting import wait_for

pytestmark = pytest.mark.timeout(400)  # seconds on a free core, but cores may be shared

TOLERANCE = 0.0  # of a resumed training's weights on a CPU: bit by bit the same


TRAIN, VALIDATION = tiny.Spots(160, 1), tiny.Spots(32, 2)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a training that nobody interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    fit_actor(TRAIN, VALIDATION, tiny.LIMIT, tiny.SETTINGS, folder)
    return folder


def same_end(folder: Path, whole: Path) -> None:
    (a, about_a), (b, about_b) = (load_checkpoint(f / CHECKPOINT, "regression") for f in (folder, whole))
    assert about_a == about_b and a.keys() == b.keys()
    for name, value in a.items():
        assert float((value - b[name]).abs().max()) <= TOLERANCE, name
    assert (folder / LOG).read_text() == (whole / LOG).read_text()


@pytest.mark.slow
def test_an_actor_learns_where_the_spot_is(tmp_path: Path) -> None:
    seen = []
    settings = replace(tiny.SETTINGS, epochs=12)
    actor, result = fit_actor(TRAIN, VALIDATION, tiny.LIMIT, settings, tmp_path, seen.append)
    assert not actor.training and result.steps == 12 * 10
    assert tuple(seen) == result.rows and len(seen) == 12
    start = float(VALIDATION.action.norm(dim=1).mean()) * 1000  # of an actor that stands still [mm]
    assert result.figures["error_mm"] < 0.15 * start
    assert result.figures["near_error_mm"] < 0.15 * start
    assert result.figures["loss"] < 0.1 * result.rows[0]["loss"]
    with (tmp_path / LOG).open() as file:
        rows = list(csv.DictReader(file))
    assert [float(r["error_mm"]) for r in rows] == [r["error_mm"] for r in result.rows]


@pytest.mark.parametrize("loss", Q_LOSSES)
def test_a_q_learns_which_actions_succeed(tmp_path: Path, loss: str) -> None:
    network, result = fit_q(TRAIN, VALIDATION, replace(tiny.SETTINGS, epochs=8), tmp_path, loss=loss)
    assert result.figures["explained"] > 0.7
    assert result.figures["error"] < 0.2 and result.figures["error_where_high"] < 0.3
    batch = VALIDATION.batch(np.arange(32), torch.device("cpu"))
    with torch.no_grad():
        right = network(batch["image"], batch["action"]) > 0.5
    assert float((right == (batch["return_"] > 0.5)).float().mean()) > 0.9


@pytest.mark.slow
def test_killed_in_the_middle_it_ends_the_same(tmp_path: Path, whole: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    process = subprocess.Popen([sys.executable, tiny.__file__, str(tmp_path), "0.3"], env=environment)
    checkpoint = tmp_path / CHECKPOINT

    def is_under_way() -> bool:
        assert process.poll() is None, "it ended before its checkpoint"
        return checkpoint.exists() and load_checkpoint(checkpoint, "regression")[1]["step"] >= 13

    wait_for(is_under_way, "a checkpoint", 0.1)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    step = load_checkpoint(checkpoint, "regression")[1]["step"]
    assert 13 <= step < 40
    fit_actor(TRAIN, VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path)
    same_end(tmp_path, whole)


@pytest.mark.thorough
def test_stopped_within_an_epoch_it_ends_the_same(tmp_path: Path, whole: Path) -> None:
    class Ending(tiny.Spots):
        batches = 0

        def batch(self, indices, device):
            self.batches += 1
            if self.batches == 14:
                raise InterruptedError
            return super().batch(indices, device)

    with pytest.raises(InterruptedError):
        fit_actor(Ending(160, 1), VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path)
    assert load_checkpoint(tmp_path / CHECKPOINT, "regression")[1]["step"] == 12  # of 10 per epoch
    fit_actor(TRAIN, VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path)
    same_end(tmp_path, whole)


def test_what_is_done_is_not_done_again(whole: Path) -> None:
    calls = []

    class Counted(tiny.Spots):
        def batch(self, indices, device):
            calls.append(len(indices))
            return super().batch(indices, device)

    _, result = fit_actor(Counted(160, 1), VALIDATION, tiny.LIMIT, tiny.SETTINGS, whole)
    assert calls == [] and len(result.rows) == 4 and result.figures["error_mm"] > 0


def test_another_seed_is_another_training(tmp_path: Path, whole: Path) -> None:
    other, _ = fit_actor(TRAIN, VALIDATION, tiny.LIMIT, replace(tiny.SETTINGS, seed=4, epochs=1), tmp_path)
    same = load_checkpoint(whole / CHECKPOINT, "regression")[0]
    assert not torch.equal(other.state_dict()["head.0.weight"], same["network.head.0.weight"])


@pytest.mark.parametrize("change", [{"seed": 4}, {"epochs": 5}, {"learning_rate": 1e-3}])
def test_a_checkpoint_of_another_training_is_refused(whole: Path, change: dict) -> None:
    with pytest.raises(InputError, match=f"another training: {next(iter(change))} differ"):
        fit_actor(TRAIN, VALIDATION, tiny.LIMIT, replace(tiny.SETTINGS, **change), whole)


def test_other_samples_and_other_networks_are_refused(tmp_path: Path, whole: Path) -> None:
    with pytest.raises(InputError, match="train differ"):
        fit_actor(tiny.Spots(150, 1), VALIDATION, tiny.LIMIT, tiny.SETTINGS, whole)
    with pytest.raises(InputError, match="does not fit the network"):
        fit_q(TRAIN, VALIDATION, tiny.SETTINGS, whole)
    tensors, about = load_checkpoint(whole / CHECKPOINT, "regression")
    assert tensors["adam.0.exp_avg"].ndim == 4  # of the first convolution
    for changed, said, message in (
        ({"adam.0.exp_avg": torch.zeros(3)}, {}, "optimiser's state"),
        ({"adam.x.step": torch.zeros(())}, {}, "no state of an optimiser"),
        ({}, {"step": "x"}, "has an incomplete description"),
        ({}, {"identity": 3}, "has an incomplete description"),
    ):
        save_checkpoint(tmp_path / CHECKPOINT, "regression", {**tensors, **changed}, {**about, **said})
        with pytest.raises(InputError, match=message):
            fit_actor(TRAIN, VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path)
    (tmp_path / CHECKPOINT).write_bytes((whole / CHECKPOINT).read_bytes()[:-9])
    with pytest.raises(InputError, match="cannot read the checkpoint"):
        fit_actor(TRAIN, VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path)
    with pytest.raises(InputError, match="at least one batch"):
        fit_actor(tiny.Spots(15, 1), VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path / "new")


@pytest.mark.parametrize("which", ["actor", "q"])
def test_a_gradient_that_is_not_finite_stops_with_the_state_saved(tmp_path: Path, which: str) -> None:
    train = tiny.Spots(160, 1)
    train.action[77] = torch.nan
    with pytest.raises(SolveError, match=r"loss nan .*must be finite.*stopped\.safetensors"):
        if which == "actor":
            fit_actor(train, VALIDATION, tiny.LIMIT, tiny.SETTINGS, tmp_path)
        else:
            fit_q(train, VALIDATION, tiny.SETTINGS, tmp_path)
    tensors, about = load_checkpoint(tmp_path / STOPPED, "regression")
    assert 77 in about["indices"] and about["loss"] == "nan" and about["step"] < 10
    assert all(bool(torch.isfinite(value).all()) for value in tensors.values())  # from before the update
    assert not list(tmp_path.glob("*.half"))


def test_a_validation_loss_that_is_not_finite_stops_as_well(tmp_path: Path) -> None:
    """It would be left out of the mean, as a metric that does not apply to the sample."""
    validation = tiny.Spots(32, 2)
    validation.action[20] = torch.nan
    with pytest.raises(SolveError, match=r"1 validation samples .*sample 20 \(nan\).*stopped\.safetensors"):
        fit_actor(TRAIN, validation, tiny.LIMIT, tiny.SETTINGS, tmp_path)
    assert load_checkpoint(tmp_path / STOPPED, "regression")[1]["validation"] == [20]


def test_an_infinite_gradient_of_a_finite_loss_stops_as_well(tmp_path: Path) -> None:
    def steep(network, batch):
        out = network(batch["image"]).sum(dim=1)
        return {"loss": (out - out.detach()).abs().sqrt()}  # 0, and its slope there is not finite

    with pytest.raises(SolveError, match=r"loss 0\.0 and gradient norm (nan|inf)"):
        fit(SimActor(tiny.LIMIT), TRAIN, VALIDATION, steep, tiny.SETTINGS, tmp_path)
    assert (tmp_path / STOPPED).exists()


def test_short_actions_count_by_their_own_length() -> None:
    wanted = torch.tensor([[0.01, 0.0, 0.0], [0.0, 0.001, 0.0]])
    found = Imitation(0.01)(
        lambda image: wanted + torch.tensor([0.0, 0.0, 0.0005]),
        {
            "image": torch.zeros(2, 6, 8, 8),
            "action": wanted,
        },
    )
    torch.testing.assert_close(found["loss"], torch.tensor([0.25e-6 / 101e-6, 0.25e-6 / 2e-6]))
    torch.testing.assert_close(found["error_mm"], torch.tensor([0.5, 0.5]))
    assert bool(found["near_error_mm"][0].isnan()) and abs(float(found["near_error_mm"][1]) - 0.5) < 1e-5


def test_value_loss_is_the_squared_difference() -> None:
    batch = {
        "image": torch.zeros(3, 6, 8, 8),
        "action": torch.zeros(3, 3),
        "return_": torch.tensor([0, 0.9, 1]),
    }
    found = squared_error(lambda image, action: torch.full((3,), 0.4), batch)
    torch.testing.assert_close(found["loss"], torch.tensor([0.16, 0.25, 0.36]))
    assert found["error_where_low"].isnan().tolist() == [False, True, True]


def test_a_q_that_says_nothing_is_worth_anything_learns_by_likelihood() -> None:
    """By the squared error it has no slope left, which is how a training once ended with its first epoch."""
    q = SensingQ()
    last = [module for module in q.modules() if isinstance(module, torch.nn.Linear)][-1]
    with torch.no_grad():
        last.bias.fill_(-40.0)
    batch = {
        "image": torch.rand(4, 6, 32, 32, generator=torch.Generator().manual_seed(0)),
        "action": torch.zeros(4, 3),
        "return_": torch.tensor([0.0, 0.0, 0.1, 0.2]),
    }
    slopes = {}
    for name, objective in Q_LOSSES.items():
        q.zero_grad()
        objective(q, batch)["loss"].mean().backward()
        slopes[name] = float(last.bias.grad.abs())
    assert slopes["square"] < 1e-15 and abs(slopes["likelihood"] - 0.075) < 1e-6
    found = likelihood(q, batch)
    assert found["square"].tolist() == pytest.approx([0.0, 0.0, 0.01, 0.04])


def test_the_rate_rises_and_falls_to_nothing() -> None:
    settings = FitSettings(learning_rate=1.0, warm_up=0.1)
    rates = [settings.learning_rate_at(k, 100) for k in range(100)]
    assert rates[0] == 0.1 and max(rates) == rates[9] == 1.0 and 0 < rates[-1] < 1e-3
    assert all(b < a for a, b in zip(rates[10:], rates[11:], strict=False))


@pytest.mark.parametrize(
    "wrong",
    [
        {"epochs": 0},
        {"batch_size": 0},
        {"learning_rate": 0.0},
        {"learning_rate": float("nan")},
        {"warm_up": 1.0},
    ],
)
def test_settings_outside_their_limits_are_refused(wrong: dict) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        FitSettings(**wrong)


def test_a_missing_cuda_device_is_named() -> None:
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device")
    with pytest.raises(InputError, match="no CUDA device"):
        FitSettings(device="cuda")


def test_a_device_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="cuda:0"):
        FitSettings(device="gpu")
