"""What a correction's covariance is at a place, against cells whose corrections are drawn from it."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import (
    CellCorrection,
    CorrectionCovariance,
    find_lens_places,
    twist_names,
)
from samrl_core.cell.calibration.seen_error import EXACTLY_SEEN, seen_columns, seen_error
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.pose import Pose, rotation_vector

CELL, TASK = cell_named(), task_named("peg_insertion_hard")
CAMERA = TASK.start_camera()
POINTS = np.array([[0.5, 0.0, 0.08], [0.53, 0.06, 0.25]])  # what is aimed at, and above it
HAND = CELL.camera_in_flange
BASES = CELL.camera_base_in_world.inverse() @ CELL.tool_base_in_world
DEPTH = {"depth_scale": 0.02, "depth_offset": 0.003}
NAMES = (*twist_names("camera_in_flange"), *twist_names("tool_base_in_camera_base"), *DEPTH)


def corrected(matrix: np.ndarray) -> CellCorrection:
    return CellCorrection(HAND, BASES, DEPTH, covariance=CorrectionCovariance(NAMES, matrix))


def seen_where(errors: np.ndarray, camera: Pose = CAMERA) -> np.ndarray:
    """Where points (2, 3) are seen if the numbers of a correction (14,) are off by so much."""
    flange_in_base = CELL.camera_base_in_world.inverse() @ camera @ HAND.inverse()
    hand = Pose(HAND.position + errors[:3], HAND.quat_xyzw) @ rotation_vector(errors[3:6])
    bases = Pose(BASES.position + errors[6:9], BASES.quat_xyzw) @ rotation_vector(errors[9:12])
    in_camera = camera.inverse().apply(POINTS)
    z = in_camera[:, 2:]
    reading = (1.0 + DEPTH["depth_scale"]) * z + DEPTH["depth_offset"]
    depth = (reading - DEPTH["depth_offset"] - errors[13]) / (1.0 + DEPTH["depth_scale"] + errors[12])
    in_base = (flange_in_base @ hand).apply(in_camera * depth / z)
    return CELL.tool_base_in_world.apply(bases.inverse().apply(in_base))


def test_every_number_moves_points_as_a_cell_with_that_error_does() -> None:
    columns, step = seen_columns(corrected(np.eye(14)), CELL, CAMERA, POINTS), 1e-6
    for k, error in enumerate(step * np.eye(14)):
        difference = (seen_where(error) - seen_where(-error)) / (2.0 * step)
        np.testing.assert_allclose(columns[..., k], difference, atol=1e-6, err_msg=NAMES[k])
        assert np.abs(difference).max() > 0.05


def test_a_lens_moves_points_as_images_are_resampled() -> None:
    """Without its correction a point is taken for what the described pinhole has at the true lens's pixel."""
    k, size = CELL.intrinsics, 1e-4
    for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"):
        one = CellCorrection(numbers={name: 0.0}, covariance=CorrectionCovariance((name,), np.eye(1)))
        x, y, z = np.array([[0.05, -0.04, 0.3], [-0.08, -0.03, 0.4]]).T
        column, row = np.floor(k.fx * x / z + k.cx).astype(int), np.floor(k.fy * y / z + k.cy).astype(int)
        ray = np.stack([(column + 0.5 - k.cx) / k.fx, (row + 0.5 - k.cy) / k.fy, np.ones(2)], axis=1)
        points = CAMERA.apply(ray * z[:, None])
        moved = seen_columns(one, CELL, CAMERA, points)[..., 0] @ CAMERA.rotation  # in the camera's axes
        seen, straight = find_lens_places({name: size}, k), find_lens_places({}, k)
        du = (seen.x - straight.x)[row, column] / k.fx / size
        dv = (seen.y - straight.y)[row, column] / k.fy / size
        found = -np.stack([du * z, dv * z, np.zeros(2)], axis=1)
        np.testing.assert_allclose(moved, found, atol=0.1 * np.abs(found).max() + 2e-3, err_msg=name)


def test_the_covariance_is_that_of_cells_that_are_drawn_from_it() -> None:
    rng = np.random.default_rng(0)
    factor = 1e-3 * rng.standard_normal(
        (14, 14)
    )  # numbers of a millimetre or a milliradian, pulling together
    left = seen_error(corrected(factor @ factor.T), CELL, CAMERA, POINTS[0], POINTS[1])
    draws = np.array([seen_where(factor @ rng.standard_normal(14)) for _ in range(4000)]) - POINTS
    rays = POINTS - CAMERA.position
    level = draws[..., :2] - rays[:, :2] / rays[:, 2:] * draws[..., 2:]  # on with the ray to its own height
    for found, sample in (
        (left.place, level[:, 0]),
        (left.apart, level[:, 1] - level[:, 0]),
        (left.position, draws[:, 0]),
    ):
        wanted = np.cov(sample.T)
        np.testing.assert_allclose(found, wanted, atol=0.1 * np.trace(wanted))


def test_numbers_that_pull_together_leave_a_place_known() -> None:
    """A base that turns about the place that was recorded: a centimetre at the base, nothing there."""
    turn, place = 0.02 * np.eye(3), CELL.tool_base_in_world.inverse().apply(POINTS[:1])[0]
    x, y, z = place
    lever = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    factor = np.zeros((14, 3))
    factor[6:9], factor[9:12] = BASES.rotation @ lever @ turn, turn  # t = R (p x r) = -R (r x p)
    left = seen_error(corrected(factor @ factor.T), CELL, CAMERA, POINTS[0], POINTS[1])
    assert np.linalg.norm(factor[6:9]) > 0.01
    assert np.sqrt(np.trace(left.place)) < 1e-6 < 1e-3 < np.sqrt(np.trace(left.apart))


def test_a_hand_eye_is_another_error_where_the_camera_turned() -> None:
    sizes = np.zeros(14)
    sizes[:3] = 0.002
    first = seen_error(corrected(np.diag(sizes**2)), CELL, CAMERA, POINTS[0], POINTS[1])
    second = seen_error(corrected(np.diag((2.0 * sizes) ** 2)), CELL, CAMERA, POINTS[0], POINTS[1])
    assert 0.001 < first.per_radian < 0.01
    assert second.per_radian == pytest.approx(2.0 * first.per_radian)
    np.testing.assert_allclose(second.place, 4.0 * first.place)


def test_what_is_known_exactly_leaves_nothing() -> None:
    exact = CellCorrection(HAND, numbers={"k1": 0.1})
    assert seen_error(exact, CELL, CAMERA, POINTS[0], POINTS[1]) is EXACTLY_SEEN
