"""Stamps that scatter: noise of views in motion, and neither a gap nor what hides one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.poses.poses import split_poses
from samrl_core.diagnosis.residuals.poses.even_stamps import even_stamps
from samrl_core.diagnosis.residuals.poses.noise import rounding, slow_level, stamp_jitter
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis.poses.pose_worlds import (
    CAMERA,
    NONE,
    SMALL,
    TARGET,
    PoseWorld,
    background,
    flange,
    track,
)

JITTER_S = 4e-4
SPEED = 3.0  # of a hand, over that of an arm
NOISE_M, NOISE_RAD = 6e-5, 3e-4  # of a large board, seen well


def stop_and_go(seed: int, error: np.ndarray = NONE, late: float = 0.0) -> PoseRecording:
    """A camera that an arm takes from view to view and holds there; its stamps scatter."""
    rng = np.random.default_rng(seed)
    knots = np.cumsum(np.tile([1.0, 0.8], 20)) - 1.0
    places = np.repeat(rng.uniform(-1.0, 1.0, (20, 6)) * [0.25, 0.25, 0.1, 0.4, 0.4, 0.7], 2, axis=0)
    path = PchipInterpolator(knots, places)

    def flange(time: np.ndarray) -> np.ndarray:
        at = path(time)
        out = np.tile(np.eye(4), (len(time), 1, 1))
        out[:, :3, :3] = (Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(at[:, 3:])).as_matrix()
        out[:, :3, 3] = [0.4, 0.0, 0.5] + at[:, :3]
        return out

    stamps = np.arange(0.0, knots[-1], 1 / 125)
    time = np.arange(0.3, knots[-1] - 0.3, 1 / 15)
    seen = np.linalg.inv(flange(time - late) @ CAMERA @ background(rng) @ error) @ TARGET @ background(rng)
    seen[:, :3, 3] += NOISE_M * rng.standard_normal((len(time), 3))
    turned = Rotation.from_rotvec(NOISE_RAD * rng.standard_normal((len(time), 3))).as_matrix()
    seen[:, :3, :3] = turned @ seen[:, :3, :3]
    scattered = stamps + JITTER_S * rng.standard_normal(len(stamps))
    return PoseRecording(
        "run", "made by a test", f"{seed:064x}", track(time, seen),
        ArmPoses("camera_arm", track(scattered, flange(stamps))), None,
        Pose.from_matrix(CAMERA), Pose.from_matrix(TARGET), None,
    )  # fmt: skip


def told(recording: PoseRecording) -> Diagnosis:
    fit, held_out = split_poses(recording)
    return diagnose([fit], [held_out], DiagnosisSettings())[0]


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(1, 7))
def test_stamps_that_scatter_are_no_gap(seed: int) -> None:
    """Views in motion were noisier than those at rest, which looked like a pattern beyond noise."""
    assert told(stop_and_go(seed)).verdict == "no_gap"


@pytest.mark.thorough
def test_stamps_that_scatter_hide_neither_a_mount_nor_a_delay() -> None:
    assert [e.family for e in told(stop_and_go(1, SMALL)).effects] == ["hand_eye"]
    late = told(stop_and_go(1, late=0.02))
    assert late.verdict == "ambiguous"
    assert set(late.ambiguity_set[0]) == {"camera_latency@sensor:camera", "clock_offset@arm:camera_arm"}


@pytest.mark.parametrize("jitter", [0.0, 5e-4, 2e-3])
def test_the_scatter_of_stamps_is_found_from_neighbours(jitter: float) -> None:
    """A delay that lasts is none of it."""
    rng = np.random.default_rng(2)
    rate = np.sin(0.7 * np.arange(600)[:, None] / 15 + np.arange(6)) * [0.5, 0.5, 0.3, 1.0, 1.0, 1.0]
    level = np.array([1e-4] * 3 + [3e-4] * 3)
    left = level * rng.standard_normal((600, 6)) + (0.001 + jitter * rng.standard_normal((600, 1))) * rate
    found = stamp_jitter(left, rate, level)
    assert found == pytest.approx(jitter, rel=0.4, abs=1e-9)


def two_trackers(seed: int, decimal: float = 0.01, speed: float = SPEED) -> PoseRecording:
    """Trackers on one body at 33 Hz, each with noise of its own, whose stamps were rounded."""
    rng, tracks = np.random.default_rng(seed), []
    for begin in (0.0, 0.011):
        time = np.sort(begin + np.arange(0.3, 30.0, 0.0303) + 1e-3 * rng.standard_normal(981))
        poses = flange(speed * time + 40.0 * seed, PoseWorld())
        if begin:
            poses = np.linalg.inv(poses @ CAMERA) @ TARGET
        poses[:, :3, 3] += 7e-4 * rng.standard_normal((len(time), 3))
        poses[:, :3, :3] = (
            Rotation.from_rotvec(1.2e-3 * rng.standard_normal((len(time), 3))).as_matrix() @ poses[:, :3, :3]
        )
        rounded = np.round(time / decimal) * decimal
        kept = np.concatenate([[True], np.diff(rounded) > 0.5 * decimal])
        tracks.append(track(rounded[kept], poses[kept]))
    arm = ArmPoses("camera_arm", tracks[0])
    return PoseRecording("run", "made by a test", f"{seed:064x}", tracks[1], arm, None, None, None, None)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(4))
def test_rounded_stamps_of_two_trackers_are_no_gap(seed: int) -> None:
    """Neighbours share readings, rounding lasts over them, and a rate of the raw track takes off noise."""
    assert told(two_trackers(seed)).verdict == "no_gap"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
def test_rounded_stamps_of_fast_trackers_are_no_gap(seed: int) -> None:
    """At 3.5 rad/s a saw of 5 ms was a gap."""
    assert told(two_trackers(seed, speed=1.5 * SPEED)).verdict == "no_gap"


def test_stamps_of_an_even_rate_are_what_they_were_before_they_were_rounded() -> None:
    """A saw of 5 ms that lasts a second was taken for noise of neighbours: fast trackers had a gap."""
    rng = np.random.default_rng(2)
    count = np.flatnonzero(rng.random(1300) > 0.1)
    exact = 1.7e9 + 0.004 + count / 33.0 + 5e-4 * rng.standard_normal(len(count))
    rounded = np.round(exact, 2)
    assert np.std(rounded - exact) > 2.5e-3
    found = even_stamps(rounded)
    assert np.std(found - exact) < 7e-4 and abs(np.mean(found - exact)) < 3e-4
    # Of 60 Hz three remainders are known of 10 ms, of 50 Hz one: where they lie within it is not.
    for hertz in (60.0, 50.0):
        few = np.round(1.7e9 + 0.004 + count / hertz, 2)
        assert even_stamps(few) is few
    scattered = np.round(np.sort(exact + 5e-3 * rng.standard_normal(len(count))), 2)
    assert even_stamps(scattered) is scattered


def test_rounded_stamps_are_told_by_neighbouring_steps() -> None:
    rng = np.random.default_rng(1)
    exact = np.arange(0.0, 20.0, 0.0303)
    assert rounding(1.5e9 + np.round(exact, 2)) == pytest.approx(0.01 / np.sqrt(12.0))
    assert rounding(np.round(np.arange(0.0, 9.0, 1 / 60), 3)) == pytest.approx(1e-3 / np.sqrt(12.0))
    lost = np.arange(600)[rng.random(600) > 0.1]
    assert rounding(0.03 * lost) == 0.0  # an exact clock, of which poses are lost
    assert rounding(0.01 * lost) == 0.0  # steps of one decimal say nothing
    assert rounding(exact) == rounding(exact + 1e-3 * rng.standard_normal(len(exact))) == 0.0


def test_the_noise_beside_rounded_stamps_is_that_of_slow_views() -> None:
    """Of all views most are in motion: their median holds ten times the noise of any other kind."""
    rng = np.random.default_rng(3)
    rate = np.abs(np.sin(0.7 * np.arange(900)[:, None] / 33 + np.arange(6)))
    left = 1e-4 * rng.standard_normal((900, 6)) + 1e-3 * rng.standard_normal((900, 1)) * rate
    assert slow_level(left, rate, 1e-3) == pytest.approx(np.full(6, 1e-4), rel=0.6)
