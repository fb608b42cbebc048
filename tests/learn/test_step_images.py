"""Batches from images that are kept are those from the replay, to half precision."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.errors import InputError
from samrl_core.learn.replay import End, Replay, ReplayInfo
from samrl_core.learn.step_images import StepImages
from samrl_core.learn.transitions import draw_batch, transitions_of
from tests.learn.small_cell import SMALL, random_step


def test_kept_images_give_the_batches_of_the_replay(tmp_path: Path) -> None:
    """Also of steps that came later; one that was not taken in is missed."""
    replay = Replay.write(tmp_path / "replay.bin", ReplayInfo("toy", SMALL.intrinsics, 200))
    rng = np.random.default_rng(0)

    def collect(episodes: range) -> None:
        for episode in episodes:
            last = [replay.append(random_step(rng, episode, step)) for step in range(5)][-1]
            replay.end_episode(last, End.SUCCESS if episode % 2 else End.FAILURE)

    kept = StepImages(replay, SMALL)
    collect(range(16))
    assert kept.take_in() == 80 and kept.take_in() == 0
    collect(range(16, 20))
    transitions = transitions_of(replay, 3, 0.9)
    with pytest.raises(InputError, match="take_in"):
        kept.batch(transitions, 64, torch.Generator().manual_seed(1))
    assert kept.take_in() == 20
    one = kept.batch(transitions, 64, torch.Generator().manual_seed(1))
    other = draw_batch(replay, transitions, SMALL, 64, torch.Generator().manual_seed(1))
    for name in ("nominal", "residual", "reward", "discount", "next_nominal"):
        assert torch.equal(getattr(one, name), getattr(other, name)), name
    assert one.image.dtype == torch.float32 and one.reward.any()
    for name in ("image", "next_image"):
        torch.testing.assert_close(getattr(one, name), getattr(other, name), atol=2e-3, rtol=1e-3)
