"""Whether a surface can be a body's: its faces, its edges, its winding and its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.scene import SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.rendering.topology import Topology

# Units that files are written in, by the metres of one; the first that gives a credible size is suspected.
_UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254}
FARTHEST = 1e6  # [m] of a vertex from the origin: 1 km in millimetres read as metres; squares stay finite


@dataclass(frozen=True)
class MeshLimits:
    """How much may be wrong. The counts' limits are 0, as for a closed body; a scan may be granted more."""

    flat_faces: int = 0  # of no area, or with the corners of an earlier one
    branching_edges: int = 0  # with more than two faces
    open_edges: int = 0  # with one face
    turned_edges: int = 0  # whose two faces are wound against each other
    smallest_extent: float = 5e-4  # of the longest side; a camera of the cell would not see less [m]
    largest_extent: float = 2.0  # of the longest side; the table is 1 m long [m]


@dataclass(frozen=True)
class MeshFaults:
    """What is wrong with a surface, and how large it is."""

    flat_faces: int
    branching_edges: int
    open_edges: int
    turned_edges: int
    volume: float  # signed, negative when wound inwards; of no meaning where edges are open [m3]
    extent: float  # longest side of the box about it, along the axes [m]


def mesh_faults(vertices: np.ndarray, faces: np.ndarray, part: np.ndarray | None = None) -> MeshFaults:
    """Counts faults; vertices of a part within 1 um of each other are one point.

    Args:
        vertices: (V, 3) [m].
        faces: (F, 3) integers.
        part: (V,) integers, closed surfaces that only touch each other have different ones; None for one.

    Raises:
        InputError: no faces or none with an area, a vertex that is not finite or farther than `FARTHEST`, an
            index out of range.
    """
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    count = len(vertices)
    broken = ~np.isfinite(vertices.reshape(count, -1)).all(axis=1)
    if broken.any():
        first = int(np.argmax(broken))
        raise InputError(
            f"{int(broken.sum())} of {count} vertices are not finite (vertex {first} is {vertices[first]}), "
            "none may be; export the mesh again or delete them with their faces"
        )
    far = float(np.abs(vertices).max(initial=0.0))
    if far > FARTHEST:
        first = int(np.argmax(np.abs(vertices).max(axis=1)))
        raise InputError(
            f"vertex {first} lies {far:.3g} m from the origin, the limit is {FARTHEST:g} m: no unit"
            " makes that a part of a cell; export the mesh again"
        )
    parts = np.zeros(count, dtype=np.int64) if part is None else part
    topology = Topology.build(vertices, faces, np.zeros(count, dtype=np.int32), parts)
    uses = np.diff(topology.edge_start)
    first = topology.edge_start[:-1][uses == 2]
    same_way = _along(topology, first) == _along(topology, first + 1)
    a, b, c = (vertices[topology.faces[:, k]] for k in range(3))
    return MeshFaults(
        flat_faces=len(topology.dropped),
        branching_edges=int((uses > 2).sum()),
        open_edges=int((uses == 1).sum()),
        turned_edges=int(same_way.sum()),
        volume=float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0),
        extent=float(np.ptp(vertices[np.unique(topology.faces)], axis=0).max()),
    )


def _along(topology: Topology, row: np.ndarray) -> np.ndarray:
    """Whether the face of each edge use passes the edge's ends in their order."""
    start, _, opposite, face = topology.edge_uses[row].T
    corners = topology.faces[face]
    # Of the three corners the one after `start` is the other end or, the other way round, the one opposite.
    after = corners[np.arange(len(row)), (np.argmax(corners == start[:, None], axis=1) + 1) % 3]
    return after != opposite


def require_sound(
    mesh: SurfaceMesh, name: str, limits: MeshLimits | None = None, part: np.ndarray | None = None
) -> None:
    """Refuses a surface that is no body's.

    Args:
        mesh: to check.
        name: of the mesh, for the message.
        limits: what is granted; None for a closed body of the cell's size.
        part: as for `mesh_faults`.

    Raises:
        InputError: a fault above its limit, colours that do not fit, faces wound inwards, or a size that
            suggests another unit.
    """
    limits = limits or MeshLimits()
    if np.shape(mesh.face_color) != (len(mesh.faces), 3) or not np.isfinite(mesh.face_color).all():
        raise InputError(
            f"{name}: colours have shape {np.shape(mesh.face_color)} or are not finite; give each of the "
            f"{len(mesh.faces)} faces three finite numbers"
        )
    try:
        found = mesh_faults(mesh.vertices, mesh.faces, part)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error
    _require_size(found.extent, name, limits)
    for count, limit, what, remedy in (
        (found.flat_faces, limits.flat_faces, "degenerate faces (no area, or repeated)", "delete them"),
        (
            found.branching_edges,
            limits.branching_edges,
            "non-manifold edges (more than two faces meet)",
            "split the mesh into closed parts there",
        ),
        (found.open_edges, limits.open_edges, "open edges (one face only)", "fill the holes"),
        (found.turned_edges, limits.turned_edges, "edges between faces of opposite winding", "wind alike"),
    ):
        if count > limit:
            raise InputError(
                f"{name}: {count} {what}, the limit is {limit}; {remedy} in the modelling program, or raise "
                "the limit if it is only to be rendered"
            )
    if found.open_edges == 0 and found.volume < 0.0:
        raise InputError(
            f"{name}: encloses {found.volume:.3g} m3, must be positive: wound inwards; flip its faces"
        )


def _require_size(extent: float, name: str, limits: MeshLimits) -> None:
    low, high = limits.smallest_extent, limits.largest_extent
    if low <= extent <= high:
        return
    factors = _UNITS if extent > high else {"metres read as millimetres": 1e3}
    suspects = [(unit, extent * factor) for unit, factor in factors.items() if low <= extent * factor <= high]
    guess = ""
    if suspects:
        unit, size = suspects[0]
        guess = f"; {unit} are suspected (that would be {size:.3g} m)"
    raise InputError(
        f"{name}: its longest side is {extent:.3g} m, must be {low:g} to {high:g} m{guess}; "
        "state the file's unit or widen the limits"
    )
