"""All triangles of the model: bodies and chain with colour groups, table, tool and tool arm without."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from samrl_core.cell.robots.geometry import link_shapes
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Part, Rgb, Scene, SurfaceMesh
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.scene.chain_skin import CHAIN, ChainSkin, chain_skin
from samrl_core.model.scene.color_groups import color_groups
from samrl_core.model.scene.meshes import face_normals, flatten, part_mesh
from samrl_core.model.scene.settings import ModelSettings

TABLE_LABEL = 0
TOOL_ARM_LABEL = 3
_WORLD = "world"


@dataclass(frozen=True, eq=False)
class Piece:
    """A closed surface that moves as one, or the tool's chain."""

    frame: str  # body or link that carries it, "world", or `CHAIN`
    vertices: np.ndarray  # (V, 3) in that frame [m]
    faces: np.ndarray  # (F, 3) int32
    normals: np.ndarray  # (V, 3) unit, in that frame
    group: np.ndarray  # (V,) colour group, -1 for a fixed colour
    color: np.ndarray  # (V, 3) linear RGB before shading, used where group is -1
    label: int
    tensor: torch.Tensor  # (V, 3) float64, the vertices again


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """Pieces in rendering order, their common topology and the colour groups."""

    pieces: tuple[Piece, ...]
    skin: ChainSkin | None  # of the piece in frame `CHAIN`, if the tool has a chain
    topology: Topology
    fixed: dict[str, Pose]  # poses in world of frames that neither parameters nor joints move
    color_names: tuple[str, ...]
    initial_colors: np.ndarray  # (G, 3)
    group: torch.Tensor  # (V,) int64, 0 where the colour is fixed
    is_grouped: torch.Tensor  # (V,) bool
    fixed_color: np.ndarray  # (V, 3)

    @cached_property
    def palette(self) -> tuple[np.ndarray, np.ndarray]:
        """The distinct fixed colours (C, 3), and which one each vertex has (V,)."""
        colors, which = np.unique(self.fixed_color, axis=0, return_inverse=True)
        return colors, which.reshape(-1)

    def target_of(self, frames: Collection[str]) -> np.ndarray:
        """1 on the vertices in any of the frames, else 0, (V,) float32."""
        return np.concatenate([np.full(len(p.vertices), p.frame in frames, np.float32) for p in self.pieces])

    def vertex_colors(self, colors: torch.Tensor, rest: torch.Tensor) -> torch.Tensor:
        """Colours (V, 3) from the groups' colours (G, 3), or from `rest` (V, 3) where there is no group."""
        return torch.where(self.is_grouped[:, None], colors[self.group], rest)


def build_scene_mesh(scene: Scene, cell: CellSpec, settings: ModelSettings) -> SceneMesh:
    """Meshes of a scene in a cell; settings as in `ModelSettings`."""
    pieces: list[Piece] = []
    names: list[str] = []
    initial: list[np.ndarray] = []
    for body in scene.bodies:
        groups = color_groups(body, settings.ambient, np.array(settings.towards_light))
        pieces.append(_body_piece(body, groups.face_group, len(names)))
        names += groups.names
        initial.append(groups.initial)
    skin = chain_skin(scene.tool.chain, settings.ambient) if scene.tool.chain else None
    if skin is not None:
        pieces.append(_chain_piece(skin, len(names)))
        names += skin.names
        initial.append(skin.initial)
    pieces.append(_table(settings))
    flange, tip = cell.tool_arm.flange, scene.tool.tip_in_flange.position
    distance = [float(np.linalg.norm(part.part_in_body.position - tip)) for part in scene.tool.parts]
    for k, part in enumerate(scene.tool.parts):
        # What reaches the tip is the tool itself; the rest is the hand that holds it.
        color = scene.tool.color if k == int(np.argmin(distance)) else settings.hand_color
        pieces.append(_part_piece(flange, part, color, scene.tool.label))
    for link, parts in link_shapes(cell.tool_arm).items():
        pieces += [_part_piece(link, part, settings.arm_color, TOOL_ARM_LABEL) for part in parts]
    starts = np.cumsum([0] + [len(p.vertices) for p in pieces])
    surfaces = [np.full(len(p.vertices), k) for k, p in enumerate(pieces)]
    if skin is not None:  # links of its own shape each are surfaces of their own
        surfaces[len(scene.bodies)] = len(pieces) + skin.part
    topology = Topology.build(
        np.concatenate([p.vertices for p in pieces]),
        np.concatenate([p.faces + n for p, n in zip(pieces, starts[:-1], strict=True)]),
        np.concatenate([np.full(len(p.vertices), p.label) for p in pieces]),
        np.concatenate(surfaces),
    )
    group = np.concatenate([p.group for p in pieces])
    return SceneMesh(
        tuple(pieces),
        skin,
        topology,
        {_WORLD: Pose.identity(), **{b.name: b.body_in_world for b in scene.bodies}},
        tuple(names),
        np.concatenate(initial) if initial else np.zeros((0, 3)),
        torch.from_numpy(np.maximum(group, 0)),
        torch.from_numpy(group >= 0),
        np.concatenate([p.color for p in pieces]),
    )


def _body_piece(body: Body, face_group: np.ndarray, first_group: int) -> Piece:
    flat = flatten(body.mesh, face_group)
    n = len(flat.vertices)
    normals = np.zeros((n, 3))  # a group's colour holds its shading
    return Piece(
        body.name,
        flat.vertices,
        flat.faces,
        normals,
        flat.group + first_group,
        np.zeros((n, 3)),
        body.label,
        torch.from_numpy(flat.vertices.copy()),
    )


def _chain_piece(skin: ChainSkin, first_group: int) -> Piece:
    zeros = np.zeros(skin.vertices.shape)  # a group's colour holds its shading
    tensor = torch.from_numpy(skin.vertices.copy())
    group = skin.group + first_group
    return Piece(CHAIN, skin.vertices, skin.faces, zeros, group, zeros, skin.label, tensor)


def _part_piece(frame: str, part: Part, color: Rgb, label: int) -> Piece:
    return _flat_piece(frame, part_mesh(part, color), color, label)


def _table(settings: ModelSettings) -> Piece:
    (x, y), (a, b) = settings.table_center, (0.5 * settings.table_size[0], 0.5 * settings.table_size[1])
    z = settings.table_height
    corners = np.array([[x - a, y - b, z], [x + a, y - b, z], [x + a, y + b, z], [x - a, y + b, z]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    mesh = SurfaceMesh(corners, faces, np.tile(settings.table_color, (2, 1)))
    return _flat_piece(_WORLD, mesh, settings.table_color, TABLE_LABEL)


def _flat_piece(frame: str, mesh: SurfaceMesh, color: Rgb, label: int) -> Piece:
    """Faces of one direction share a shade, so vertices are doubled where the direction changes."""
    normals = face_normals(mesh.vertices, mesh.faces)
    direction = np.unique(np.round(normals, 3), axis=0, return_inverse=True)[1].reshape(-1)
    flat = flatten(mesh, direction)
    of_direction = np.zeros((direction.max() + 1, 3))
    of_direction[direction] = normals
    n = len(flat.vertices)
    return Piece(
        frame,
        flat.vertices,
        flat.faces,
        of_direction[flat.group],
        np.full(n, -1, dtype=np.int64),
        np.tile(color, (n, 1)),
        label,
        torch.from_numpy(flat.vertices.copy()),
    )
