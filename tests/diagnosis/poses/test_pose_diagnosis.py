"""Recorded poses: what is named, left open and refused, in worlds of SciPy and against Pinocchio."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording, PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.poses.poses import Poses, split_poses
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.noise import growth_power, leftover
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from samrl_core.diagnosis.residuals.poses.solve import solved
from samrl_core.diagnosis.result import Diagnosis
from samrl_core.diagnosis.verdict import rules
from tests.diagnosis.poses.pose_worlds import (
    CAMERA,
    SMALL,
    TARGET,
    PoseWorld,
    background,
    flange,
    record,
    record_two_arms,
)

TRUE_SIX = rigid.log(SMALL[None])[0]


@cache
def diagnosis(world: PoseWorld, library: tuple[str, ...] | None = None) -> Diagnosis:
    fit, held_out = split_poses(record(world))
    return diagnose([fit], [held_out], DiagnosisSettings(library=library))[0]


def six(d: Diagnosis) -> tuple[np.ndarray, np.ndarray]:
    """Values (6,) and intervals (6, 2)."""
    estimates = list(d.effects[0].parameters.values())
    return np.array([e.value for e in estimates]), np.array([e.ci95 for e in estimates])


@pytest.mark.parametrize("at_rest", [False, True])
def test_a_system_within_tolerances_has_no_gap(at_rest: bool) -> None:
    assert diagnosis(PoseWorld(at_rest=at_rest)).verdict == "no_gap"


@pytest.mark.parametrize("at_rest", [False, True])
@pytest.mark.parametrize(
    "link, name", [("camera", "hand_eye@sensor:camera"), ("target", "base_to_base@cell")]
)
def test_a_transform_that_is_off_is_named_with_its_size(link: str, name: str, at_rest: bool) -> None:
    d = diagnosis(PoseWorld(**{f"{link}_error": SMALL}, at_rest=at_rest))
    assert d.verdict == "effect" and d.effects[0].name == name and len(d.effects) == 1
    found, interval = six(d)
    assert np.all((interval[:, 0] < TRUE_SIX) & (interval[:, 1] > TRUE_SIX))
    # Within the tolerance that the world was drawn from.
    assert np.all(np.abs(found - TRUE_SIX) < [6e-4] * 3 + [1.2e-3] * 3)
    assert d.gap is not None and d.gap.shrink is not None and d.gap.shrink > 0.4


def test_a_late_camera_and_a_clock_are_one_and_no_name() -> None:
    d = diagnosis(PoseWorld(latency=0.04))
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"camera_latency@sensor:camera", "clock_offset@arm:camera_arm"}
    assert d.next_experiment is None  # one arm has one clock
    assert any("no recording of these devices splits" in reason for reason in d.reasons)
    (size,) = (e for name, e in d.effects[0].parameters.items() if name in ("T", "o"))
    assert abs(abs(size.value) - 0.04) < 0.002


@pytest.mark.parametrize("latency", [0.045, 0.12])
def test_a_delay_between_those_that_are_tried_is_as_long_as_it_is(latency: float) -> None:
    """No drift stands in for the rest of it, and nothing is made up beyond the ends of the arm's track."""
    d = diagnosis(PoseWorld(latency=latency, seconds=45.0))
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"camera_latency@sensor:camera", "clock_offset@arm:camera_arm"}
    size = d.effects[0].parameters["T"]
    assert size.ci95[0] < latency < size.ci95[1] and size.ci95[1] - size.ci95[0] < 0.012


def test_images_are_not_younger_than_their_stamps() -> None:
    d = diagnosis(PoseWorld(latency=-0.03))
    assert d.verdict == "effect" and d.effects[0].name == "clock_offset@arm:camera_arm"
    assert abs(d.effects[0].parameters["o"].value - 0.03) < 0.002


def test_clocks_that_drift_apart_are_told_from_latency() -> None:
    d = diagnosis(PoseWorld(latency=0.02, drift=6e-4, seconds=60.0))
    assert d.verdict == "effect" and d.effects[0].name == "clock_offset@arm:camera_arm"
    drift = d.effects[0].parameters["drift"]
    assert drift.ci95[0] < -6e-4 < drift.ci95[1] and abs(drift.value + 6e-4) < 1e-4


