"""Detections that stand apart: a detector's mistakes up to the half of them, or something that was moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording, PoseTrack
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.poses.poses import split_poses
from samrl_core.diagnosis.residuals.poses.noise import find_change
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis.poses.pose_worlds import NONE, SMALL, PoseWorld, record

VIEWS = 40


def _diagnosis(recording: PoseRecording) -> Diagnosis:
    fit, held_out = split_poses(recording)
    return diagnose([fit], [held_out], DiagnosisSettings())[0]


def _flipped(share: float, off: bool, seed: int) -> PoseRecording:
    """Pairs at rest; in a share of the views a square tag was seen by the other of its two solutions."""
    whole = record(PoseWorld(at_rest=True, camera_error=SMALL if off else NONE), seed)
    rng = np.random.default_rng(1000 + seed)
    quat = whole.seen.quat_xyzw.copy()
    for k in rng.choice(VIEWS, round(share * VIEWS), replace=False):
        turn = Rotation.from_euler("xy", rng.choice([-1, 1], 2) * rng.uniform(0.2, 0.8, 2))
        quat[k] = (Rotation.from_quat(quat[k]) * turn).as_quat()
    return replace(whole, seen=PoseTrack(whole.seen.time, whole.seen.position, quat))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("share", [0.2, 0.35, 0.42])
def test_up_to_the_half_may_be_mistakes(share: float, seed: int) -> None:
    assert _diagnosis(_flipped(share, False, seed)).verdict == "no_gap"
    named = _diagnosis(_flipped(share, True, seed))
    assert [effect.name for effect in named.effects] == ["hand_eye@sensor:camera"]


@pytest.mark.parametrize("share", [0.15, 0.25, 0.4])
def test_a_target_that_was_pushed_is_told_and_nothing_else_is_named(share: float) -> None:
    d = _diagnosis(record(PoseWorld(at_rest=True, moved_at=2.0 * VIEWS * (1.0 - share))))
    assert not d.effects  # a mean of both places would be a transform of nothing
    assert any("stand elsewhere than all others: the target was pushed" in note for note in d.notes)


def test_a_change_is_at_one_end() -> None:
    apart = np.zeros(20, dtype=bool)
    assert find_change(apart) is None
    apart[15:] = True
    assert find_change(apart) == (15, 20)
    assert find_change(apart[::-1]) == (0, 5)
    apart[16] = False  # one that happened to fit
    assert find_change(apart) == (15, 20)
    assert find_change(np.tile([False, True, False], 7)) is None
