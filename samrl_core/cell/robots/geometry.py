"""Shapes of an arm's links, and the coarse clearance between things made of such shapes."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.robots.urdf import mesh_file, numbers, origin_of, read_urdf
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Capsule, Cylinder, Part
from samrl_core.common.errors import InputError

WIDE = 0.05  # second longest half edge from which on a thin box is a plate, cut into strips [m]
STRIP = 0.01  # half width of such a strip at most; a plate is thinner than that [m]


def link_shapes(spec: RobotSpec) -> dict[str, tuple[Part, ...]]:
    """Collision shapes per link, poses in the link frame; links without shapes are left out.

    A sphere becomes the cylinder that just holds it, a mesh the box along its axes.

    Raises:
        InputError: no such URDF or mesh, or a shape of an unknown kind.
    """
    shapes: dict[str, tuple[Part, ...]] = {}
    for link in read_urdf(spec.urdf).findall("link"):
        parts = tuple(_part(spec, link, collision) for collision in link.findall("collision"))
        if parts:
            shapes[str(link.get("name"))] = parts
    return shapes


def _part(spec: RobotSpec, link: ElementTree.Element, collision: ElementTree.Element) -> Part:
    geometry = collision.find("geometry")
    kinds = [] if geometry is None else list(geometry)
    pose = origin_of(collision)
    if len(kinds) == 1 and kinds[0].tag == "box":
        x, y, z = (0.5 * numbers(kinds[0], "size", "", 3)).tolist()
        return Box((x, y, z), pose)
    if len(kinds) == 1 and kinds[0].tag in ("cylinder", "sphere"):
        radius = float(numbers(kinds[0], "radius", "", 1)[0])
        is_sphere = kinds[0].tag == "sphere"
        length = 2.0 * radius if is_sphere else float(numbers(kinds[0], "length", "", 1)[0])
        return Cylinder(radius, length, pose)
    if len(kinds) == 1 and kinds[0].tag == "mesh":
        return _box_about(mesh_file(spec.urdf, kinds[0]), numbers(kinds[0], "scale", "1 1 1", 3), pose)
    raise InputError(
        f"link '{link.get('name')}' of {spec.urdf} has collision shape {[k.tag for k in kinds]}; only box, "
        "cylinder, sphere and mesh are read: replace it by such shapes"
    )


def _box_about(file: Path, scale: np.ndarray, pose: Pose) -> Box:
    """The box along a mesh's axes that just holds it.

    Raises:
        InputError: the file holds no triangles.
    """
    import trimesh  # here: a tenth of a second that most arms do not need

    try:
        low, high = trimesh.load_mesh(file).bounds * scale
    except (ValueError, TypeError) as error:
        raise InputError(
            f"{file} holds no mesh that can be read ({error}); give an STL, OBJ or PLY"
        ) from error
    x, y, z = (0.5 * np.abs(high - low)).tolist()
    return Box((x, y, z), pose @ Pose(0.5 * (low + high), np.array([0.0, 0.0, 0.0, 1.0])))


@dataclass(frozen=True, eq=False)
class Capsules:
    """N line segments with a radius."""

    start: np.ndarray  # (N, 3) [m]
    end: np.ndarray  # (N, 3) [m]
    radius: np.ndarray  # (N,) [m]

    @staticmethod
    def of_parts(parts: Sequence[Part], body_in_world: Pose) -> Capsules:
        """Capsules about each part; they hold it whole, so a clearance is never overstated.

        One for each part, but for wide plates, which it would make as thick as they are wide: these are cut
        into strips.
        """
        pieces = [piece for part in parts for piece in _strips(part)]
        starts, ends, radii = np.empty((len(pieces), 3)), np.empty((len(pieces), 3)), np.empty(len(pieces))
        for k, part in enumerate(pieces):
            if isinstance(part, Cylinder | Capsule):
                axis, half, radii[k] = 2, 0.5 * part.length, part.radius
            else:
                axis = int(np.argmax(part.half_extents))
                half = part.half_extents[axis]
                radii[k] = np.linalg.norm(np.delete(part.half_extents, axis))
            tip = np.zeros(3)
            tip[axis] = half
            part_in_world = body_in_world @ part.part_in_body
            starts[k], ends[k] = part_in_world.apply(np.stack([-tip, tip]))
        return Capsules(starts, ends, radii)

    @staticmethod
    def of_arm(shapes: Mapping[str, Sequence[Part]], link_poses_in_world: Mapping[str, Pose]) -> Capsules:
        """Capsules of `link_shapes` at `ArmModel.link_poses_in_world`; links may be left out of `shapes`.

        Raises:
            InputError: a link with shapes has no pose.
        """
        missing = sorted(set(shapes) - set(link_poses_in_world))
        if missing:
            raise InputError(f"no pose for links {missing}; shapes and poses must come from the same arm")
        return Capsules.joined(Capsules.of_parts(p, link_poses_in_world[name]) for name, p in shapes.items())

    @staticmethod
    def joined(many: Iterable[Capsules]) -> Capsules:
        """All of them together."""
        all_ = [Capsules(np.empty((0, 3)), np.empty((0, 3)), np.empty(0)), *many]
        return Capsules(
            np.concatenate([c.start for c in all_]),
            np.concatenate([c.end for c in all_]),
            np.concatenate([c.radius for c in all_]),
        )

    def lowest(self) -> float:
        """Height of the lowest point above z = 0 [m]; infinite when there are none."""
        return float(np.min(np.minimum(self.start[:, 2], self.end[:, 2]) - self.radius, initial=np.inf))


def _strips(part: Part) -> tuple[Part, ...]:
    """A plate, cut across its second longest edge; any other part as it is."""
    if not isinstance(part, Box):
        return (part,)
    thin, across, _ = np.argsort(part.half_extents)
    width = part.half_extents[across]
    if width <= WIDE or part.half_extents[thin] >= STRIP:
        return (part,)
    count = math.ceil(width / STRIP)
    half = np.array(part.half_extents)
    half[across] = width / count
    strips = []
    for k in range(count):
        middle = np.zeros(3)
        middle[across] = (2 * k + 1 - count) * half[across]
        place = part.part_in_body @ Pose(middle, np.array([0.0, 0.0, 0.0, 1.0]))
        strips.append(Box((float(half[0]), float(half[1]), float(half[2])), place))
    return tuple(strips)


def clearance(a: Capsules, b: Capsules) -> float:
    """Smallest distance between the surfaces of two sets [m], negative when they overlap.

    Infinite when one set is empty.
    """
    if not len(a.radius) or not len(b.radius):
        return float("inf")
    distance = segment_distance(a.start[:, None], a.end[:, None], b.start[None], b.end[None])
    return float((distance - a.radius[:, None] - b.radius[None]).min())


def segment_distance(p0: np.ndarray, p1: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Distance between segments p0-p1 and q0-q1, each (..., 3) [m], shape (...).

    The least distance is at an end of one of the two, or between two inner points of the lines (Ericson,
    Real-Time Collision Detection, section 5.1.9); all five candidates are taken.
    """
    u, v, w = p1 - p0, q1 - q0, p0 - q0
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    determinant = uu * vv - uv * uv
    inner = determinant > 1e-12 * np.maximum(uu * vv, 1e-12)  # else parallel, or a point: ends suffice
    safe = np.where(inner, determinant, 1.0)
    s = np.where(inner, np.clip((uv * vw - vv * uw) / safe, 0.0, 1.0), 0.0)
    t = np.where(inner, np.clip((uu * vw - uv * uw) / safe, 0.0, 1.0), 0.0)
    squared = [_gap(w, u, v, s, t)]
    for end in (0.0, 1.0):
        fixed = np.full_like(uu, end)
        squared.append(_gap(w, u, v, fixed, np.clip((vw + fixed * uv) / np.maximum(vv, 1e-18), 0.0, 1.0)))
        squared.append(_gap(w, u, v, np.clip((fixed * uv - uw) / np.maximum(uu, 1e-18), 0.0, 1.0), fixed))
    return np.sqrt(np.min(squared, axis=0))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _gap(w: np.ndarray, u: np.ndarray, v: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    d = w + s[..., None] * u - t[..., None] * v
    return _dot(d, d)
