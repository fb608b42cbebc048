"""The page `add_a_learner.md` as it stands: its learner is registered, trained and evaluated."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from samrl_core.learning.residual import learners
from samrl_core.learning.residual.training import ResidualTraining, TrainingSettings
from samrl_core.policy.networks.weights import load_weights
from samrl_core.studies.episodes.residual_episodes import EpisodeSite
from tests.guide.pages import blocks, module_of
from tests.learning import toy_cell
from tests.learning.residual.test_learners import hold_to_the_protocol
from tests.learning.small_cell import SMALL
from tests.studies import kinematic_peg

PAGE = "add_a_learner.md"
MODULE = "samrl_core.learning.residual.mean_of_successes"


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The page's Python blocks, the first two executed: the learner's file and its line."""
    python = [text for _, _, text in blocks(PAGE, "python")]
    module_of(MODULE, python[0], monkeypatch)
    monkeypatch.setattr(learners, "LEARNERS", dict(learners.LEARNERS))
    exec(python[1], {"LEARNERS": learners.LEARNERS})
    return python


def test_the_pages_learner_keeps_to_the_protocol(registered: list[str]) -> None:
    hold_to_the_protocol("mean_of_successes")


@pytest.mark.slow
def test_the_pages_learner_trains_and_is_evaluated_as_td3_is(registered: list[str], tmp_path: Path) -> None:
    """On a peg whose hole lies 2.2 mm aside: a constant residual helps."""
    names = {
        "folder": tmp_path / "run",
        "site": EpisodeSite("toy", "optimised", None, (0.0, 0.0, 0.0)),
        "cell": SMALL,
        "encoder": toy_cell.ENCODER,
        "play": kinematic_peg.play,
    }
    exec(registered[2], names)
    exec(registered[3], names)
    before, after = (sum(names[name].successes) for name in ("before", "after"))
    print(before, after)
    assert after > before + 6
    names["run"].save_weights(tmp_path / "w.safetensors")  # ty: ignore[not-callable]
    load_weights(tmp_path / "w.safetensors", "residual_actor", "toy", SMALL)


def test_the_pages_learner_trains_beside_the_cell(registered: list[str], tmp_path: Path) -> None:
    name = yaml.safe_load(blocks(PAGE, "yaml")[0][2])["/**/residual_trainer"]["ros__parameters"]["learner"]
    settings = TrainingSettings(learners.create_settings(name), capacity=100, first_steps=1, publish_every=2)
    toy_cell.start(tmp_path, settings, 40).close()
    training = ResidualTraining(tmp_path, toy_cell.TASK, SMALL, toy_cell.ENCODER, settings)
    while training.updates < 4:
        assert training.due()
        training.step()
    assert (tmp_path / "training.csv").read_text().startswith("update,steps,residual\n")
    training.save()
    again = ResidualTraining(tmp_path, toy_cell.TASK, SMALL, toy_cell.ENCODER, settings)
    assert again.updates == 4 and again.version == 2
