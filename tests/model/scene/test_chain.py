"""The chain in the model: its kinematics, its surface, its image and the image's slope; three tasks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.chain import chain_points, link_poses
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Capsule, Scene
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model
from samrl_core.model.scene.body_motion import TensorPose
from samrl_core.model.scene.chain_motion import ChainMotion
from samrl_core.model.scene.chain_skin import chain_skin
from samrl_core.model.scene.meshes import capsule_mesh, face_normals, part_mesh, revolved_mesh
from samrl_core.model.scene.settings import ModelSettings

CELL = cell_named()
TASK = NeedleThreading()
CHAIN = TASK.scene(CELL).tool.chain
TIP = Pose.from_rpy(np.array([0.5, 0.02, 0.27]), (3.1, 0.05, -0.1))
ANGLES = np.random.default_rng(5).uniform(-0.25, 0.25, 20)


@pytest.fixture(scope="module")
def joints() -> np.ndarray:
    return TASK.start_joints(CELL)["tool_arm"]


def camera(task: NeedleThreading | SpatulaFlipping = TASK) -> Camera:
    return Camera(CELL.intrinsics, task.start_camera())


def densely(line: np.ndarray) -> np.ndarray:
    """Points on a broken line, 100 to a piece."""
    share = np.linspace(0, 1, 100)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in zip(line[:-1], line[1:], strict=True)])


def test_frames_are_those_of_the_task() -> None:
    """Against the kinematics that the world and evaluation use."""
    found = ChainMotion(TASK, CHAIN)(torch.from_numpy(ANGLES), TIP)
    for k, pose in enumerate(link_poses(CHAIN, TIP, ANGLES)):
        np.testing.assert_allclose(found.rotation[k].numpy(), pose.rotation, atol=1e-9)
        np.testing.assert_allclose(found.position[k].numpy(), pose.position, atol=1e-12)


def test_slope_of_the_frames() -> None:
    """Analytic against central differences, and carried into torch."""
    motion = ChainMotion(TASK, CHAIN)
    jacobians = motion.jacobians(ANGLES, TIP)
    h = 1e-6
    for k in range(20):
        step = h * np.eye(20)[k]
        numeric = (motion.rows(ANGLES + step, TIP) - motion.rows(ANGLES - step, TIP)) / (2 * h)
        np.testing.assert_allclose(jacobians[:, :, k], numeric, atol=1e-8)
    values = torch.from_numpy(ANGLES.copy()).requires_grad_(True)
    (gradient,) = torch.autograd.grad(motion(values, TIP).position[9, 2], values)
    np.testing.assert_allclose(gradient.numpy(), jacobians[9, 11], atol=1e-12)


def test_tube_lies_on_the_capsules() -> None:
    """Distance of the tube's vertices and edges to the centre line is the radius, for bends of +-10 deg."""
    angles = ANGLES * 0.7
    skin = chain_skin(CHAIN, 0.4)
    vertices = skin.posed(ChainMotion(TASK, CHAIN)(torch.from_numpy(angles), TIP)).numpy()
    line = chain_points(CHAIN, link_poses(CHAIN, TIP, angles))
    along = densely(line)
    points = np.concatenate([vertices, vertices[skin.faces].mean(axis=1)])
    distance = np.linalg.norm(points[:, None] - along[None], axis=-1).min(axis=1)
    assert abs(distance.mean() / TASK.thread_radius - 1) < 0.06
    assert distance.max() < 1.08 * TASK.thread_radius
    assert skin.names == ("chain/thread_0",)


def test_links_of_other_shapes_and_colours() -> None:
    """Boxes are drawn rigid, each with its link; every colour has a group; labels must agree."""
    box = Box((0.001, 0.001, 0.004), Pose(np.array([0.0, 0.0, 0.005]), np.array([0.0, 0.0, 0.0, 1.0])))
    links = tuple(replace(link, parts=(box,), color=(0.1 * k, 0.5, 0.2)) for k, link in enumerate(CHAIN[:3]))
    skin = chain_skin(links, 0.4)
    assert len(skin.names) == 3 and len(set(skin.part.tolist())) == 3
    poses = link_poses(links, TIP, ANGLES[:6])
    links_now = TensorPose(
        torch.tensor(np.array([p.rotation for p in poses])),
        torch.tensor(np.array([p.position for p in poses])),
    )
    local = np.concatenate([p.inverse().apply(skin.posed(links_now).numpy()) for p in poses])
    corner = np.abs(np.abs(local - [0.0, 0.0, 0.005]) - [0.001, 0.001, 0.004]).max(axis=1) < 1e-9
    assert corner.sum() == 3 * 8  # each box's corners are corners in its own link's frame alone
    with pytest.raises(InputError, match="one label"):
        chain_skin((CHAIN[0], replace(CHAIN[1], label=7)), 0.4)
    with pytest.raises(InputError, match="no parts"):
        chain_skin((replace(CHAIN[0], parts=()),), 0.4)


def test_capsule_mesh_is_closed_and_faces_outwards() -> None:
    """Area and volume of a capsule within the facets' error; refusals."""
    r, length = 0.003, 0.01
    mesh = part_mesh(Capsule(r, length, Pose.identity()), (1.0, 0.0, 0.0), segments=48)
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(np.pi * r**2 * length + 4 / 3 * np.pi * r**3, rel=0.08)
    assert (np.einsum("fi,fi->f", corners.mean(axis=1), face_normals(mesh.vertices, mesh.faces)) > 0).all()
    for bad in ((0.0, 1.0), (1.0, -1.0), (float("nan"), 1.0)):
        with pytest.raises(InputError, match="positive"):
            capsule_mesh(*bad, (1.0, 0.0, 0.0))
    with pytest.raises(InputError, match="must not go down"):
        revolved_mesh(np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0]), (1.0, 0.0, 0.0))


