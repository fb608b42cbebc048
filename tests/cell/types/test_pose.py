"""Group axioms, conventions and refusals of `Pose`."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import Pose, look_at, quaternion_from_rotation, rpy_from_rotation
from samrl_core.common.errors import InputError


def some(seed: int) -> Pose:
    rng = np.random.default_rng(seed)
    quat = rng.normal(size=4)
    return Pose(rng.normal(size=3), quat / np.linalg.norm(quat))


@pytest.mark.parametrize("seed", range(20))
def test_group_axioms(seed: int) -> None:
    a, b, c = some(seed), some(seed + 100), some(seed + 200)
    np.testing.assert_allclose(((a @ b) @ c).matrix(), (a @ (b @ c)).matrix(), atol=1e-12)
    np.testing.assert_allclose((a @ a.inverse()).matrix(), np.eye(4), atol=1e-12)
    np.testing.assert_allclose((a @ b).matrix(), a.matrix() @ b.matrix(), atol=1e-12)
    point = np.array([0.3, -0.1, 2.0])
    np.testing.assert_allclose((a @ b).apply(point), a.apply(b.apply(point)), atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_rotation_matrix_there_and_back(seed: int) -> None:
    pose = some(seed)
    quat = quaternion_from_rotation(pose.rotation)
    assert abs(abs(float(quat @ pose.quat_xyzw)) - 1.0) < 1e-12


def test_roll_pitch_yaw_is_fixed_axis() -> None:
    yaw, roll = Pose.from_rpy(np.zeros(3), (0, 0, 0.3)), Pose.from_rpy(np.zeros(3), (0.5, 0, 0))
    np.testing.assert_allclose(
        Pose.from_rpy(np.zeros(3), (0.5, 0, 0.3)).matrix(), (yaw @ roll).matrix(), atol=1e-12
    )


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@pytest.mark.parametrize("signs", list(itertools.product((1.0, -1.0), repeat=2)))
def test_roll_pitch_yaw_of_axes_that_change_places(order: tuple[int, ...], signs: tuple[float, ...]) -> None:
    turn = np.eye(3)[:, order] * np.array([*signs, 1.0])
    turn[:, 2] *= np.linalg.det(turn)
    back = Pose.from_rpy(np.zeros(3), rpy_from_rotation(turn)).rotation
    np.testing.assert_allclose(back, turn, atol=1e-12)


def test_refusals() -> None:
    with pytest.raises(InputError, match="shapes"):
        Pose(np.zeros(2), np.array([0, 0, 0, 1.0]))
    with pytest.raises(InputError, match="length"):
        Pose(np.zeros(3), np.array([0, 0, 0, 2.0]))
    with pytest.raises(InputError, match="finite"):
        Pose(np.array([np.nan, 0, 0]), np.array([0, 0, 0, 1.0]))
    with pytest.raises(InputError, match="rotation"):
        quaternion_from_rotation(np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(InputError, match="vertical"):
        look_at(np.array([0, 0, 1.0]), np.zeros(3))


def test_a_look_at_camera_sees_its_target_in_the_middle_and_up_is_up() -> None:
    camera_in_world = look_at(np.array([0.4, -0.3, 0.5]), np.array([0.1, 0, 0.05]))
    camera = Camera(Intrinsics.from_fov(128, 128, 0.7), camera_in_world)
    u, v, depth = camera.project(np.array([0.1, 0, 0.05]))
    assert (u, v) == (pytest.approx(64), pytest.approx(64))
    assert depth == pytest.approx(np.linalg.norm([0.3, -0.3, 0.45]))
    assert camera.project(np.array([0.1, 0, 0.10]))[1] < v, "a higher point must appear higher in the image"


def test_unproject_inverts_project() -> None:
    camera = Camera(Intrinsics(8, 6, 9.0, 10.0, 3.7, 3.1), some(3))
    depth = np.random.default_rng(0).uniform(0.2, 2.0, (6, 8))
    points = camera.unproject(depth)
    projected = camera.project(points)
    u, v = np.meshgrid(np.arange(8) + 0.5, np.arange(6) + 0.5)
    np.testing.assert_allclose(projected, np.stack([u, v, depth], axis=-1), atol=1e-9)


def test_what_lies_in_the_image() -> None:
    """The outer corner of the first pixel belongs to the image, that of the last one does not."""
    k = Intrinsics(8, 6, 9.0, 10.0, 4.0, 3.0)
    u = np.array([0.0, 7.99, 8.0, -0.01, 4.0, 4.0, 4.0, np.nan])
    v = np.array([0.0, 5.99, 3.0, 3.0, 6.0, 3.0, 3.0, 3.0])
    depth = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0, -1.0, 1.0])
    np.testing.assert_array_equal(k.frames(u, v, depth), [True, True] + [False] * 6)


def test_small_angles_are_exact() -> None:
    turned = Pose.from_rpy(np.zeros(3), (0.0, 0.0, 1e-7))
    assert Pose.identity().angle_to(turned) == pytest.approx(1e-7, rel=1e-6)
