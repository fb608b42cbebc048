"""Signed distances: values, normals as their derivative, and continuity round the edges."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.physics import shapes
from tests.model.physics.signed_distance import signed_distance

TURNED = Pose.from_rpy(np.array([0.01, -0.02, 0.03]), (0.3, -0.5, 1.0))
SOLIDS = {
    "plane": lambda: shapes.plane(TURNED),
    "box": lambda: shapes.box((0.03, 0.02, 0.01), 0.002, TURNED),
    "capsule": lambda: shapes.capsule(0.01, 0.04, TURNED),
    "cylinder": lambda: shapes.cylinder(0.03, 0.02, 0.002, TURNED),
    "ring": lambda: shapes.ring(0.007, 0.012, 0.006, 0.001, 0.0005, TURNED),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_normal_is_the_slope_of_the_distance(name: str) -> None:
    solid = SOLIDS[name]()
    points = np.random.default_rng(2).uniform(-0.06, 0.06, (4000, 3))
    value, normal = signed_distance(solid, points)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-9)
    h = 1e-7
    slope = np.stack(
        [
            (signed_distance(solid, points + h * e)[0] - signed_distance(solid, points - h * e)[0]) / (2 * h)
            for e in np.eye(3)
        ],
        axis=1,
    )
    same = np.abs(slope - normal).max(axis=1) < 1e-4
    assert same.mean() > 0.998  # the rest straddles the middle of a solid
    outside = value > 0
    assert same[outside].mean() > 0.998


@pytest.mark.parametrize(
    ("solid", "point", "expected"),
    [
        (shapes.box((0.03, 0.02, 0.01), 0.002), (0.04, 0, 0), 0.01),
        (shapes.box((0.03, 0.02, 0.01), 0.002), (0, 0, 0.009), -0.001),
        (shapes.cylinder(0.03, 0.02, 0.002), (0.0, 0.035, 0), 0.005),
        (shapes.cylinder(0.03, 0.02, 0.002), (0.001, 0.0, 0.012), 0.002),
        (shapes.cylinder(0.03, 0.02, 0.002), (0.0, 0.0, 0.0), -0.01),
        (shapes.capsule(0.01, 0.04), (0, 0, 0.035), 0.005),
        (shapes.ring(0.007, 0.012, 0.006, 0.001, 0.0005), (0, 0, 0), 0.007),
        (shapes.ring(0.007, 0.012, 0.006, 0.001, 0.0005), (0.0095, 0, 0.004), 0.001),
        (shapes.ring(0.007, 0.012, 0.006, 0.001, 0.0005), (0.0, 0.0075, 0), -0.0005),
        # middle of the chamfer, along its normal
        (
            shapes.ring(0.007, 0.012, 0.006, 0.001, 0.0),
            (0.0075 - 0.001 / 2**0.5, 0, 0.0025 + 0.001 / 2**0.5),
            0.001,
        ),
    ],
)
def test_known_distances(solid: shapes.Shape, point: tuple[float, float, float], expected: float) -> None:
    assert signed_distance(solid, np.array([point]))[0][0] == pytest.approx(expected, abs=1e-9)


def test_normals_turn_smoothly_round_a_rounded_edge() -> None:
    """Along a line just inside the surface, past the edge, the normal has no jump."""
    solid = shapes.box((0.03, 0.02, 0.01), 0.002)
    angle = np.linspace(0, np.pi / 2, 200)
    points = np.stack([0.028 + 0.0019 * np.sin(angle), 0 * angle, 0.008 + 0.0019 * np.cos(angle)], axis=1)
    value, normal = signed_distance(solid, points)
    np.testing.assert_allclose(value, -0.0001, atol=1e-12)
    assert np.abs(np.diff(normal, axis=0)).max() < 0.01


@pytest.mark.parametrize(
    "make",
    [
        lambda: shapes.box((0.03, -0.02, 0.01), 0.0),
        lambda: shapes.box((0.03, 0.02, 0.01), 0.01),
        lambda: shapes.cylinder(0.0, 0.01, 0.0),
        lambda: shapes.capsule(float("nan"), 0.01),
        lambda: shapes.ring(0.012, 0.007, 0.004, 0.0005, 0.0),
        lambda: shapes.ring(0.007, 0.012, 0.004, 0.002, 0.0),
        lambda: shapes.ring(0.007, 0.012, 0.004, 0.0005, 0.002),
    ],
)
def test_impossible_sizes_are_refused(make) -> None:
    with pytest.raises(InputError):
        make()