def test_a_still_camera_cannot_tell_itself_from_the_base() -> None:
    d = diagnosis(PoseWorld(camera_error=SMALL, moving=False))
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"hand_eye@sensor:camera", "base_to_base@cell"}
    assert d.next_experiment is not None and d.next_experiment.separates > 0.9
    assert d.next_experiment.programme["motion"] in ("views", "camera_arm")
    assert len(d.next_experiment.programme["flanges"]["camera_arm"]) >= 12


def test_a_late_camera_that_also_sits_elsewhere_is_both() -> None:
    d = diagnosis(PoseWorld(latency=-0.03, camera_error=SMALL))
    assert d.verdict == "effect"
    assert {e.name for e in d.effects} == {"clock_offset@arm:camera_arm", "hand_eye@sensor:camera"}
    offset = next(e for e in d.effects if e.family == "clock_offset").parameters["o"]
    assert abs(offset.value - 0.03) < 0.002


def test_a_target_of_another_size_is_named() -> None:
    d = diagnosis(PoseWorld(size_error=0.02))
    assert d.verdict == "effect" and d.effects[0].name == "object_geometry@body:target"
    assert abs(d.effects[0].parameters["s"].value - 0.02) < 0.002


@pytest.mark.parametrize("size_error", [1.0, -0.5, -0.75])
def test_a_size_that_was_typed_in_wrongly_is_a_size_and_no_calibration(size_error: float) -> None:
    d = diagnosis(PoseWorld(size_error=size_error))
    assert d.verdict == "effect" and [e.name for e in d.effects] == ["object_geometry@body:target"]
    s = d.effects[0].parameters["s"]
    assert abs(s.value - size_error) < 0.01 and s.ci95[0] < size_error < s.ci95[1]


def test_a_wrong_size_is_as_sure_as_the_views_are_where_no_transform_is_stated() -> None:
    """Transforms that nobody states could be nearly the same; the interval was half of the size."""
    s = diagnosis(PoseWorld(size_error=-0.08, at_rest=True, stated=False)).effects[0].parameters["s"]
    assert s.ci95[0] < -0.08 < s.ci95[1] and s.ci95[1] - s.ci95[0] < 0.016


def test_wrong_detections_are_noted_and_change_nothing() -> None:
    d = diagnosis(PoseWorld(camera_error=SMALL, wrong_detections=20))
    assert d.verdict == "effect" and d.effects[0].family == "hand_eye"
    assert any("stand apart" in note for note in d.notes)


def test_a_target_that_was_pushed_is_no_calibration() -> None:
    assert diagnosis(PoseWorld(moved_at=8.0)).verdict == "none_of_mine"


def test_a_family_that_is_withheld_is_not_replaced_by_another() -> None:
    d = diagnosis(PoseWorld(camera_error=SMALL), ("base_to_base", "clock_offset", "object_geometry"))
    assert d.verdict in ("none_of_mine", "no_gap")


@pytest.mark.thorough
def test_unknown_transforms_are_solved_and_time_is_still_told() -> None:
    world = PoseWorld(latency=0.06, stated=False)
    d = diagnosis(world)
    assert d.verdict == "ambiguous" and "camera_latency@sensor:camera" in d.ambiguity_set[0]
    assert "hand_eye" in d.not_testable and sum("is not stated" in note for note in d.notes) == 2
    assert diagnosis(PoseWorld(stated=False)).verdict == "no_gap"


def test_what_was_solved_is_told_once_where_held_out_halves_are_fitted_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rules, "only_held_out", lambda *_: True)
    fit, held_out = split_poses(record(PoseWorld(stated=False)), 0.5)
    d, _ = diagnose([fit], [held_out], DiagnosisSettings(library={"camera_latency"}))
    assert [i.role for i in d.inputs] == ["fit", "fit", "held_out"]
    assert sum("is not stated" in note for note in d.notes) == 2


