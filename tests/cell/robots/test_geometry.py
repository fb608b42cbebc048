"""Link shapes and the coarse clearance, against answers known by other means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.cells import robots
from samrl_core.cell.robots.geometry import Capsules, clearance, link_shapes, segment_distance
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Capsule, Cylinder
from samrl_core.common.errors import InputError

ORIGIN = Pose.identity()


def _at(x: float, y: float, z: float) -> Pose:
    return Pose(np.array([x, y, z]), np.array([0.0, 0.0, 0.0, 1.0]))


@pytest.mark.parametrize("spec", robots().values(), ids=robots())
def test_every_link_but_the_flange_has_shapes(spec) -> None:
    shapes = link_shapes(spec)
    assert len(shapes) == 8
    assert spec.flange not in shapes


def test_mesh_that_is_not_there_is_refused(tmp_path: Path) -> None:
    spec = robots()["panda"]
    path = tmp_path / "mesh.urdf"
    path.write_text(spec.urdf.read_text().replace('<box size="0.14 0.12 0.11"/>', '<mesh filename="a.stl"/>'))
    with pytest.raises(InputError, match=r"mesh 'a.stl', which is not there"):
        link_shapes(replace(spec, urdf=path))


def test_sphere_becomes_a_cylinder(tmp_path: Path) -> None:
    spec = robots()["panda"]
    path = tmp_path / "sphere.urdf"
    path.write_text(spec.urdf.read_text().replace('<box size="0.14 0.12 0.11"/>', '<sphere radius="0.1"/>'))
    part = link_shapes(replace(spec, urdf=path))["panda_link0"][1]
    assert isinstance(part, Cylinder)
    assert (part.radius, part.length) == (0.1, 0.2)


def test_segment_distance_equals_dense_sampling() -> None:
    rng = np.random.default_rng(2)
    p0, p1, q0, q1 = rng.uniform(-1, 1, (4, 40, 3))
    q1[:5] = q0[:5] + 0.7 * (p1[:5] - p0[:5])  # parallel
    q1[5:8] = q0[5:8]  # a point
    q0[8], q1[8] = p0[8], p1[8]  # the same segment
    s = np.linspace(0, 1, 401)
    on_p = p0[:, None] + s[:, None] * (p1 - p0)[:, None]
    on_q = q0[:, None] + s[:, None] * (q1 - q0)[:, None]
    sampled = np.array(
        [np.linalg.norm(a[:, None] - b[None], axis=-1).min() for a, b in zip(on_p, on_q, strict=True)]
    )
    exact = segment_distance(p0, p1, q0, q1)
    assert (exact <= sampled + 1e-9).all()
    np.testing.assert_allclose(exact, sampled, atol=6e-3)


def test_known_clearances() -> None:
    upright = Capsules.of_parts([Cylinder(0.1, 1.0, ORIGIN)], _at(0, 0, 0))
    beside = Capsules.of_parts([Cylinder(0.2, 1.0, ORIGIN)], _at(1.0, 0, 0.3))
    assert clearance(upright, beside) == pytest.approx(0.7)
    assert clearance(upright, upright) == pytest.approx(-0.2)
    slab = Capsules.of_parts([Box((0.5, 0.03, 0.04), ORIGIN)], _at(0, 0, 2.0))
    assert clearance(upright, slab) == pytest.approx(1.5 - 0.1 - 0.05)
    assert slab.lowest() == pytest.approx(1.95)
    thread = Capsules.of_parts([Capsule(0.002, 0.01, ORIGIN)], _at(0, 0, 1.0))
    assert thread.lowest() == pytest.approx(1.0 - 0.005 - 0.002)


def test_capsule_never_overstates_the_clearance() -> None:
    """Corners of a box and rims of a cylinder lie inside their capsules."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        half = rng.uniform(0.01, 0.2, 3)
        pose = Pose.from_rpy(rng.normal(size=3), tuple(rng.uniform(-3, 3, 3)))
        capsule = Capsules.of_parts([Box(tuple(half), ORIGIN)], pose)
        corners = pose.apply(half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]))
        points = Capsules(corners, corners, np.zeros(8))
        assert clearance(capsule, points) <= 1e-9
        distances = segment_distance(capsule.start, capsule.end, corners, corners)
        assert (distances <= capsule.radius + 1e-9).all()


def test_a_wide_plate_stays_thin() -> None:
    """Its capsules hold it, and add less than the width of a strip to its thickness."""
    half = np.array([0.002, 0.2, 0.13])
    pose = Pose.from_rpy(np.array([0.4, 0.1, 0.2]), (0.3, -0.2, 1.0))
    capsules = Capsules.of_parts([Box((0.002, 0.2, 0.13), ORIGIN)], pose)
    inside = pose.apply(np.random.default_rng(0).uniform(-half, half, (500, 3)))
    for point in inside:
        alone = Capsules(point[None], point[None], np.zeros(1))
        assert clearance(capsules, alone) <= 0.0
    beside = pose.apply(np.array([[0.05, 0.0, 0.0]]))
    assert clearance(capsules, Capsules(beside, beside, np.zeros(1))) > 0.05 - 0.0125


def test_nothing_is_infinitely_far() -> None:
    nothing = Capsules.joined([])
    something = Capsules.of_parts([Cylinder(0.1, 1.0, ORIGIN)], ORIGIN)
    assert clearance(nothing, something) == np.inf
    assert nothing.lowest() == np.inf


def test_shapes_without_a_pose_are_refused() -> None:
    with pytest.raises(InputError, match="panda_link0"):
        Capsules.of_arm(link_shapes(robots()["panda"]), {})
