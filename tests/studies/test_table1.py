"""Table I on few steps with networks that know nothing: all conditions run, and go on where they stopped."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.networks import SensingQ, SimActor
from samrl_core.policy.networks.weights import WeightsInfo, save_weights, weights_name
from samrl_core.policy.view.view_reach import ReachSettings
from samrl_core.policy.view.view_search import ViewAscentSettings
from samrl_core.studies.experiment import CASES, Options
from samrl_core.studies.paper.table1.episodes import CONDITIONS, TEST, Group, run_group
from samrl_core.studies.paper.table1.table1 import EXPERIMENT, TableSettings, run_table

TASK = "peg_insertion"
SMALL = TableSettings(
    views=ViewAscentSettings(
        ReachSettings(azimuths=7, elevations=1, distances=1),
        initial_views=2,
        starts=1,
        steps=1,
        min_gain=-1.0,
    ),
    episodes=2,
    few_share=0.5,
    side_by_side=3,
    oracle_views=2,
    first=1,
    finalists=1,
    more=1,
    max_actions=3,
)
TABLE = replace(EXPERIMENT, run=lambda options, tell: run_table(options, tell, SMALL))


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    """Two trainings of one task."""
    folder = tmp_path / "weights"
    for seed in (1, 2):
        generator = torch.Generator().manual_seed(seed)
        for kind, network in (("sim_actor", SimActor(0.01, generator)), ("sensing_q", SensingQ(generator))):
            info = WeightsInfo(kind, TASK, cell_named().intrinsics, 0.01, seed)
            path = folder / f"seed-{seed}" / weights_name(TASK, kind)
            path.parent.mkdir(parents=True, exist_ok=True)
            save_weights(path, network, info)
    return folder


@pytest.mark.slow
def test_all_conditions_run_and_go_on_where_they_stopped(tmp_path: Path, weights: Path) -> None:
    options = Options(tmp_path / "out", (TASK,), seed=3, weights=weights, workers=1)
    told: list[str] = []
    summary = TABLE.result(options, told.append)
    for noise in ("clean", "noisy"):
        row = summary["tasks"][TASK][noise]
        assert list(row["conditions"]) == list(CONDITIONS)
        trials = {name: of["success"]["trials"] for name, of in row["conditions"].items()}
        assert trials["active"] == trials["best_fixed"] == 4 and trials["oracle"] == 2  # of two trainings
        # Nothing is inserted in three actions; the start view needs no motion, the others some.
        assert all(of["success"]["successes"] == 0 for of in row["conditions"].values())
        assert row["conditions"]["fixed"]["camera_s_per_episode"] == 0.0
        assert row["conditions"]["active"]["camera_s_per_episode"] > 0.1
        each, once = (row["conditions"][n] for n in ("random_each_step", "held_random"))
        assert each["camera_s_per_episode"] > once["camera_s_per_episode"] > 0.0
        assert row["active_against_best_fixed"]["p_paired"] == 1.0
        assert len(row["best_fixed_view"]) == 2
    assert (options.out / "table1.png").stat().st_size > 1000

    path = options.out / CASES
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-3]))
    again: list[str] = []
    assert TABLE.result(options, again.append) == summary
    assert len(again) == 3 and len(told) == len(lines)
    assert sorted(path.read_text().splitlines(keepends=True)) == sorted(lines)
    assert json.loads((options.out / "table1.json").read_text()) == json.loads(json.dumps(summary))


def test_missing_weights_are_named_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "seed-1").mkdir()
    options = Options(tmp_path / "out", (TASK,), weights=tmp_path, workers=1)
    with pytest.raises(InputError, match="seed-1.*peg_insertion_sim_actor"):
        TABLE.result(options, print)
    assert not (tmp_path / "out" / CASES).exists()


def test_an_episode_does_not_depend_on_its_neighbours(weights: Path) -> None:
    """Without noise: one after the other or side by side."""
    whole = Group(TASK, weights / "seed-1", False, "active", -1, 0, TEST, 0, 2, "cpu", SMALL)
    (together,) = run_group(whole)
    alone = [run_group(replace(whole, first=k, count=1))[0] for k in range(2)]
    np.testing.assert_allclose(together["camera_s"], [c["camera_s"][0] for c in alone], atol=1e-2)
    assert together["key"] == "peg_insertion/seed-1/clean/table/active/0-2"
