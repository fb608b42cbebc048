"""Fig. 6: what it measures on maps worked out by hand, and one episode from beginning to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.policy.view.view_reach import ReachSettings, ViewReach, viewpoint_of
from samrl_core.studies.experiment import CASES, Options
from samrl_core.studies.paper import fig6
from samrl_core.studies.paper.expert_states import PHASES, expert_states
from samrl_core.studies.paper.view_maps import rank_correlation, reachable, regret, view_grid

MODEL = Model(task_named("peg_insertion"), cell_named())


def test_regret_and_correlation_of_small_maps() -> None:
    error = np.array([1.0, 2.0, 3.0, 5.0])
    assert rank_correlation(-(error**3), -error) == pytest.approx(1.0)
    assert rank_correlation(np.ones(4), -error) == 0.0
    assert regret(np.array([0.0, 1.0, 0.5, 0.2]), error) == pytest.approx((0.25, 7.0 / 16.0))
    assert regret(-error, error)[0] == 0.0


def test_the_grid_covers_the_region() -> None:
    region = MODEL.task.view_region()
    grid = view_grid(region, 5, 3)
    assert grid.shape == (3, 5) and grid.views.shape == (15, 6)
    for part, low_high in zip(grid.views.T, (region.azimuth, region.elevation), strict=False):
        assert (part.min(), part.max()) == pytest.approx(low_high)
    assert np.ptp(grid.views[:, 2]) == 0.0 and grid.views[0, 2] == pytest.approx(np.mean(region.distance))


def test_reachable_views_are_those_of_the_planner() -> None:
    """In the same order as the grid's: each place that the planner's own grid takes is found here too."""
    grid = view_grid(MODEL.task.view_region(), 4, 2)
    found = reachable(MODEL, grid)
    assert 0 < found.sum() < len(found)
    region = MODEL.task.view_region()
    planner = ViewReach(MODEL.cell, MODEL.task, ReachSettings(azimuths=4, elevations=2, distances=3))
    sites = [viewpoint_of(view.camera_in_world.position, region) for view in planner.views]
    taken = [p for p in sites if abs(p[2] - grid.views[0, 2]) < 1e-3]
    expected = [any(np.abs(p[:2] - v[:2]).max() < 1e-3 for p in taken) for v in grid.views]
    np.testing.assert_array_equal(found, expected)


def test_the_experts_episode_passes_the_sub_goals() -> None:
    states = expert_states(MODEL, 3)
    assert [state.phase for state in states] == list(PHASES)
    assert [state.sub_goal for state in states] == ["above", "above", "inserted"]
    steps = [state.step for state in states]
    assert steps == sorted(steps) and steps[0] > 0
    assert states[0].tip_in_base[2] > states[2].tip_in_base[2]
    with pytest.raises(InputError, match="phases"):
        expert_states(MODEL, 3, (1.0,))


@pytest.mark.slow
def test_one_episode_is_run_summed_up_and_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = Options(tmp_path, ("peg_insertion",), count=1, workers=1)
    summary = fig6.run(options, print, noise_samples=1, size=(3, 2))
    assert len((tmp_path / CASES).read_text().splitlines()) == 3
    whole = summary["tasks"]["peg_insertion"]["all"]
    assert whole["states"] == 3 and 0.1 < whole["error_mm"] < 10.0
    assert -1.0 <= whole["spearman"]["clean"]["median"] <= 1.0
    low, high = whole["spearman"]["noisy"]["interval95"]
    assert low <= whole["spearman"]["noisy"]["median"] <= high
    assert (tmp_path / "fig6.png").stat().st_size > 20_000
    monkeypatch.setattr(fig6, "view_maps", None)
    assert fig6.run(options, print, noise_samples=1, size=(3, 2)) == summary
