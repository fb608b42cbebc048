"""A target's and a flange's poses by clocks that count from different moments, or are seconds apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.poses.clock_alignment import Alignment, align_clocks
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.pose_importer import poses_of

LENGTH_S = 24.0


def hand(time: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """A flange that turns and moves, slower and faster by turns."""
    phase = 0.7 * time + 1.5 * np.sin(0.31 * time)
    turn = np.column_stack([0.5 * np.sin(phase), 0.4 * np.cos(1.3 * phase), 0.6 * np.sin(0.7 * phase + 1.0)])
    place = np.column_stack(
        [0.4 + 0.1 * np.sin(phase), 0.1 * np.cos(0.9 * phase), 0.5 + 0.1 * np.sin(1.1 * phase)]
    )
    return place, Rotation.from_rotvec(turn)


def seen(time: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """A still target in the camera on that flange."""
    place, turn = hand(time)
    mount = Rotation.from_rotvec([0.1, -0.2, 1.4])
    camera = turn * mount
    target = np.array([0.5, 0.1, 0.0]) - place - turn.apply([0.03, -0.05, 0.07])
    return camera.inv().apply(target), camera.inv() * Rotation.from_rotvec([3.1, 0.0, 0.2])


def aligned(offset: float, rng: np.random.Generator) -> Alignment | None:
    """Of 30 Hz against 100 Hz, with noise, a gap, and mistaken poses."""
    time, own = np.arange(0.5, LENGTH_S - 1.0, 1 / 30), np.arange(0.0, LENGTH_S, 0.01)
    time = time[(time < 9.0) | (time > 11.0)]
    noise = rng.normal(0.0, 2e-3, (len(time), 3))
    noise[::50] = rng.normal(0.0, 0.8, (len(noise[::50]), 3))
    turns = (Rotation.from_rotvec(noise) * seen(time)[1]).as_quat()
    return align_clocks(time, turns, own - offset, hand(own)[1].as_quat())


@pytest.mark.parametrize("offset", [1.7e9 - 12.3, -3.217, 0.0])
def test_both_turn_alike_at_the_offset_of_their_clocks(offset: float) -> None:
    found = aligned(offset, np.random.default_rng(1))
    assert found is not None and abs(found.offset_s - offset) < 0.005 and found.correlation > 0.9
    assert found.is_clear == (offset != 0.0)


def test_what_turns_otherwise_has_no_offset() -> None:
    time = np.arange(0.0, LENGTH_S, 0.02)
    other = Rotation.from_rotvec(0.4 * np.sin(np.outer(time, [3.1, 2.3, 1.7]))).as_quat()
    found = align_clocks(time, hand(time)[1].as_quat(), time, other)
    assert found is None or not found.is_clear


def drafted(folder: Path, offset: float) -> Draft:
    """Two files of TUM's layout, of the flange by a clock that is `offset` behind."""
    time, own = np.arange(0.5, LENGTH_S - 1.0, 1 / 30), np.arange(0.0, LENGTH_S, 0.01)
    for name, stamps, (place, turn) in (
        ("tag_in_camera", 1.7e9 + time, seen(time)), ("robot_ee", 1.7e9 - offset + own, hand(own)),
    ):  # fmt: skip
        rows = np.column_stack([stamps, place, turn.as_quat()])
        np.savetxt(folder / f"{name}.txt", rows, fmt="%.6f", header="timestamp tx ty tz qx qy qz qw")
    return draft_any([folder], None, None)


def test_clocks_that_count_from_different_moments_are_laid_on_each_other(tmp_path: Path) -> None:
    """They were no poses of one target and one flange."""
    draft = drafted(tmp_path, 1.7e9 - 83.4)
    assert draft.closes_m < 0.01 and draft.tolerances == {"stamp": 0.05}
    assert draft.sources["flange"]["time"]["offset_s"] == pytest.approx(1.7e9 - 83.4, abs=0.005)
    assert not any("clock" in question for question in draft.questions)
    (one,) = poses_of(
        as_yaml(draft).partition("about:")[2].join(["about:", ""]), tmp_path / "m.yaml", tmp_path
    )
    assert one.recording.tolerances.stamp == 0.05


def test_clocks_that_are_seconds_apart_are_asked_for(tmp_path: Path) -> None:
    draft = drafted(tmp_path, 4.2)
    assert draft.sources["flange"]["time"]["offset_s"] == pytest.approx(4.2, abs=0.005)
    assert any("is one clock off by so much" in question for question in draft.questions)


def test_an_offset_that_the_diagnosis_finds_is_left_to_it(tmp_path: Path) -> None:
    draft = drafted(tmp_path, 0.4)
    assert "offset_s" not in draft.sources["flange"]["time"] and not draft.tolerances