def test_what_is_solved_is_what_pinocchio_and_scipy_find() -> None:
    """Pinocchio's transforms and logarithm under SciPy's minimiser; none of the chain's own geometry."""
    recording = record(PoseWorld(stated=False, at_rest=True))
    constants, _ = solved([recording])
    flanges = [pin.SE3(m) for m in flange(recording.seen.time, PoseWorld(at_rest=True))]
    seen = [
        pin.SE3(Rotation.from_quat(q).as_matrix(), p)
        for p, q in zip(recording.seen.position, recording.seen.quat_xyzw, strict=True)
    ]
    start = pin.SE3(CAMERA), pin.SE3(TARGET)

    def residual(x: np.ndarray) -> np.ndarray:
        camera, target = start[0] * pin.exp6(x[:6]), start[1] * pin.exp6(x[6:])
        pairs = zip(flanges, seen, strict=True)
        errors = [pin.log6(((f * camera).inverse() * target).actInv(s)) for f, s in pairs]
        return np.concatenate([e.vector * ([1.0] * 3 + [0.3] * 3) for e in errors])

    found = least_squares(residual, np.zeros(12)).x
    for name, truth, x in (("camera", start[0], found[:6]), ("base", start[1], found[6:])):
        reference = (truth * pin.exp6(x)).homogeneous
        difference = rigid.log((getattr(constants, name) @ np.linalg.inv(reference))[None])[0]
        assert np.all(np.abs(difference) < [1e-3] * 3 + [1.5e-3] * 3), name


def test_twists_of_the_chain_are_its_derivatives() -> None:
    """Columns against finite differences of the predicted pose, for every constant of the chain."""
    recording = record(PoseWorld())
    constants, _ = solved([recording])
    trial = PoseTrial(recording, constants)
    step, before = 1e-5, trial.chain.predicted()
    for name, twists in trial.links.items():
        for k in range(6):
            kept = getattr(constants, name).copy()
            getattr(constants, name)[:] = kept @ rigid.exp(step * np.eye(6)[k])[0]
            moved = rigid.log(trial.chain.predicted() @ rigid.inverse(before)) / step
            getattr(constants, name)[:] = kept
            assert np.allclose(moved, twists[k], atol=1e-4), f"{name} {k}"


def test_the_spread_of_estimates_is_near_the_bound_by_information() -> None:
    """Root mean square error over repeated noise against the Cramer-Rao bound of the same columns."""
    errors, bounds = [], []
    for seed in range(12):
        recording = record(PoseWorld(at_rest=True), seed)
        trial = PoseTrial(recording, solved([recording])[0])
        likelihood = Likelihood([trial])
        twists = np.concatenate([trial.links["camera"], trial.links["base"]])
        both = likelihood.regressors([trial.columns(twists)])
        information = likelihood.plain_gram(both, both)
        found = np.linalg.solve(information, likelihood.plain_moment(both))
        rng = np.random.default_rng(seed)
        true = [rigid.log(background(rng)[None])[0] for _ in range(2)]
        errors.append(found - np.concatenate(true))
        bounds.append(np.sqrt(np.diag(np.linalg.inv(information))))
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / np.mean(bounds, axis=0)
    assert 0.7 < float(np.sqrt(np.mean(ratio**2))) < 1.4


def test_poses_that_cannot_be_used_are_refused() -> None:
    recording = record(PoseWorld(at_rest=True))
    with pytest.raises(InputError, match="at least 16"):
        split_poses(_first(recording, 10))
    with pytest.raises(InputError, match="at least 6"):
        PoseTrial(_first(recording, 4), solved([recording])[0])
    seen = recording.seen
    with pytest.raises(InputError, match=r"position \d+ .* more than 1000 m; check the unit"):
        type(seen)(seen.time, seen.position * 1e6, seen.quat_xyzw)


def test_poses_that_change_without_bounds_are_refused() -> None:
    with pytest.raises(InputError, match=r"change by up to 1e\+160 m or rad; check the stamps"):
        leftover(np.ones((20, 6)), [np.full((20, 6), 1e160)], [1.0])


def test_what_moves_all_poses_alike_has_a_fit_even_where_rounding_hides_the_prior() -> None:
    column = 1e13 * np.ones((20, 6))
    assert np.abs(leftover(np.ones((20, 6)), [column, column], [1.0, 1.0])).max() < 1e-3


def _first(recording: PoseRecording, count: int) -> PoseRecording:
    seen = recording.seen
    return replace(
        recording, seen=type(seen)(seen.time[:count], seen.position[:count], seen.quat_xyzw[:count])
    )


