"""`samrl train`: what its options become, and what it tells at the end. The training itself is another's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_ros.cli.commands import app
from samrl_ros.cli.learning import train as train_command


@pytest.mark.parametrize(("explained", "warned"), [(-0.01, True), (0.04, True), (0.4, False)])
def test_a_q_that_explains_nothing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, explained: float, warned: bool
) -> None:
    asked: list[TrainSettings] = []

    def train(task: str, folder: Path, settings: TrainSettings, *rest: Any) -> dict[str, Any]:
        asked.append(settings)
        return {"q": {"explained": explained}, "success": {"held": {"success": 0.5, "episodes": 4}}}

    monkeypatch.setattr(train_command, "train", train)
    monkeypatch.setattr(train_command, "write_picture", lambda *_: None)
    command = ["train", "peg_insertion", "--out", str(tmp_path), "--q-loss", "likelihood", "--q-epochs", "3"]
    command += ["--q-unit", "0.3"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0 and "held: 50.0 % of 4 episodes" in result.output
    assert asked[0].q_loss == "likelihood" and asked[0].q.epochs == 3 and asked[0].acted.unit == 0.3
    # What was asked for already is not advised.
    assert ("train it with a larger --q-unit, longer, or" in result.output) == warned
