"""Readings against a reference: depth against planes, stamps against another clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.kinds.readings.readings import split_readings
from samrl_core.diagnosis.residuals.readings.depth_pattern import find_depth_pattern
from samrl_core.diagnosis.residuals.readings.time_pattern import find_time_pattern
from samrl_core.diagnosis.result import Diagnosis
from samrl_ros.log_import.formulas import evaluate

NOISE_M, JITTER_S = 0.0015, 0.0004  # of depth at 1 m, of a stamp


def depth(
    scale: float = 0.0,
    offset: float = 0.0,
    square: float = 0.0,
    near: float = 0.3,
    far: float = 1.6,
    seed: int = 0,
) -> ReadingRecording:
    rng = np.random.default_rng(seed)
    true = np.repeat(np.linspace(near, far, 10), 40)
    read = (1.0 + scale) * true + offset + square * true**2
    read = read + NOISE_M * true**2 * rng.standard_normal(len(true))
    read[rng.choice(len(true), 6, replace=False)] += 0.4  # flying pixels
    return ReadingRecording(
        "wall", "made", f"{seed:064x}", "depth", "camera", np.arange(400) / 30, read, true
    )


def zones(swing: float = 0.0, mistaken: float = 0.0, scale: float = 0.0, seed: int = 0) -> ReadingRecording:
    """Twenty readings of a coarse sensor at each of twelve distances, one of which may be stated wrongly."""
    rng = np.random.default_rng(seed)
    true = np.repeat(np.linspace(0.3, 1.6, 12), 20)
    read = true + swing * np.sin(2 * np.pi * true / 0.38) + 0.004 * rng.standard_normal(len(true))
    read += scale * true
    true[60:80] += mistaken
    time = np.arange(len(true)) / 15
    return ReadingRecording("zone", "made", f"{seed:064x}", "depth", "tof", time, read, true)


def stamps(
    offset: float = 0.0, drift: float = 0.0, step: float = 0.0, seconds: float = 600.0, seed: int = 0
) -> ReadingRecording:
    rng = np.random.default_rng(seed)
    true = 1.7e9 + np.arange(0.0, seconds, 0.5)
    since = true - true[0]
    read = true + offset + drift * since + step * (since > 0.3 * seconds)
    read = read + JITTER_S * rng.standard_normal(len(true))
    return ReadingRecording("clock", "made", f"{seed:064x}", "stamp", "camera", since, read, true)


def told(recording: ReadingRecording) -> Diagnosis:
    fit, held_out = split_readings(recording)
    return diagnose([fit], [held_out])[0]


@pytest.mark.parametrize("seed", range(4))
def test_sensors_within_tolerances_have_no_gap(seed: int) -> None:
    assert told(depth(scale=2e-4, offset=-3e-4, seed=seed)).verdict == "no_gap"
    assert told(stamps(offset=3e-4, seed=seed)).verdict == "no_gap"


def test_depth_that_swings_below_the_noise_of_a_reading_is_no_depth_without_a_gap() -> None:
    """Twice the noise of a reading, it was within it; the median of twenty has a quarter of that."""
    assert told(zones(swing=0.008)).verdict == "none_of_mine"
    assert "no factor, offset and square" in find_depth_pattern([zones(swing=0.008)])
    for seed in range(20):
        assert not find_depth_pattern([zones(seed=seed)])
    assert not find_depth_pattern([zones(mistaken=0.03)])  # a distance that was mistyped


def test_a_factor_of_depth_is_named_though_depth_swings_a_little_beside_it() -> None:
    """The swing is sure, and 3 % of what depth is off by."""
    d = told(zones(scale=0.03, swing=0.008))
    assert d.verdict == "effect" and d.effects[0].name == "depth_scale@sensor:tof"


def test_planes_that_stand_where_a_tape_says_to_a_millimetre_show_no_pattern() -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        taped = np.repeat(np.linspace(0.4, 2.0, 12), 1000)
        stood = taped + np.repeat(1e-3 * rng.standard_normal(12), 1000)
        read = stood + NOISE_M * stood**2 * rng.standard_normal(len(taped))
        time = np.arange(len(taped)) / 15
        wall = ReadingRecording("wall", "made", f"{seed:064x}", "depth", "camera", time, read, taped)
        assert not find_depth_pattern([wall])


@pytest.mark.parametrize("scale", [0.01, -0.02, 0.005])
def test_a_factor_of_depth_is_named(scale: float) -> None:
    d = told(depth(scale=scale))
    assert d.verdict == "effect" and d.effects[0].name == "depth_scale@sensor:camera"
    found = d.effects[0].parameters["a"]
    assert found.ci95[0] < scale < found.ci95[1] and abs(found.value - scale) < 1.5e-3
    assert d.gap is not None and d.gap.shrink is not None and d.gap.shrink > 0.2


def test_depth_that_bends_is_named_by_its_square() -> None:
    d = told(depth(square=0.015))
    assert d.verdict == "effect" and d.effects[0].name == "depth_scale@sensor:camera"
    assert abs(d.effects[0].parameters["c"].value - 0.015) < 3e-3


def test_at_one_distance_a_factor_and_a_place_are_one_and_the_next_recording_splits_them() -> None:
    d = told(depth(scale=0.02, near=0.6, far=0.6))
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"depth_scale@sensor:camera", "hand_eye@sensor:camera"}
    assert d.next_experiment is not None and d.next_experiment.separates > 0.9


def test_an_offset_of_depth_and_the_cameras_place_are_one_at_any_distance() -> None:
    d = told(depth(offset=0.008))
    assert d.verdict == "ambiguous" and d.next_experiment is None
    assert any("no recording of these readings splits" in reason for reason in d.reasons)


@pytest.mark.parametrize("seed", range(2))
def test_in_a_narrow_range_an_offset_of_depth_is_no_camera_that_moved_for_sure(seed: int) -> None:
    """Nothing tells a factor there: a formula that has one, too, is no less the cause."""
    rng = np.random.default_rng(seed)
    true = np.repeat([0.1, 0.105, 0.11, 0.115], 30)
    read = true + 0.019 + np.round(0.005 * rng.standard_normal(len(true)), 3)
    d = told(ReadingRecording("near", "made", f"{seed:064x}", "depth", "lidar", np.arange(120.0), read, true))
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"depth_scale@sensor:lidar", "hand_eye@sensor:lidar"}


def test_a_constant_offset_of_stamps_is_latency_or_clock() -> None:
    d = told(stamps(offset=0.03))
    assert d.verdict == "ambiguous" and d.next_experiment is None
    assert set(d.ambiguity_set[0]) == {"camera_latency@sensor:camera", "clock_offset@sensor:camera"}


@pytest.mark.parametrize("offset, drift", [(-0.02, 0.0), (0.01, 3e-5), (0.0, -4e-5), (17.0, 0.0)])
def test_early_stamps_and_drifts_are_the_clocks(offset: float, drift: float) -> None:
    d = told(stamps(offset=offset, drift=drift))
    assert d.verdict == "effect" and d.effects[0].name == "clock_offset@sensor:camera"
    for name, true, within in (("o", offset, 1e-3), ("drift", drift, 3e-6)):
        if name in d.effects[0].parameters:
            assert abs(d.effects[0].parameters[name].value - true) < within
        else:
            assert true == 0.0


def visited(warms: float, scale: float = 0.0, seed: int = 0, rounds: int = 5) -> ReadingRecording:
    """A wall at four distances, put up anew by tape for each visit, while a factor of the depth warms up."""
    rng = np.random.default_rng(seed)
    stood = np.concatenate([rng.permutation([0.5, 0.75, 1.0, 1.3]) for _ in range(rounds)])
    off = 3e-4 * rng.standard_normal(len(stood))
    time = np.repeat(30.0 * np.arange(len(stood)), 30) + np.tile(np.arange(30) / 30, len(stood))
    true, tape = np.repeat(stood, 30), np.repeat(off, 30)
    factor = 1.0 + scale + warms * (1.0 - np.exp(-time / 300.0))
    read = factor * (true + tape) + NOISE_M * true**2 * rng.standard_normal(len(true))
    return ReadingRecording("warm", "made", f"{seed:064x}", "depth", "camera", time, read, true)


@pytest.mark.parametrize("warms", [0.008, -0.012])
def test_depth_that_changes_with_time_is_no_factor(warms: float) -> None:
    """A sensor that warmed up was a factor, an offset and a square, with a held-out gap hardly smaller."""
    d = told(visited(warms))
    assert d.verdict == "none_of_mine"
    assert any("with time alone" in reason for reason in d.reasons)


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.thorough) for s in (1, 2))])
def test_a_factor_at_distances_that_repeat_is_still_named(seed: int) -> None:
    d = told(visited(0.0, scale=0.01, seed=seed))
    assert d.verdict == "effect" and d.effects[0].name == "depth_scale@sensor:camera"


def test_what_follows_from_time_is_not_found_in_noise_or_in_sweeps() -> None:
    """Whatever the tape was off by, how long a plane stood, and where depth grows with time."""
    for seed in range(10):
        assert not find_time_pattern([visited(0.0, seed=seed)])
        assert not find_time_pattern([visited(0.0, seed=seed, rounds=1)])
        assert not find_time_pattern([depth(square=0.01, seed=seed)])
    assert find_time_pattern([visited(0.005)])


@pytest.mark.parametrize("scale", [0.0, 0.01])
def test_the_wall_behind_a_board_tells_nothing_of_the_depth(scale: float) -> None:
    """A board that fills half of the image: far off, the plane that most pixels are on is the wall's."""
    board = depth(scale=scale)
    read = board.reading.copy()
    behind = (board.reference > 1.3) & (np.arange(len(read)) % 4 > 0)
    read[behind] = 2.4 + 0.002 * np.random.default_rng(1).standard_normal(int(behind.sum()))
    d = told(replace(board, reading=read))
    assert d.verdict == ("effect" if scale else "no_gap"), d.reasons
    assert any("stand apart" in note for note in d.notes)


