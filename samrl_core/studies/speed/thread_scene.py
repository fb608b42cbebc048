"""Ten coloured capsules, a thread, over a table, and how a pose moves them: the renderer's common scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import look_at
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Rendered, Renderer
from samrl_core.model.rendering.topology import Topology

SIZE = 128
LENS = Intrinsics.from_fov(SIZE, SIZE, np.deg2rad(45.0))
RADIUS, AXIS, PITCH = 0.02, 0.052, 0.1  # [m]; 8 mm gaps
MOVED = (3, 4, 5)  # links that make the object
COLORS = np.array(
    [
        [0.9, 0.2, 0.2],
        [0.2, 0.8, 0.3],
        [0.2, 0.3, 0.9],
        [0.9, 0.8, 0.2],
        [0.8, 0.3, 0.8],
        [0.2, 0.8, 0.8],
        [0.95, 0.5, 0.1],
        [0.5, 0.9, 0.5],
        [0.6, 0.6, 0.95],
        [0.95, 0.95, 0.95],
    ]
)
# Half spans of the differences: camera rotation, translation; object rotation, translation.
SPAN = 0.5 * np.repeat([4e-3, 5e-3, 3e-2, 5e-3], 3)


@dataclass(frozen=True, eq=False)
class ThreadScene:
    """Vertices, colours and connectivity, and a camera."""

    vertices: torch.Tensor  # (V, 3)
    color: torch.Tensor  # (V, 3)
    target: torch.Tensor  # (V,) 1 on the moved links
    topology: Topology
    rotation: torch.Tensor  # (3, 3) world to camera
    translation: torch.Tensor  # (3,) world to camera [m]


def capsule(segments: int, rings: int, axis: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed capsule along z, poles and rings of vertices."""
    up = np.linspace(np.pi / 2, 0, rings + 1)
    latitude = np.concatenate([up, -up[::-1]])[1:-1]
    z = RADIUS * np.sin(latitude) + 0.5 * axis * np.where(np.arange(len(latitude)) < rings, 1, -1)
    angle = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    body = [
        np.column_stack([RADIUS * np.cos(a) * ring, np.full(segments, h)])
        for a, h in zip(latitude, z, strict=True)
    ]
    top = 0.5 * axis + RADIUS
    vertices = np.concatenate([[[0, 0, top]], *body, [[0, 0, -top]]])
    n, last, faces = len(latitude), len(vertices) - 1, []
    for j in range(segments):
        k = (j + 1) % segments
        faces.append((0, 1 + j, 1 + k))
        for i in range(n - 1):
            a, b = 1 + i * segments, 1 + (i + 1) * segments
            faces += [(a + j, b + j, b + k), (a + j, b + k, a + k)]
        faces.append((1 + (n - 1) * segments + j, last, 1 + (n - 1) * segments + k))
    return vertices, np.array(faces)


def from_z(d: np.ndarray) -> np.ndarray:
    """The smallest rotation that turns z to the unit vector d."""
    v = np.cross([0, 0, 1.0], d)
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + k + k @ k / (1 + d[2])


def thread_scene(
    segments: int = 14, rings: int = 4, axis: float = AXIS, smooth_angle: float = 0.0
) -> ThreadScene:
    """2,242 triangles with (14, 4), 19,362 with (44, 11); links overlap where the axis is longer."""
    rng = np.random.default_rng(0)
    vertices = [np.array([[-1.2, -1.2, 0], [1.2, -1.2, 0], [1.2, 1.2, 0], [-1.2, 1.2, 0]])]
    faces = [np.array([[0, 1, 2], [0, 2, 3]])]
    color = [np.array([[0.35, 0.3, 0.25], [0.45, 0.4, 0.3], [0.5, 0.45, 0.35], [0.3, 0.3, 0.3]])]
    part = [np.zeros(4)]
    shape, triangles = capsule(segments, rings, axis)
    at, direction = np.array([-0.45, 0.0, 0.15]), np.array([1.0, 0, 0])
    for k in range(10):
        direction = direction + 0.55 * rng.normal(size=3) * np.array([0.3, 1, 0.5])
        direction[0] = abs(direction[0]) + 0.3
        direction /= np.linalg.norm(direction)
        faces.append(triangles + sum(len(v) for v in vertices))
        vertices.append(shape @ from_z(direction).T + at + 0.5 * PITCH * direction)
        color.append(np.tile(COLORS[k], (len(shape), 1)))
        part.append(np.full(len(shape), k + 1))
        at = at + PITCH * direction
    v, p = np.concatenate(vertices), np.concatenate(part)
    smooth = np.where(p > 0, smooth_angle, 0.0)
    camera = look_at(np.array([0.15, -1.1, 0.8]), np.array([0.03, 0.02, 0.1])).inverse()
    return ThreadScene(
        torch.from_numpy(v),
        torch.from_numpy(np.concatenate(color)),
        torch.from_numpy(np.isin(p, np.array(MOVED) + 1).astype(float)),
        Topology.build(v, np.concatenate(faces), p, p, smooth),
        torch.from_numpy(camera.rotation.copy()),
        torch.from_numpy(camera.position.copy()),
    )


