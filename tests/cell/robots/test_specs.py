"""Every registered arm against its own file, and the default cell against what its comments promise."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import cell_named, robots
from samrl_core.cell.robots.geometry import Capsules, clearance, link_shapes
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.robots.urdf import check_robot
from samrl_core.common.errors import InputError

every_arm = pytest.mark.parametrize("spec", robots().values(), ids=robots())


@every_arm
def test_limits_equal_the_files(spec: RobotSpec) -> None:
    by_name = {
        j.get("name"): j.find("limit") for j in ElementTree.parse(spec.urdf).getroot().findall("joint")
    }
    limits = [by_name[name] for name in spec.joint_names]
    for attribute in ("lower", "upper", "velocity", "effort"):
        in_file = [float(limit.attrib[attribute]) for limit in limits if limit is not None]
        np.testing.assert_allclose(getattr(spec.limits, attribute), in_file, atol=1e-6)


@every_arm
def test_limits_are_ordered_and_positive(spec: RobotSpec) -> None:
    limits = spec.limits
    assert (limits.lower < limits.upper).all()
    for name in ("velocity", "acceleration", "jerk", "effort", "effort_rate"):
        assert (getattr(limits, name) > 0).all(), name


@every_arm
def test_inertias_are_physical(spec: RobotSpec) -> None:
    """Positive definite; the triangle inequality is not asked of identified figures."""
    for link in ElementTree.parse(spec.urdf).getroot().findall("link"):
        inertial = link.find("inertial")
        assert inertial is not None, "PyBullet would make it 1 kg"
        if link.get("name") == spec.flange:
            continue
        i = inertial.find("inertia")
        assert i is not None
        xx, xy, xz, yy, yz, zz = (float(i.attrib[k]) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        assert np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).min() > 0


@every_arm
def test_mass_matrix_is_positive_everywhere(spec: RobotSpec) -> None:
    arm = ArmModel(spec, cell_named().tool_base_in_world, None)
    rng = np.random.default_rng(0)
    for q in rng.uniform(spec.limits.lower, spec.limits.upper, (200, len(spec.home))):
        assert np.linalg.eigvalsh(arm.mass_matrix(q)).min() > 0


@pytest.mark.parametrize("role", ["tool_arm", "camera_arm"])
@pytest.mark.parametrize("loaded", [False, True])
def test_impedance_law_is_stable_when_sampled(role: str, loaded: bool) -> None:
    """Spectral radius of one period (law held, then semi-implicit Euler) below 1 over the joint range."""
    cell = cell_named()
    spec = cell.arm(role)
    load = {
        "tool_arm": Payload(0.78, np.array([0.0, 0.0, 0.06]), np.diag([0.0035, 0.0035, 0.0018])),
        "camera_arm": Payload(cell.camera_mass, cell.camera_center_of_mass, cell.camera_inertia),
    }[role]
    arm = ArmModel(spec, cell.base_in_world(role), load if loaded else None)
    h, k, d = spec.controller.period_s, np.diag(spec.controller.stiffness), np.diag(spec.controller.damping)
    rng = np.random.default_rng(0)
    one = np.eye(len(spec.home))
    for q in [spec.home, *rng.uniform(spec.limits.lower, spec.limits.upper, (200, len(spec.home)))]:
        m = np.linalg.inv(arm.mass_matrix(q))
        step = np.block([[one - h * h * m @ k, h * (one - h * m @ d)], [-h * m @ k, one - h * m @ d]])
        assert np.abs(np.linalg.eigvals(step)).max() < 1.0


def test_names_are_unique_over_the_cell() -> None:
    cell = cell_named()
    roots = [ElementTree.parse(cell.arm(role).urdf).getroot() for role in ("tool_arm", "camera_arm")]
    for kind in ("link", "joint"):
        names = [e.get("name") for root in roots for e in root.findall(kind)]
        assert len(names) == len(set(names))


def test_tool_arm_home_puts_the_tip_above_the_block() -> None:
    cell = cell_named()
    flange = ArmModel(cell.tool_arm, cell.tool_base_in_world, None).flange_in_world(cell.tool_arm.home)
    np.testing.assert_allclose(flange.rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-5)
    np.testing.assert_allclose(flange.apply(np.array([0.0, 0.0, 0.1634])), [0.5, 0.0, 0.14], atol=1e-5)


def test_camera_arm_home_looks_at_the_task() -> None:
    cell = cell_named()
    arm = ArmModel(cell.camera_arm, cell.camera_base_in_world, None)
    camera = arm.flange_in_world(cell.camera_arm.home) @ cell.camera_in_flange
    target_in_camera = camera.inverse().apply(np.array([0.5, 0.0, 0.03]))
    np.testing.assert_allclose(target_in_camera, [0.0, 0.0, 0.40], atol=1e-4)
    assert camera.rotation[2, 1] < 0  # image y points down
    assert camera.position[2] == pytest.approx(0.03 + 0.40 * np.sin(np.deg2rad(55.0)), abs=1e-4)
    assert camera.position[0] > 0.5  # the side of its own base


def test_arms_at_home_touch_neither_each_other_nor_the_table() -> None:
    cell = cell_named()
    sets = []
    for role in ("tool_arm", "camera_arm"):
        poses = ArmModel(cell.arm(role), cell.base_in_world(role), None).link_poses_in_world(
            cell.arm(role).home
        )
        shapes = link_shapes(cell.arm(role))
        sets.append(Capsules.of_arm(shapes, poses))
        moving = dict(list(shapes.items())[2:])
        assert Capsules.of_arm(moving, poses).lowest() > 0.05
    assert clearance(*sets) > 0.05


@every_arm
def test_payload_must_be_possible(spec: RobotSpec) -> None:
    with pytest.raises(InputError, match="mass"):
        Payload(-0.1, np.zeros(3), np.eye(3))
    with pytest.raises(InputError, match="triangle"):
        Payload(0.1, np.zeros(3), np.diag([1.0, 1.0, 3.0]))
    with pytest.raises(InputError, match="symmetric"):
        Payload(0.1, np.zeros(3), np.array([[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1]]))


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        check_robot(replace(robots()["panda"], urdf=tmp_path / "nowhere.urdf"))


def test_other_arms_file_is_refused() -> None:
    with pytest.raises(InputError, match="panda_link0"):
        check_robot(replace(robots()["panda"], urdf=robots()["rizon4"].urdf))


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("</robot>", "", "well-formed"),
        ('name="panda_joint3" type="revolute"', 'name="panda_joint3" type="fixed"', "moves joints"),
        ('name="panda_joint3" type="revolute"', 'name="elbow" type="revolute"', "elbow"),
        ('name="panda_joint3" type="revolute"', 'name="panda_joint3" type="continuous"', "must be revolute"),
        ('upper="1.7628"', 'upper="1.0"', "exceed"),
        ('upper="1.7628"', 'upper="wide"', "wide"),
        ('<link name="panda_link8">', '<link name="tip">', "panda_link8"),
    ],
)
def test_broken_file_is_refused(tmp_path: Path, old: str, new: str, match: str) -> None:
    spec = robots()["panda"]
    text = spec.urdf.read_text()
    assert old in text
    path = tmp_path / "broken.urdf"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=match):
        check_robot(replace(spec, urdf=path))


def test_broken_spec_is_refused() -> None:
    spec = robots()["panda"]
    with pytest.raises(InputError, match="home"):
        check_robot(replace(spec, home=np.full(7, 3.0)))
    with pytest.raises(InputError, match="armature"):
        check_robot(replace(spec, armature=np.zeros(6)))


@pytest.mark.parametrize("bad", [np.zeros(6), np.zeros((1, 7)), np.array([0, 0, np.nan, 0, 0, 0, 0.0])])
def test_bad_joints_are_refused(bad: np.ndarray) -> None:
    cell = cell_named()
    arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
    good = cell.tool_arm.home
    for call in (arm.flange_in_base, arm.flange_in_world, arm.link_poses_in_world, arm.jacobian, arm.gravity):
        with pytest.raises(InputError, match="panda_joint"):
            call(bad)
    for call in (arm.inverse_dynamics, arm.effort_without_gravity, arm.forward_dynamics):
        with pytest.raises(InputError, match="panda_joint"):
            call(good, good, bad)