def test_a_clock_that_jumped_is_not_explained() -> None:
    assert told(stamps(step=0.05)).verdict == "none_of_mine"


def test_readings_that_cannot_be_used_are_refused() -> None:
    few = depth()
    with pytest.raises(InputError, match="at least 40"):
        split_readings(
            replace(few, time=few.time[:30], reading=few.reading[:30], reference=few.reference[:30])
        )
    with pytest.raises(InputError, match="must be > 0"):
        replace(few, reference=few.reference - 1.0)
    with pytest.raises(InputError, match="one sensor"):
        diagnose([few], [stamps()])


@pytest.mark.parametrize("offset, verdict", [(0.0, "no_gap"), (-0.02, "effect")])
def test_delays_with_long_tails_are_noise(offset: float, verdict: str) -> None:
    """A host that stamps messages at their arrival: delays are exponential, never negative."""
    rng = np.random.default_rng(3)
    true = 1.7e9 + np.arange(0.0, 30.0, 0.01)
    arrived = true + rng.exponential(2e-4, len(true))
    read = true + offset
    d = told(ReadingRecording("late", "made", "3" * 64, "stamp", "imu", true - true[0], read, arrived))
    assert d.verdict == verdict
    if offset:
        assert abs(d.effects[0].parameters["o"].value - offset) < 4e-4