def turn(w: torch.Tensor) -> torch.Tensor:
    """Rotation (3, 3) by a rotation vector (3,) [rad]."""
    zero = torch.zeros((), dtype=w.dtype)
    return torch.matrix_exp(torch.stack([zero, -w[2], w[1], w[2], zero, -w[0], -w[1], w[0], zero]).view(3, 3))


def moved(scene: ThreadScene, renderer: Renderer, p: torch.Tensor, light: Light | None = None) -> Rendered:
    """Camera turned and shifted by p[:6], object by p[6:12] about its middle."""
    is_moved = scene.target[:, None] > 0
    middle = scene.vertices[is_moved[:, 0]].mean(dim=0)
    there = (scene.vertices - middle) @ turn(p[6:9]).T + middle + p[9:12]
    rotation = turn(p[:3]) @ scene.rotation
    translation = turn(p[:3]) @ scene.translation + p[3:6]
    vertices = torch.where(is_moved, there, scene.vertices)
    return renderer(vertices, scene.color, scene.target, rotation, translation, light)


def rgb_xyz(r: Rendered) -> torch.Tensor:
    """Colour and position (..., 6), float64."""
    return torch.cat([r.color, r.xyz], dim=-1).double()


def smooth_image(channels: int) -> np.ndarray:
    """Six waves in each channel, (H, W, C)."""
    rng = np.random.default_rng(1)
    y, x = np.meshgrid(np.arange(SIZE) / SIZE, np.arange(SIZE) / SIZE, indexing="ij")
    smooth = np.zeros((SIZE, SIZE, channels))
    for c in range(channels):
        for _ in range(6):
            kx, ky = 3 * rng.normal(size=2)
            smooth[..., c] += rng.normal() * np.sin(2 * np.pi * (kx * x + ky * y) + rng.uniform(0, 6))
    return smooth


def functionals(scene: ThreadScene, light: Light | None) -> dict[str, torch.Tensor]:
    """Smooth weights and the residual to another pose, each over colour and over position, (H, W, 6)."""
    other = [0.01, -0.008, 0.012, 0.015, -0.01, 0.02, 0.15, -0.1, 0.2, 0.01, 0.015, -0.01]
    fine = Renderer(scene.topology, LENS, supersample=16)
    with torch.no_grad():
        zero = torch.zeros(12, dtype=torch.float64)
        residual = rgb_xyz(moved(scene, fine, zero, light)) - rgb_xyz(
            moved(scene, fine, torch.tensor(other, dtype=torch.float64), light)
        )
    rgb = torch.tensor([1.0, 1, 1, 0, 0, 0], dtype=torch.float64)
    weights = {"smooth": torch.from_numpy(smooth_image(6)), "residual": residual}
    return {f"{n} {c}": w * m for n, w in weights.items() for c, m in (("rgb", rgb), ("xyz", 1 - rgb))}


def differences(image: Callable[[torch.Tensor], torch.Tensor], span: np.ndarray) -> torch.Tensor:
    """Central differences (P, ...) of an image around p = 0."""
    rows = []
    with torch.no_grad():
        for k, h in enumerate(span):
            p = torch.zeros(len(span), dtype=torch.float64)
            p[k] = h
            rows.append((image(p) - image(-p)) / (2 * h))
    return torch.stack(rows)


@dataclass(frozen=True, eq=False)
class PoseReference:
    """What the pose gradient of some functionals of the image should be."""

    weights: dict[str, torch.Tensor]  # (H, W, 6) per functional
    expected_gradients: dict[
        str, torch.Tensor
    ]  # (12,) per functional, by differences of an image of 16 x 16 samples

    @staticmethod
    def of(scene: ThreadScene, light: Light | None = None) -> PoseReference:
        """Renders 24 images and two more; some seconds."""
        fine = Renderer(scene.topology, LENS, supersample=16)
        rows = differences(lambda p: rgb_xyz(moved(scene, fine, p, light)), SPAN)
        weights = functionals(scene, light)
        return PoseReference(weights, {n: (rows * w).sum(dim=(1, 2, 3)) for n, w in weights.items()})

    def errors(self, gradients: dict[str, torch.Tensor]) -> dict[str, list[float]]:
        """Relative errors per functional, over the four blocks of three parameters."""
        return {
            name: [
                float((gradients[name][k : k + 3] - expected[k : k + 3]).norm() / expected[k : k + 3].norm())
                for k in range(0, 12, 3)
            ]
            for name, expected in self.expected_gradients.items()
        }


def pose_gradients(
    scene: ThreadScene, reference: PoseReference, light: Light | None = None
) -> dict[str, torch.Tensor]:
    """The renderer's own gradient (12,) of each functional."""
    plain = Renderer(scene.topology, LENS)
    result = {}
    for name, weights in reference.weights.items():
        p = torch.zeros(12, dtype=torch.float64, requires_grad=True)
        (result[name],) = torch.autograd.grad((rgb_xyz(moved(scene, plain, p, light)) * weights).sum(), p)
    return result