@pytest.mark.thorough
def test_two_arms_tell_whose_clock_it_is() -> None:
    """With both arms in motion the camera's lateness and the tool arm's clock are two things."""
    fit, held_out = split_poses(record_two_arms(tool_clock=0.03))
    d = diagnose([fit], [held_out])[0]
    assert d.verdict == "effect" and d.effects[0].name == "clock_offset@arm:tool_arm"
    assert abs(d.effects[0].parameters["o"].value - 0.03) < 0.003


@pytest.mark.parametrize("place", ["joint:lift", "joint:bend"])
def test_an_encoder_offset_is_seen_by_the_camera(place: str) -> None:
    fit, held_out = split_poses(record_two_arms(encoder={place.partition(":")[2]: 0.008}))
    d = diagnose([fit], [held_out])[0]
    assert d.verdict == "effect" and d.effects[0].name == f"encoder_offset@{place}"
    found = d.effects[0].parameters["e"]
    assert found.ci95[0] < 0.008 < found.ci95[1] and abs(found.value - 0.008) < 5e-4


def test_a_transform_the_wrong_way_round_is_refused_with_what_poses_give() -> None:
    with pytest.raises(InputError, match="Look for an inverse") as caught:
        diagnosis(PoseWorld(inverse=True))
    x, y, z = re.findall(r"camera_in_flange is .*? position \[(.*?)\]", str(caught.value))[0].split(",")
    assert np.allclose([float(x), float(y), float(z)], CAMERA[:3, 3], atol=1.5e-3)


def test_recordings_of_other_devices_are_not_mixed() -> None:
    one = record(PoseWorld(at_rest=True))
    with pytest.raises(InputError, match="one\\s+camera"):
        diagnose([one], [replace(one, camera="another")])


def test_few_views_that_are_held_out_have_the_noise_of_the_many() -> None:
    """Of six views the constants take up nearly all: their own noise would make any residual dozens."""
    recording = replace(record(PoseWorld(at_rest=True)), camera_in_flange=None, base_in_base=None)
    seen = recording.seen
    kept = PoseTrack(seen.time[:27], seen.position[:27], seen.quat_xyzw[:27])
    fit, held_out = split_poses(replace(recording, seen=kept))
    (many,), (few,) = Poses().trials([fit], [held_out])
    assert isinstance(many, PoseTrial) and isinstance(few, PoseTrial) and len(held_out.seen) == 6
    assert np.all(few.noise.level >= many.noise.level)
    parts = [few.residual[c] / few.sigma[c] for c in few.channels]
    assert float(np.sqrt(np.mean(np.square(parts)))) < 2.0


@pytest.mark.parametrize("grown", [(0, 0, 0, 0, 0, 0), (1, 1, 2, 1, 1, 1), (0, 0, 2, 1, 1, 1)])
def test_noise_grows_with_the_distance_where_the_poses_show_it(grown: tuple[int, ...]) -> None:
    """A few wrong detections do not hide it, and even noise has no power in any of 20 draws."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        distance = np.exp(rng.uniform(np.log(0.25), np.log(1.2), 150))
        left = 1e-3 * rng.standard_normal((150, 6)) * distance[:, None] ** np.array(grown)
        left[:2] *= 20.0
        found = growth_power(left, distance)
        assert tuple(found > 0) == tuple(np.array(grown) > 0), (seed, found)
    assert not growth_power(left, np.full(150, 0.5)).any()


def test_rough_views_of_a_target_of_any_size_end_in_a_verdict() -> None:
    """Three calibrations of MoveIt's users ended in a division by zero: a size of twice its wide spread."""
    whole = record(PoseWorld(at_rest=True, stated=False))
    rng = np.random.default_rng(3)
    seen = whole.seen.position + rng.normal(0.0, 0.05, whole.seen.position.shape)
    rough = replace(whole, seen=PoseTrack(whole.seen.time, seen, whole.seen.quat_xyzw))
    fit, held_out = split_poses(rough)
    assert diagnose([fit], [held_out], DiagnosisSettings())[0].verdict in ("no_gap", "none_of_mine")
