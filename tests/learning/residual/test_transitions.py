"""Features of a replay's steps: of what the camera saw, of what is there, and of the right encoder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import ArmReading, Frame, Observation
from samrl_core.common.errors import InputError
from samrl_core.learning.residual.replay import End, Replay, ReplayInfo
from samrl_core.learning.residual.transitions import (
    StepFeatures,
    encoder_sha256,
    nominal_encoder,
    transitions_of,
)
from samrl_core.policy.networks.network_image import CHANNELS, observed_image
from samrl_core.policy.networks.networks import Encoder
from tests.learning.small_cell import SMALL, random_step

ENCODER = Encoder(CHANNELS, torch.Generator().manual_seed(3)).requires_grad_(False)


def collect(replay: Replay, rng: np.random.Generator, episodes: range) -> None:
    for episode in episodes:
        last = [replay.append(random_step(rng, episode, step)) for step in range(5)][-1]
        replay.end_episode(last, End.SUCCESS if episode % 2 else End.FAILURE)


def test_a_batch_tells_what_the_camera_saw(tmp_path: Path) -> None:
    replay = Replay.write(tmp_path / "replay.bin", ReplayInfo("toy", SMALL.intrinsics, 20))
    steps = [random_step(np.random.default_rng(k), 0, k) for k in range(2)]
    replay.end_episode([replay.append(step) for step in steps][-1], End.SUCCESS)
    kept = StepFeatures(replay, SMALL, ENCODER)
    assert kept.add_new() == 2
    batch = kept.sample_batch(transitions_of(replay, 1, 0.9), 16, torch.Generator().manual_seed(0))
    reading = ArmReading(0, np.zeros(7), np.zeros(7), np.zeros(7))
    for step, reward in zip(steps, (0.0, 1.0), strict=True):
        frame = Frame(0, step.color, step.depth, np.zeros(step.depth.shape, np.uint8))
        camera = Camera(SMALL.intrinsics, step.camera_in_world)
        image = observed_image(Observation(frame, camera, reading, reading), step.tip_in_base, SMALL)
        nominal = torch.tensor(step.nominal).float()
        mine = [k for k in range(16) if torch.allclose(batch.nominal[k], nominal)]
        assert 0 < len(mine) < 16
        for k in mine:
            torch.testing.assert_close(batch.features[k], ENCODER(image[None])[0], atol=5e-3, rtol=1e-3)
            assert batch.reward[k] == reward and batch.discount[k] == pytest.approx(0.9 * (1 - reward))


def test_later_steps_are_taken_in_and_lost_ones_go(tmp_path: Path) -> None:
    """The same features whenever they were taken in, also where the ring's oldest steps are written over."""
    replay = Replay.write(tmp_path / "replay.bin", ReplayInfo("toy", SMALL.intrinsics, 50))
    rng = np.random.default_rng(0)
    kept = StepFeatures(replay, SMALL, ENCODER)
    assert kept.add_new() == 0
    collect(replay, rng, range(6))
    assert kept.add_new() == 30 and kept.add_new() == 0
    collect(replay, rng, range(6, 12))
    transitions = transitions_of(replay, 3, 0.9)
    with pytest.raises(InputError, match="add_new"):
        kept.sample_batch(transitions, 64, torch.Generator().manual_seed(1))
    assert kept.add_new() == 30 and len(kept._numbers) == 50
    afresh = StepFeatures(replay, SMALL, ENCODER)
    assert afresh.add_new() == 50
    one, other = (f.sample_batch(transitions, 64, torch.Generator().manual_seed(1)) for f in (kept, afresh))
    assert one.episodes == other.episodes == transitions.episodes == 10
    tensors = {name: value for name, value in vars(one).items() if name != "episodes"}
    assert all(torch.equal(value, vars(other)[name]) for name, value in tensors.items())
    assert one.reward.any() and one.features.std(dim=0).max() > 0


def test_the_nominal_policys_encoder_is_known_by_its_weights(tmp_path: Path) -> None:
    peg, again = (nominal_encoder("peg_insertion", cell_named()) for _ in range(2))
    variant = nominal_encoder("peg_insertion_occluded", cell_named())
    thread = nominal_encoder("needle_threading", cell_named())
    assert encoder_sha256(peg) == encoder_sha256(again) == encoder_sha256(variant) != encoder_sha256(thread)
    with pytest.raises(InputError, match="peg_insertion"):
        nominal_encoder("peg_insertion", cell_named(), tmp_path)
