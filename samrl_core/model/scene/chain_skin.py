"""The surface of the chain that hangs from the tool: one smooth tube for a thread, else its links' parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.types.scene import Capsule, ChainLink, SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.scene.body_motion import TensorPose
from samrl_core.model.scene.meshes import ball_rings, flatten, part_mesh, revolved_mesh

CHAIN = "<chain>"  # frame of its piece; no body can have this name
_SEGMENTS = 12  # of a thread some pixels wide
_MEAN_COSINE = 0.25  # of a surface to a light, mean over all directions, 0 where it faces away


@dataclass(frozen=True, eq=False)
class ChainSkin:
    """Vertices that hang from two links each: at a joint half from either, elsewhere twice from one.

    Capsules that meet at a joint would share their round ends, two coincident surfaces, whose outlines
    have no well-defined gradient (and whose colours would flicker). A tube has one surface there; for small
    bends it lies on the capsules (linear blend skinning; off by radius x (1 - cos(bend / 2)) at a joint).
    """

    vertices: np.ndarray  # (V, 3) of the straight chain, in the tip's frame [m]
    faces: np.ndarray  # (F, 3) int32
    part: np.ndarray  # (V,) number of the closed surface
    link: np.ndarray  # (V, 2) int64 of the two carriers
    local: torch.Tensor  # (V, 2, 3) float64 in their frames [m]
    group: np.ndarray  # (V,) int64 colour group
    names: tuple[str, ...]  # of the colour groups, "chain/<first link of that colour>"
    initial: np.ndarray  # (G, 3) linear RGB
    label: int

    def posed(self, links: TensorPose) -> torch.Tensor:
        """Vertices (..., V, 3) in world [m] for link rotations (..., K, 3, 3) and positions (..., K, 3)."""
        carriers = torch.from_numpy(self.link).to(links.position.device)
        local = self.local.to(links.position.device)[..., None]
        turned = (links.rotation[..., carriers, :, :] @ local)[..., 0] + links.position[..., carriers, :]
        return turned.mean(dim=-2)


def chain_skin(chain: Sequence[ChainLink], ambient: float) -> ChainSkin:
    """Surface of K >= 1 links. A group starts with its CAD colour under the mean light of all directions.

    Raises:
        InputError: the links have more than one label, or a part has no mesh.
    """
    labels = sorted({link.label for link in chain})
    if len(labels) != 1:
        raise InputError(f"links of the chain have labels {labels}; one thing needs one label")
    colors = list(dict.fromkeys(link.color for link in chain))
    group_of = np.array([colors.index(link.color) for link in chain])
    names = tuple(f"chain/{chain[int(np.argmax(group_of == g))].name}" for g in range(len(colors)))
    initial = np.clip((ambient + (1.0 - ambient) * _MEAN_COSINE) * np.array(colors), 0.0, 1.0)
    mesh, part, carriers, face_link = _tube(chain) if _is_thread(chain) else _rigid(chain)
    flat = flatten(mesh, group_of[face_link])
    # `flatten` keeps the order (vertex, group), so the original vertex is found again the same way.
    pairs = np.column_stack([mesh.faces.reshape(-1), np.repeat(group_of[face_link], 3)])
    source = np.unique(pairs, axis=0)[:, 0]
    starts = np.cumsum([0.0] + [link.length for link in chain])[:-1]
    link = carriers[source]
    local = np.repeat(flat.vertices[:, None], 2, axis=1)
    local[..., 2] -= starts[link]
    return ChainSkin(
        flat.vertices,
        flat.faces,
        part[source],
        link,
        torch.from_numpy(local),
        flat.group,
        names,
        initial,
        labels[0],
    )


def _is_thread(chain: Sequence[ChainLink]) -> bool:
    """Whether every link is one capsule of the same radius from its joints to the next."""
    for link in chain:
        part = link.parts[0] if len(link.parts) == 1 else None
        if not isinstance(part, Capsule):
            return False
        ends = part.part_in_body.apply(0.5 * part.length * np.array([[0, 0, -1.0], [0, 0, 1.0]]))
        along = np.abs(ends - [[0, 0, 0], [0, 0, link.length]]).max() < 1e-6 * link.length
        first = chain[0].parts[0]
        if not along or not isinstance(first, Capsule) or part.radius != first.radius:
            return False
    return True


def _tube(chain: Sequence[ChainLink]) -> tuple[SurfaceMesh, np.ndarray, np.ndarray, np.ndarray]:
    """A ring at every joint, half balls at the ends; the links of vertices and faces."""
    part = chain[0].parts[0]
    assert isinstance(part, Capsule)
    r, z = ball_rings(part.radius)
    joints = np.cumsum([0.0] + [link.length for link in chain])
    radius = np.concatenate([r, np.full(len(chain) - 1, part.radius), r[::-1]])
    height = np.concatenate([-z, joints[1:-1], z[::-1] + joints[-1]])
    mesh = revolved_mesh(radius, height, chain[0].color, _SEGMENTS)
    at = mesh.vertices[:, 2]
    low = np.clip(np.searchsorted(joints, at - 1e-9, side="right") - 1, 0, len(chain) - 1)
    high = np.clip(np.searchsorted(joints, at + 1e-9, side="right") - 1, 0, len(chain) - 1)
    middle = at[mesh.faces].mean(axis=1)
    face_link = np.clip(np.searchsorted(joints, middle, side="right") - 1, 0, len(chain) - 1)
    return mesh, np.zeros(len(at), dtype=np.int64), np.stack([low, high], axis=1), face_link


def _rigid(chain: Sequence[ChainLink]) -> tuple[SurfaceMesh, np.ndarray, np.ndarray, np.ndarray]:
    """The meshes of all parts, each carried by its link."""
    vertices, faces, part, carrier, face_link = [], [], [], [], []
    start, count, above = 0, 0, 0.0
    for k, link in enumerate(chain):
        for one in link.parts:
            mesh = part_mesh(one, link.color, _SEGMENTS)
            vertices.append(mesh.vertices + [0.0, 0.0, above])
            faces.append(mesh.faces + start)
            part.append(np.full(len(mesh.vertices), count))
            carrier.append(np.full((len(mesh.vertices), 2), k))
            face_link.append(np.full(len(mesh.faces), k))
            start, count = start + len(mesh.vertices), count + 1
        above += link.length
    if not vertices:
        raise InputError("the chain's links have no parts; nothing of it could be rendered")
    mesh = SurfaceMesh(np.concatenate(vertices), np.concatenate(faces), np.zeros((sum(map(len, faces)), 3)))
    return mesh, np.concatenate(part), np.concatenate(carrier), np.concatenate(face_link)
