"""A lens that is off: what it does to outlines and depth, and large errors taken out before comparing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import find_lens_places
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.effects.images.lens_distortion import EFFECT
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2, prepared
from samrl_core.diagnosis.residuals.images.linearisation import rows_at, undistorted
from samrl_core.diagnosis.residuals.images.object_pose import solved_object
from samrl_core.diagnosis.residuals.images.rows import frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene


@pytest.mark.parametrize(
    ("name", "size"),
    [
        pytest.param("radial", (0.25, 0.0), marks=pytest.mark.thorough),
        pytest.param("focal", (0.02, -0.02), marks=pytest.mark.thorough),
        ("centre", (0.01, 0.01)),
    ],
)
def test_columns_are_what_a_lens_changes(
    recordings: list[ImageRecording], name: str, size: tuple[float, float]
) -> None:
    """Outlines before and after images are resampled, against the columns: size and sign."""
    scene = ImageScene(recordings[0], compared_size(recordings[0].intrinsics)[0])
    frames = chosen_frames(scene, recordings[0])
    pose = solved_object(scene, frames[:8], recordings[0].tolerances, DEPTH_NOISE_PER_Z2)
    seen, expected = [], []
    for frame in frames[::5]:
        taken_out = undistorted(scene, frame, {name: np.array(size)})
        before, after = (frame_rows(scene, f, pose, DEPTH_NOISE_PER_Z2)["mask"] for f in (frame, taken_out))
        if np.array_equal(before.tile, after.tile):
            seen.append(before.value - after.value)
            expected.append(np.array(size) @ before.columns[name])
    a, b = np.concatenate(seen), np.concatenate(expected)
    assert np.corrcoef(a, b)[0, 1] > 0.8
    assert 0.7 < (a @ b) / (b @ b) < 1.3


@pytest.mark.parametrize(("radial", "shift"), [((0.071, -0.395), 0.16), ((-0.211, 0.346), 1.16)])
def test_a_lens_says_by_how_much_it_moves_the_image(radial: tuple[float, float], shift: float) -> None:
    """Two coefficients that cancel are a small error, however large each; against the inverse map."""
    intrinsics = cell_named(DEFAULT_CELL).intrinsics
    at = find_lens_places(dict(zip(("k1", "k2"), radial, strict=True)), intrinsics)
    v, u = np.mgrid[0 : intrinsics.height, 0 : intrinsics.width]
    expected = float(np.sqrt(np.mean((at.x - u) ** 2 + (at.y - v) ** 2)))
    trial = cast(Any, SimpleNamespace(recording=SimpleNamespace(intrinsics=intrinsics)))
    form = EFFECT.forms(trial, Place("sensor:camera", ()))[0]
    told = form.parameters(trial, {"scale": 1.0}, np.array(radial))
    assert told == {"k1": radial[0], "k2": radial[1], "shift": pytest.approx(expected, rel=0.1)}
    assert expected == pytest.approx(shift, abs=0.02)


def test_a_lens_as_stated_leaves_the_frame(recordings: list[ImageRecording]) -> None:
    scene = ImageScene(recordings[0], compared_size(recordings[0].intrinsics)[0])
    frame = chosen_frames(scene, recordings[0])[0]
    assert undistorted(scene, frame, {"hand_eye": np.ones(6)}) is frame


def test_depth_of_a_resampled_image_is_that_of_its_own_ray(recordings: list[ImageRecording]) -> None:
    """Depth is read at whole pixels: 0.4 of one beside the ray, a slope makes another distance of it."""
    scene = ImageScene(recordings[0], compared_size(recordings[0].intrinsics)[0])
    frame = chosen_frames(scene, recordings[0])[0]
    plain = scene.render(scene.vertices(frame.view, np.eye(4))).xyz.numpy()[..., 2]
    size = np.array([0.4, -0.4]) / scene.intrinsics.width
    back = find_lens_places({"cx": -size[0], "cy": -size[1]}, scene.intrinsics)
    spoilt = replace(frame, depth=cv2.remap(plain, back.x, back.y, cv2.INTER_LINEAR).astype(float))
    taken_out = undistorted(scene, spoilt, {"centre": size})
    mended, rounded = (
        frame_rows(scene, f, np.eye(4), DEPTH_NOISE_PER_Z2)["depth"].value
        for f in (taken_out, replace(taken_out, beside=None))
    )
    assert np.quantile(np.abs(rounded), 0.9) > 5e-4, "no slope in the image: the test shows nothing"
    assert np.quantile(np.abs(mended), 0.9) < 0.1 * np.quantile(np.abs(rounded), 0.9)


def test_a_lens_is_told_from_depth_that_was_resampled_by_nearest_pixels(
    recordings: list[ImageRecording],
) -> None:
    """Depth as a driver gives it that takes each pixel's from the nearest one of an ideal image.

    Where the lens moves the image by less than half a pixel, such depth does not move at all, and it looked
    like a longer focal length and a lens of 1.4 times its size (k1 -0.29, k2 0.29).
    """
    first = recordings[0]
    scene = ImageScene(first, compared_size(first.intrinsics)[0])
    k, size = scene.intrinsics, np.array([-0.2, 0.0])
    v, u = np.mgrid[0 : k.height, 0 : k.width].astype(float)
    seen = np.stack([(u + 0.5 - k.cx) / k.fx, (v + 0.5 - k.cy) / k.fy], axis=-1)
    rays = cv2.undistortPoints(seen.reshape(-1, 1, 2), np.eye(3), np.array([*size, 0.0, 0.0])).reshape(
        seen.shape
    )
    column, row = np.rint(rays[..., 0] * k.fx + k.cx - 0.5), np.rint(rays[..., 1] * k.fy + k.cy - 0.5)
    inside = (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
    row, column = np.clip(row, 0, k.height - 1).astype(int), np.clip(column, 0, k.width - 1).astype(int)
    names, parts, values = ("radial", "focal", "hand_eye", "depth_nearest"), [], []
    for frame in chosen_frames(scene, first)[::4]:
        view = scene.view(first, frame.view.time)
        z = scene.render(scene.vertices(view, np.eye(4))).xyz.numpy()[..., 2].astype(float)
        nearest = replace(
            frame,
            depth=np.where(inside, z[row, column], np.nan),
            mask=np.where(inside, frame.mask[row, column], np.uint8(0)),
        )
        rows = rows_at(scene, nearest, np.eye(4), DEPTH_NOISE_PER_Z2, {"radial": size})["depth"]
        parts.append(np.concatenate([rows.columns[name] for name in names]) / rows.shape)
        values.append(rows.value / rows.shape)
    design, value = np.concatenate(parts, axis=1).T, np.concatenate(values)
    found = np.linalg.lstsq(design, value, rcond=None)[0]
    without = np.linalg.lstsq(design[:, :-1], value, rcond=None)[0]
    assert abs(without[0] / size[0]) > 1.25, "whole pixels change nothing: the test shows nothing"
    assert abs(found[0] / size[0] - 1.0) < 0.15


@pytest.mark.slow
def test_a_large_error_of_the_lens_is_where_images_are_compared(recordings: list[ImageRecording]) -> None:
    """5 % of the focal lengths and of the image's height: far outside of what is linear."""
    focal, centre = np.array([0.05, 0.04]), np.array([0.0, 0.05])
    first = recordings[0]
    inverse = dict(
        zip(("fx", "fy", "cx", "cy"), [*(1 / (1 + focal) - 1), *(-centre / (1 + focal))], strict=True)
    )
    at = find_lens_places(inverse, first.intrinsics)
    color = np.stack([cv2.remap(c, at.x, at.y, cv2.INTER_LINEAR, borderMode=1) for c in first.color])
    spoilt = replace(
        first,
        color=color,
        depth=np.where(at.inside, first.depth[:, at.row, at.column], np.float32(np.nan)),
        mask=np.where(at.inside, first.mask[:, at.row, at.column], np.uint8(0)),
    )
    (trial,) = prepared([spoilt], 1)
    point = trial.constants.point
    np.testing.assert_allclose(point["focal"], focal, atol=0.012)
    np.testing.assert_allclose(point["centre"], centre, atol=0.012)


def test_a_lens_is_known_no_better_than_whole_pixels_tell_it() -> None:
    """k1 0.3 with k2 -0.26 moves an image of 128 px by 0.43 px (root mean square) other than k1 0.2."""
    intrinsics = cell_named(DEFAULT_CELL).intrinsics
    trial = cast(Any, SimpleNamespace(recording=SimpleNamespace(intrinsics=intrinsics)))
    form = EFFECT.forms(trial, Place("sensor:camera", ()))[0]
    unresolved = form.find_unresolved(trial, {"scale": 3.0})
    off = np.array([0.1, -0.26])
    assert off @ np.linalg.inv(unresolved) @ off < 5.99  # within 95 %; noise alone leaves 0.03 and 0.11
    assert np.sqrt(unresolved[0, 0]) < 0.06
    alike = form.parameters(trial, {"scale": 3.0}, np.linalg.cholesky(unresolved)[:, 0])["shift"]
    assert 0.1 < alike < 0.5, "the images differ by more than reading at whole pixels does"
