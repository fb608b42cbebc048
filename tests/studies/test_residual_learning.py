"""What the residual's learner makes of some dozens of episodes, each of which looks like no other."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Play
from samrl_core.studies.paper.residual_evaluation import RunSettings, evaluated_file
from samrl_core.studies.paper.residual_run import ResidualRun
from tests.learning import toy_cell
from tests.learning.small_cell import SMALL
from tests.studies import far_correction, kinematic_peg

PLACE = EpisodeSite("toy", "optimised", None, (0.0, 0.0, 0.0))
POINTS = (0, 500, 1000, 2000, 3000)  # real steps
SEEDS = 6


def curve(folder: Path, seed: int, settings: RunSettings, play: Play) -> list[float]:
    """Success of the weights that a training keeps at each of its points."""
    one = ResidualRun(folder, PLACE, SMALL, toy_cell.ENCODER, seed, settings, play)
    found = []
    for steps in settings.points:
        one.advance(steps)
        file = folder / f"steps_{steps}.safetensors"
        one.save_weights(file)
        judged, _ = evaluated_file(play, PLACE, seed, settings, file, SMALL)
        found.append(float(np.mean(judged.successes)))
    one.close()
    print(seed, found, flush=True)
    return found


@pytest.mark.slow
@pytest.mark.timeout(6000)  # 80 s per seed, on a machine that may be busy
@pytest.mark.parametrize(("seeds", "spoilt"), [(range(SEEDS), 0.0), ((1, 3), 0.3)])
def test_a_correction_is_found_and_kept(tmp_path: Path, seeds: Sequence[int], spoilt: float) -> None:
    """A hole that is off by 2.2 +- 0.5 mm, also where a share of the episodes fails for no reason. Where
    updates see whole features, and leaving what was tried costs nothing, this leads nowhere: see
    msgs_docs/results/residual.md.
    """
    play = partial(kinematic_peg.play, spoilt=spoilt)
    settings = RunSettings(POINTS, evaluated=40)
    curves = [curve(tmp_path / str(seed), seed, settings, play) for seed in seeds]
    mean = np.mean(curves, axis=0)
    print(mean)
    assert mean[0] < 0.5 and mean[-1] > 0.85  # measured: 0.37 ... 0.99; spoilt 0.39 ... 0.94
    assert all(one[-1] > one[0] for one in curves)


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_a_correction_far_off_is_found_too(tmp_path: Path) -> None:
    """About 2.5 mm from none. At the full price for leaving what was tried, all along, it is not."""
    settings = RunSettings((0, 3000, 6000, 8000), evaluated=40)
    curves = [curve(tmp_path / str(seed), seed, settings, far_correction.play) for seed in (0, 1)]
    mean = np.mean(curves, axis=0)
    assert mean[0] < 0.5 and mean[-1] > mean[0] + 0.15  # measured: 0.40, 0.52, 0.71, 0.71