def test_thread_is_where_the_camera_projects_it(joints: np.ndarray) -> None:
    """Every target pixel lies near the projected centre line, and the loose end is drawn."""
    model = Model(TASK, CELL)
    r = model.render(torch.from_numpy(ANGLES), torch.from_numpy(model.initial_colors()), camera(), joints)
    tip = CELL.tool_base_in_world @ model.tip_in_base(joints)
    line = chain_points(CHAIN, link_poses(CHAIN, tip, ANGLES))
    along = densely(line)
    uv = camera().project(along)[:, :2]
    rows, columns = np.nonzero(r.target.numpy() > 0.5)
    pixels = np.stack([columns, rows], axis=1) + 0.5
    distance = np.linalg.norm(pixels[:, None] - uv[None], axis=-1)
    assert distance.min(axis=1).max() < 1.6
    assert distance[:, -1].min() < 1.0
    assert model.target_label == TASK.thread_label
    assert (r.label.numpy()[r.target.numpy() == 1] == TASK.thread_label).all()


@pytest.mark.parametrize(
    "task, values",
    [
        (TASK, 0.6 * ANGLES),
        (NeedleThreading(link_colors=((0.9, 0.1, 0.1), (0.1, 0.8, 0.2), (0.15, 0.2, 0.9))), 0.6 * ANGLES),
        (SpatulaFlipping(), np.array([0.512, 0.004, 0.030, 0.3, -0.4])),
    ],
    ids=["thread", "many_colors", "pancake"],
)
@pytest.mark.parametrize("channel", ["color", "xyz", "target"])
def test_gradient_of_the_image(channel: str, task, values: np.ndarray) -> None:
    """By all parameters at once, against central differences of a 16 x 16 supersampled image."""
    model, fine = Model(task, CELL), Model(task, CELL, ModelSettings(supersample=16))
    arm = task.start_joints(CELL)["tool_arm"]
    y, x = torch.meshgrid(torch.linspace(-1, 1, 128), torch.linspace(-1, 1, 128), indexing="ij")
    weights = torch.sin(2.1 * x + 1.3 * y + 0.4) + 0.5 * torch.cos(3.0 * y - 1.7 * x)

    def value(m: Model, v: torch.Tensor) -> torch.Tensor:
        image = getattr(m.render(v, torch.from_numpy(m.initial_colors()), camera(task), arm), channel)
        return (image * (weights[..., None] if image.ndim == 3 else weights)).sum()

    v = torch.tensor(values, requires_grad=True)
    (gradient,) = torch.autograd.grad(value(model, v), v)
    # Steps that move the picture by a third of a pixel: one sample in 16 is 0.06 px.
    speed = np.abs(model.target_frames(values, arm).motion(model.target_surface(values, arm).reshape(-1, 3)))
    numeric = []
    with torch.no_grad():
        for k, h in enumerate(8e-4 / speed.max(axis=(0, 1))):
            step = torch.from_numpy(np.eye(len(values))[k] * h)
            ends = [float(value(fine, torch.from_numpy(values) + s * step)) for s in (1, -1)]
            numeric.append((ends[0] - ends[1]) / (2 * h))
    scale = np.array([p.scale for p in task.parameters()])
    wanted = scale * np.array(numeric)
    error = np.linalg.norm(scale * gradient.numpy() - wanted) / np.linalg.norm(wanted)
    print(type(task).__name__, channel, "relative error", error)
    assert error < 0.03


def test_target_points_move_as_the_surface_does(joints: np.ndarray) -> None:
    """Points on the surface, carried by their link, against the surface drawn at other values."""
    model = Model(TASK, CELL)
    at = 0.5 * ANGLES
    surface = model.target_surface(at, joints)
    middle = surface.mean(axis=1)
    found = model.target_frames(at, joints).motion(middle)
    for k in (0, 7, 18):
        step = 1e-5 * np.eye(20)[k]
        ends = [model.target_surface(at + s * step, joints).mean(axis=1) for s in (1, -1)]
        numeric = (ends[0] - ends[1]) / 2e-5
        assert np.abs(found[:, :, k] - numeric).max() < 0.003  # a joint's ring hangs from two links: radius
    assert np.abs(found[:, :, 0]).max() > 0.09  # the loose end turns about the gripper on a 0.1 m lever


def test_bad_input_is_refused(joints: np.ndarray) -> None:
    model = Model(TASK, CELL)
    c = torch.from_numpy(model.initial_colors())
    with pytest.raises(InputError, match="finite"):
        model.render(torch.full((20,), float("nan"), dtype=torch.float64), c, camera(), joints)
    with pytest.raises(InputError, match="declares"):
        model.render(torch.zeros(2), c, camera(), joints)

    class Still(NeedleThreading):
        def scene(self, cell):
            scene = super().scene(cell)
            return Scene(scene.bodies, replace(scene.tool, chain=()))

    with pytest.raises(InputError, match="must move"):
        Model(Still(), CELL)

    class Elsewhere(SpatulaFlipping):
        def body_poses(self, values):
            return {"waffle": super().body_poses(values)["pancake"]}

        def scene(self, cell):
            return SpatulaFlipping().scene(cell)

    with pytest.raises(InputError, match="waffle"):
        Model(Elsewhere(), CELL)
