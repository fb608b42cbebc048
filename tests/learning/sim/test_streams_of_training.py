"""No two parts of a training draw from one stream: an evaluation must not begin where training data began."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION
from samrl_core.cell.robots.cells import cell_named
from samrl_core.learning.data.shards import DataInfo
from samrl_core.learning.sim import actor_episodes, episodes
from samrl_core.learning.sim.actor_episodes import ActorEpisodes
from samrl_core.learning.sim.episodes import EpisodeGroup
from tests.learning.sim.test_train import SMALL, TASK


def test_streams_differ(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    groups: list[EpisodeGroup] = []
    ends = {"success": np.zeros(1, dtype=bool), "actions": np.zeros(1, dtype=np.int64)}
    rows = {"values": np.zeros((1, 2)), "tip_in_base": np.zeros((1, 3)), "frames": np.zeros((1, 1, 12))}

    def noted(task: str, actor: Any, some: list[EpisodeGroup], *rest: Any) -> list[dict[str, np.ndarray]]:
        groups.extend(some)
        return [ends | rows for _ in some]

    first: list[float] = []

    def seen(model: Any, group: EpisodeGroup, rng: np.random.Generator) -> None:
        first.append(float(rng.random()))
        raise InterruptedError

    monkeypatch.setattr(actor_episodes, "run_cached_groups", noted)
    monkeypatch.setattr(ActorEpisodes, "_label", lambda *_: None)
    monkeypatch.setattr(episodes, "renderer_of", lambda *_: SimpleNamespace(model=MODEL, device="cpu"))
    monkeypatch.setattr(episodes, "begun", seen)
    randomising: Any = SimpleNamespace(distribution=None, correction=NO_CORRECTION)
    settings = replace(SMALL, episodes=64, round_episodes=8, judged=8)
    part = ActorEpisodes(TASK, tmp_path, settings, randomising, lambda stage, row: None)
    for k in range(2):
        part._make_round(k, ACTOR, tmp_path / "labelled.npz")
    part.for_q(ACTOR)
    part.evaluate(ACTOR)
    for group in groups:
        with pytest.raises(InterruptedError):
            episodes._run(TASK, episodes.SimActor(0.01).state_dict(), group, "cpu")
    lens = cell_named(settings.cell).intrinsics
    states = DataInfo("states", TASK, lens, settings.seed, 500, 10, {})
    first += [float(states.rng(shard).random()) for shard in range(states.shards)]
    assert len(first) == 2 * 4 + 32 + 8 + 50 == len(set(first))


MODEL: Any = SimpleNamespace(task=SimpleNamespace(action_limit=0.01))
ACTOR: Any = None
