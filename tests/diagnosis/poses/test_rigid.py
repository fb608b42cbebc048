"""Twists of rigid transforms and of a chain against finite differences, and shifts of noisy tracks."""

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.chain import Chain, Constants
from tests.diagnosis.poses.pose_worlds import PoseWorld, record

STEP = 1e-6
IDENTITY = Pose.from_matrix(np.eye(4))


@pytest.mark.parametrize("angle", [0.0, 0.04, 0.06, 0.5, 2.0, 3.1])
def test_a_small_twist_behind_moves_the_logarithm_as_its_jacobian_says(angle: float):
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    twist = np.concatenate([rng.normal(size=3), angle * axis / np.linalg.norm(axis)])[None]
    steps = STEP * np.eye(6)
    ahead, behind = (
        np.concatenate([rigid.log(rigid.exp(twist) @ rigid.exp(sign * d)) for d in steps]) for sign in (1, -1)
    )
    assert rigid.inverse_jacobian(twist)[0] == pytest.approx((ahead - behind).T / (2 * STEP), abs=1e-6)


@pytest.fixture(scope="module")
def chain() -> Chain:
    recording = record(PoseWorld(seconds=4.0))
    return Chain(recording, Constants.stated(recording))


def test_offsets_of_the_clock_are_read_together_as_one_by_one(chain: Chain):
    offsets = np.array([-0.3, 0.0, 0.07])
    each = np.stack([chain.predicted((offset, offset)) for offset in offsets])
    assert chain.predicted_each(offsets) == pytest.approx(each, abs=1e-12)


@pytest.mark.parametrize("shift", [0.0, 0.11])
def test_constants_move_the_target_as_their_twists_say(chain: Chain, shift: float):
    kept = chain.constants
    for name, twists in chain.error_twists((shift, shift)).items():
        for twist, step in zip(twists, STEP * np.eye(6), strict=True):
            moved = []
            for sign in (1, -1):
                matrix = getattr(kept, name) @ rigid.exp(sign * step)[0]
                chain.constants = replace(kept, **{name: matrix})
                moved.append(chain.predicted((shift, shift)))
            found = rigid.log(moved[0] @ rigid.inverse(moved[1])) / (2 * STEP)
            assert twist == pytest.approx(found, abs=1e-6)
    chain.constants = kept


def test_a_shift_is_measured_from_the_constants_as_they_are(chain: Chain):
    kept = chain.constants
    before = chain.shift_twist((0.05, 0.05))
    chain.constants = replace(kept, camera=kept.camera @ rigid.exp(np.full(6, 0.1))[0])
    moved, still = (chain.predicted(shifts, smooth=True) for shifts in ((0.05, 0.05), (0.0, 0.0)))
    moved = rigid.log(moved @ rigid.inverse(still))
    assert chain.shift_twist((0.05, 0.05)) == pytest.approx(moved, abs=1e-12)
    assert np.abs(moved - before).max() > 1e-4
    chain.constants = kept


@pytest.mark.parametrize("shift", [-1 / 240, 1 / 240, 1 / 120])
def test_a_shift_takes_no_noise_off_a_track(shift: float):
    """Halfway between its stamps a spline of a track is less noisy than the track."""
    rng, time = np.random.default_rng(0), np.arange(0.0, 8.0, 1 / 120)
    moved = np.stack([0.2 * np.sin(2.0 * time), 0.1 * np.cos(3.0 * time), 0.5 + 0.0 * time], axis=1)
    noisy = moved + 2e-4 * rng.standard_normal(moved.shape)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    seen = PoseTrack(time, -moved, still)
    arm = ArmPoses("camera_arm", PoseTrack(time, noisy, still))
    recording = PoseRecording("run", "a test", "0" * 64, seen, arm, None, IDENTITY, IDENTITY, None)
    chain = Chain(recording, Constants.stated(recording))
    left = rigid.log(chain.seen @ rigid.inverse(chain.predicted()))[10:-10]
    shifted = chain.shift_twist((shift, 0.0))[10:-10]
    true = np.gradient(-moved, time, axis=0)[10:-10] * shift
    assert np.std((left - shifted)[:, :3] + true) > 0.95 * np.std(left[:, :3])
    assert shifted[:, :3] == pytest.approx(true, abs=6e-4)


def test_a_smoothed_track_is_the_motion_and_keeps_what_lies_beside_gaps():
    rng, time = np.random.default_rng(1), np.arange(0.0, 4.0, 1 / 60)
    time = np.delete(time, np.arange(100, 130))
    turn = 0.5 * np.sin(3.0 * time)
    quat = np.stack([0.0 * time, 0.0 * time, np.sin(0.5 * turn), np.cos(0.5 * turn)], axis=1)
    position = np.stack([0.3 * np.sin(2.0 * time), 0.0 * time, 0.0 * time], axis=1)
    signs = rng.choice([-1.0, 1.0], len(time))[:, None]
    exact = rigid.smoothed(PoseTrack(time, position, signs * quat))
    assert exact.position == pytest.approx(position, abs=2e-5)
    assert np.abs(np.sum(exact.quat_xyzw * quat, axis=1)) == pytest.approx(1.0, abs=1e-8)
    noisy = position + 1e-3 * rng.standard_normal(position.shape)
    smooth = rigid.smoothed(PoseTrack(time, noisy, quat)).position
    assert np.std((smooth - position)[10:90]) < 0.7e-3
    assert np.array_equal(smooth[98:102], noisy[98:102])
    slow = PoseTrack(time * 6.0, noisy, quat)
    assert rigid.smoothed(slow) is slow
