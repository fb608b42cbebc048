"""Distances between surfaces, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.model.fusion.chamfer import Surface, chamfer, surface_samples
from samrl_core.model.scene.meshes import box_mesh

BOX = box_mesh((0.02, 0.03, 0.05), (0.5, 0.5, 0.5))


def test_distance_to_a_box_is_exact() -> None:
    """Outside faces, edges and corners, and inside; the box has triangles of 10 cm."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.08, 0.08, (500, 3))
    beyond = np.abs(points) - [0.02, 0.03, 0.05]
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    expected = np.where(outside > 0, outside, -beyond.max(axis=1))
    assert np.abs(Surface(BOX.vertices, BOX.faces).distance(points) - expected).max() < 1e-9


def test_samples_lie_on_their_faces_and_spread_by_area() -> None:
    points, face = surface_samples(BOX.vertices, BOX.faces, 4000, np.random.default_rng(1))
    assert Surface(BOX.vertices, BOX.faces).distance(points).max() < 1e-9
    area = np.array([0.04 * 0.06, 0.04 * 0.10, 0.06 * 0.10])  # sides with a normal along z, y, x
    on_x = np.abs(np.abs(points[:, 0]) - 0.02) < 1e-9
    assert on_x.mean() == pytest.approx(area[2] / area.sum(), abs=0.01)
    corners = BOX.vertices[BOX.faces[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.abs(np.einsum("ij,ij->i", points - corners[:, 0], normal)).max() < 1e-12


def test_chamfer_of_a_box_moved_by_a_millimetre() -> None:
    """The two sides across the motion are 1 mm away, the others hardly at all."""
    rng = np.random.default_rng(2)
    moved = BOX.vertices + [0.001, 0.0, 0.0]
    first, _ = surface_samples(BOX.vertices, BOX.faces, 4000, rng)
    second, _ = surface_samples(moved, BOX.faces, 4000, rng)
    found = chamfer((first, Surface(BOX.vertices, BOX.faces)), (second, Surface(moved, BOX.faces)))
    share = 0.06 * 0.10 / (0.04 * 0.06 + 0.04 * 0.10 + 0.06 * 0.10)
    assert found.forward == pytest.approx(share * 1e-3, rel=0.1)
    assert found.backward == pytest.approx(share * 1e-3, rel=0.1)
    assert found.largest_forward == pytest.approx(1e-3, rel=1e-6)
    assert found.mean == pytest.approx(0.5 * (found.forward + found.backward))


def test_nothing_to_measure() -> None:
    box = Surface(BOX.vertices, BOX.faces)
    with pytest.raises(InputError, match="0 and 8 samples"):
        chamfer((np.zeros((0, 3)), box), (BOX.vertices, box))
    with pytest.raises(InputError, match="0 faces"):
        Surface(BOX.vertices, BOX.faces[:0])
    with pytest.raises(InputError, match="no area"):
        surface_samples(BOX.vertices, np.array([[0, 0, 1]]), 10, np.random.default_rng(0))
