"""What lasts and is no effect: something that slipped while it was recorded, a lens whose model is off."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording, PoseTrack
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.poses.poses import split_poses
from samrl_core.diagnosis.residuals.poses.chain import Constants
from samrl_core.diagnosis.residuals.poses.image_pattern import find_image_pattern
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from samrl_core.diagnosis.residuals.poses.slip import find_slip
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis.poses.pose_worlds import SMALL, PoseWorld, matrix, record

SLIP = matrix((0.003, -0.002, 0.002), (0.005, -0.006, 0.004))
SECONDS = 12.0


def _diagnosis(recording: PoseRecording) -> Diagnosis:
    fit, held_out = split_poses(recording)
    return diagnose([fit], [held_out], DiagnosisSettings())[0]


def _trial(recording: PoseRecording) -> PoseTrial:
    return PoseTrial(recording, Constants.stated(recording))


def _slipped(at_s: float, seed: int = 1) -> PoseRecording:
    """The camera's mount gives way at a moment."""
    whole = record(PoseWorld(seconds=SECONDS), seed)
    before, after = whole, record(PoseWorld(seconds=SECONDS, camera_error=SLIP), seed)
    late = whole.seen.time > at_s
    pick = [
        np.where(late[:, None], b, a)
        for a, b in (
            (before.seen.position, after.seen.position),
            (before.seen.quat_xyzw, after.seen.quat_xyzw),
        )
    ]
    return replace(whole, seen=PoseTrack(whole.seen.time, *pick))


@pytest.mark.parametrize(  # fitted, where it is cut, held out
    "share",
    [
        pytest.param(0.501, marks=pytest.mark.thorough),
        0.69,
        pytest.param(0.85, marks=pytest.mark.thorough),
    ],
)
def test_a_mount_that_slips_is_no_agreement(share: float) -> None:
    d = _diagnosis(_slipped(share * SECONDS))
    assert d.verdict == "none_of_mine" and not d.effects
    (reason,) = [r for r in d.reasons if "the camera sits elsewhere" in r]
    since, far = (float(n) for n in re.findall(r"from ([\d.]+) s .*, by ([\d.]+) mm", reason)[0])
    assert abs(since - share * SECONDS) < 0.2 and 3.5 < far < 4.8  # of 4.1 mm


@pytest.mark.thorough
def test_mistakes_at_an_end_are_no_slip() -> None:
    whole = record(PoseWorld(seconds=SECONDS))
    rng, quat = np.random.default_rng(2), whole.seen.quat_xyzw.copy()
    last = slice(len(quat) - 12, None)
    quat[last] = (
        Rotation.from_quat(quat[last]) * Rotation.from_rotvec(rng.normal(0, 0.3, (12, 3)))
    ).as_quat()
    trial = _trial(replace(whole, seen=PoseTrack(whole.seen.time, whole.seen.position, quat)))
    assert trial.moved is not None and find_slip(trial) == ""
    assert _diagnosis(trial.recording).verdict == "no_gap"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_push_between_views_at_rest_shows_among_mistakes(seed: int) -> None:
    """Four of forty views by a wrong detection left more than the push did, and it passed as noise."""
    trial = _trial(record(PoseWorld(at_rest=True, moved_at=39.0, wrong_detections=4), seed))
    slip = find_slip(trial)
    assert "from 40 s (or row) on the target or a base sits elsewhere" in slip
    (turned,) = re.findall(r"and ([\d.]+) mrad", slip)
    assert 80.0 < float(turned) < 120.0  # of 100 mrad


def test_a_map_that_drifts_did_not_slip() -> None:
    """Half of what it drifts was told as a slip at half time."""
    whole = record(PoseWorld(at_rest=True))
    time = whole.seen.time
    turned = Rotation.from_rotvec(np.outer(time / time[-1], [0.0, 0.0, 0.08]))
    quat = (Rotation.from_quat(whole.seen.quat_xyzw) * turned).as_quat()
    slip = find_slip(_trial(replace(whole, seen=PoseTrack(time, whole.seen.position, quat))))
    assert "moves steadily as time passes" in slip
    (far,) = re.findall(r"and ([\d.]+) mrad", slip)
    assert 75.0 < float(far) < 85.0


@pytest.mark.parametrize(("count", "seed"), [(6, 1), (6, 2), (12, 22)])
def test_mistakes_in_views_at_rest_are_no_slip(count: int, seed: int) -> None:
    """Of twelve in forty, weights about a slip would keep those that fit one."""
    world = PoseWorld(at_rest=True, wrong_detections=count, camera_error=SMALL)
    assert find_slip(_trial(record(world, seed))) == ""


def _bent(size: float, seed: int = 1) -> PoseRecording:
    """Distances that are off by the place in the image, as by the tangential terms of a lens."""
    whole = record(PoseWorld(at_rest=True), seed)
    position = whole.seen.position.copy()
    u, v = position[:, 0] / position[:, 2], position[:, 1] / position[:, 2]
    position[:, 2] += size * (u * v + 3.0 * u**2)
    return replace(whole, seen=replace(whole.seen, position=position))


def test_what_a_lens_bends_is_no_noise() -> None:
    d = _diagnosis(_bent(0.03))
    assert d.verdict == "none_of_mine" and not d.effects
    assert "follows from where in the image the target stood" in d.reasons[0]


@pytest.mark.parametrize("seed", range(2, 12))
def test_noise_is_no_lens_and_no_slip(seed: int) -> None:
    trial = _trial(record(PoseWorld(at_rest=True), seed))
    assert find_image_pattern(trial) == "" and find_slip(trial) == ""


@pytest.mark.parametrize("lasts", [0.8, 0.97])
def test_noise_that_lasts_over_views_is_no_lens(lasts: float) -> None:
    whole = record(PoseWorld(seconds=SECONDS), 3)
    rng = np.random.default_rng(4)
    error = np.zeros((len(whole.seen), 3))
    for k in range(1, len(error)):
        error[k] = lasts * error[k - 1] + np.sqrt(1 - lasts**2) * 6e-4 * rng.standard_normal(3)
    seen = replace(whole.seen, position=whole.seen.position + error)
    assert find_image_pattern(_trial(replace(whole, seen=seen))) == ""