def test_distances_that_a_ruler_gave_and_whole_millimetres_leave_an_offset_an_offset() -> None:
    """Seven planes, each 0.3 mm beside its stated distance, readings rounded to 1 mm."""
    rng = np.random.default_rng(100)
    stated = np.repeat([0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0], 60)
    true = stated + np.repeat(3e-4 * rng.standard_normal(7), 60)
    read = np.round(true + 0.009 + NOISE_M * true**2 * rng.standard_normal(len(true)), 3)
    d = told(
        ReadingRecording("planes", "made", "4" * 64, "depth", "camera", np.arange(420) / 30, read, stated)
    )
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"depth_scale@sensor:camera", "hand_eye@sensor:camera"}


def test_a_depth_that_swings_with_the_distance_is_not_explained() -> None:
    """A camera that times light: even noise, and an error of 8 mm with a period of 1.5 m."""
    rng = np.random.default_rng(5)
    true = np.repeat(np.arange(0.4, 3.0, 0.1), 20)
    read = true + 0.008 * np.sin(2 * np.pi * true / 1.5) + 0.002 * rng.standard_normal(len(true))
    d = told(
        ReadingRecording("tof", "made", "5" * 64, "depth", "camera", np.arange(len(true)) / 30, read, true)
    )
    assert d.verdict == "none_of_mine"


@pytest.mark.parametrize(
    "recording",
    [
        depth(scale=0.012),
        depth(scale=-0.015, offset=0.006),
        depth(square=0.015),
        stamps(drift=3e-5, offset=0.01),
    ],
    ids=["scale", "line", "square", "clock"],
)
def test_readings_corrected_by_the_formula_found_have_no_gap(recording: ReadingRecording) -> None:
    fit, held_out = split_readings(recording)
    found = diagnose([fit], [held_out])[1].correction
    assert isinstance(found, Recalibration) and not found.transforms
    (advice,) = found.statements
    formula = advice.says.partition("#")[0].strip()
    corrected = evaluate(formula, {"r": recording.reading}, "corrected")
    assert told(replace(recording, reading=corrected)).verdict == "no_gap"


def test_what_is_ambiguous_is_not_corrected() -> None:
    fit, held_out = split_readings(depth(offset=0.008))
    assert diagnose([fit], [held_out])[1].correction is None
