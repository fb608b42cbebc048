"""A chain that no transforms close has a gap, though nothing is stated that it could contradict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.pose_recording import PoseRecording, PoseTolerances, PoseTrack
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.residuals.poses.seen_size import find_opening
from tests.diagnosis.poses.test_pose_diagnosis import PoseWorld, record

VIEWS = 20


def calibration(factor: float, noise_m: float, seed: int = 3) -> PoseRecording:
    """Pairs at rest as MoveIt's users save them: nothing stated, too few to hold any out."""
    whole = record(PoseWorld(at_rest=True, stated=False))
    every = len(whole.seen.time) // VIEWS
    time, seen, turned = (
        x[::every][:VIEWS] for x in (whole.seen.time, whole.seen.position, whole.seen.quat_xyzw)
    )
    noise = np.random.default_rng(seed).normal(0.0, noise_m, seen.shape)
    return replace(whole, seen=PoseTrack(time, factor * (seen + noise), turned))


@pytest.mark.parametrize(
    ("factor", "noise_m", "says"),
    [(1.0, 0.001, ""), (3.3, 0.002, "with a target of 0.30 times the size"), (1.0, 0.03, "limit 10.0 mm")],
    ids=["closed", "another size", "rough"],
)
def test_what_no_transforms_close_is_told(factor: float, noise_m: float, says: str) -> None:
    opening = find_opening(calibration(factor, noise_m))
    assert says in opening if says else not opening


def test_a_detector_that_is_stated_to_be_rough_may_be() -> None:
    rough = replace(calibration(1.0, 0.03), tolerances=PoseTolerances(detection_position=0.01))
    assert not find_opening(rough)
    stated = record(PoseWorld(at_rest=True))
    assert not find_opening(stated)  # of which every residual tells


def test_a_chain_that_stays_open_is_no_agreement() -> None:
    """Three of MoveIt's users' sets, open by 12 to 217 mm for a wrong tag size, had no gap."""
    found, _ = diagnose([calibration(3.3, 0.006)], [])
    assert found.verdict == "none_of_mine", found.reasons
    assert "no transforms close the chain" in found.reasons[0]
    assert diagnose([calibration(1.0, 0.001)], [])[0].verdict == "no_gap"
