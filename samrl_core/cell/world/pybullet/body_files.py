"""URDF and OBJ files that a simulator reads, written from the cell's own types."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.geometry import link_shapes
from samrl_core.cell.robots.robot import CellSpec, RobotSpec
from samrl_core.cell.types.pose import Pose, rpy_from_rotation
from samrl_core.cell.types.scene import Body, Box, Capsule, ChainLink, Part, Rgb, SurfaceMesh, Tool
from samrl_core.cell.world.pybullet.arm_meshes import MeshVisual
from samrl_core.cell.world.table import TABLE_FRICTION
from samrl_core.common.errors import InputError

PAYLOAD_LINK = "payload"


@dataclass(frozen=True, eq=False)
class Mounted:
    """A rigid load on an arm's flange, in the flange frame."""

    parts: tuple[Part, ...]
    part_colors: tuple[Rgb, ...]  # per part
    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) [m]
    inertia: np.ndarray  # (3, 3) about the centre of mass, flange axes [kg m2]
    friction: float  # [-]

    @staticmethod
    def of_tool(tool: Tool) -> Mounted:
        """The task's tool; the part at the tip has the tool's colour, the rest is the gripper's grey."""
        reach = [abs(part.part_in_body.position[2]) for part in tool.parts]
        farthest = int(np.argmax(reach))
        colors = tuple(tool.color if i == farthest else GRIPPER_COLOR for i in range(len(tool.parts)))
        return Mounted(tool.parts, colors, tool.mass, tool.center_of_mass, tool.inertia, tool.friction)


# Housing of the RealSense D435 (datasheet: 90 x 25 x 25 mm); it ends short of the optical frame.
CAMERA_HALF_EXTENTS = (0.045, 0.0125, 0.0125)  # [m]
CAMERA_COLOR: Rgb = (0.8, 0.8, 0.82)
GRIPPER_COLOR: Rgb = (0.75, 0.75, 0.75)
ARM_COLOR: Rgb = (0.85, 0.85, 0.85)  # of links whose shapes are meshes in the URDF


def camera_housing(cell: CellSpec) -> Mounted:
    """The cell's camera on its arm."""
    center = cell.camera_center_of_mass
    housing = Box(CAMERA_HALF_EXTENTS, Pose(center, np.array([0.0, 0.0, 0.0, 1.0])))
    return Mounted((housing,), (CAMERA_COLOR,), cell.camera_mass, center, cell.camera_inertia, TABLE_FRICTION)


def write_arm_urdf(
    spec: RobotSpec,
    payload: Mounted,
    folder: Path,
    chain: tuple[ChainLink, ...],
    tip_in_flange: Pose,
    meshes: Mapping[str, Sequence[MeshVisual]],
) -> Path:
    """The arm's URDF with `payload` as one more link, fixed to the flange, and a chain hanging at the tip.

    Links that are drawn as meshes get the shapes of `link_shapes`, which the model has too. `meshes` by link
    are shown in place of as many shapes, the last ones; an arm's link has none of its own then.

    Raises:
        InputError: the arm has no such flange link, or already has a link of a name to be added.
    """
    tree = ElementTree.parse(spec.urdf)
    robot = tree.getroot()
    links = {link.get("name") for link in robot.findall("link")}
    if spec.flange not in links:
        raise InputError(f"{spec.urdf.name} has no link {spec.flange!r}; it has {sorted(map(str, links))}")
    for name in (PAYLOAD_LINK, *(link.name for link in chain)):
        if name in links:
            raise InputError(f"{spec.urdf.name} has a link {name!r} already; rename it")
    for bare in robot.findall("link"):
        if bare.find("inertial") is None:  # a frame only; PyBullet would give it 1 kg
            _add_inertial(bare, 0.0, np.zeros(3), np.zeros((3, 3)))
    shapes = link_shapes(spec)
    for meshed in robot.findall("link"):
        if meshed.find(".//mesh") is not None:
            for shape in meshed.findall("visual") + meshed.findall("collision"):
                meshed.remove(shape)
            parts = shapes.get(name := str(meshed.get("name")), ())
            _add_parts(meshed, name, parts, (ARM_COLOR,) * len(parts))
    for meshed in robot.findall("link"):
        if shown := meshes.get(str(meshed.get("name"))):
            for shape in meshed.findall("visual"):
                meshed.remove(shape)
            _add_meshes(meshed, shown)
    link = ElementTree.SubElement(robot, "link", name=PAYLOAD_LINK)
    _add_inertial(link, payload.mass, payload.center_of_mass, payload.inertia)
    _add_parts(link, PAYLOAD_LINK, payload.parts, payload.part_colors)
    if shown := meshes.get(PAYLOAD_LINK):
        for shape in link.findall("visual")[-len(shown) :]:
            link.remove(shape)
        _add_meshes(link, shown)
    joint = ElementTree.SubElement(robot, "joint", name=f"{PAYLOAD_LINK}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=spec.flange)
    ElementTree.SubElement(joint, "child", link=PAYLOAD_LINK)
    parent, place = PAYLOAD_LINK, tip_in_flange
    for one in chain:
        _add_chain_link(robot, one, parent, place)
        parent, place = one.name, Pose(np.array([0.0, 0.0, one.length]), Pose.identity().quat_xyzw)
    return _write(robot, folder / f"{spec.name}_with_payload.urdf")


def joint_names(link: ChainLink) -> tuple[str, str]:
    """Names of a chain link's joints, about x and about y."""
    return f"{link.name}_x", f"{link.name}_y"


def write_body_urdf(body: Body, folder: Path) -> Path:
    """A body: its parts to touch, its mesh to look at, one OBJ file per colour.

    Raises:
        InputError: the mass is negative, or a movable body's inertia is none that a body can have.
    """
    moments = np.linalg.eigvalsh(body.inertia)
    if body.mass < 0.0 or (body.mass > 0.0 and not (moments[0] > 0 and moments[0] + moments[1] > moments[2])):
        raise InputError(
            f"body {body.name!r} has mass {body.mass} kg and principal moments of inertia {moments} kg m2; a "
            f"movable body needs three positive ones, none above the sum of the others, a fixed one mass 0"
        )
    robot = ElementTree.Element("robot", name=body.name)
    link = ElementTree.SubElement(robot, "link", name=body.name)
    _add_inertial(link, body.mass, np.zeros(3), body.inertia)
    colors, group = np.unique(body.mesh.face_color, axis=0, return_inverse=True)
    for i, color in enumerate(colors):
        obj = folder / f"{body.name}_{i}.obj"
        write_flat_obj(body.mesh, np.flatnonzero(group.ravel() == i), obj)
        visual = ElementTree.SubElement(link, "visual")
        geometry = ElementTree.SubElement(visual, "geometry")
        ElementTree.SubElement(geometry, "mesh", filename=str(obj))
        material = ElementTree.SubElement(visual, "material", name=f"{body.name}_{i}")
        ElementTree.SubElement(material, "color", rgba=_numbers(*color, 1.0))
    for part in body.parts:
        _add_shape(link, "collision", part)
    return _write(robot, folder / f"{body.name}.urdf")


def write_flat_obj(mesh: SurfaceMesh, faces: np.ndarray, path: Path) -> None:
    """Write the chosen faces with one normal each; shared vertices would be shaded round."""
    corners = mesh.vertices[mesh.faces[faces]]  # (F, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in corners.reshape(-1, 3)]
    lines += [f"vn {x:.9f} {y:.9f} {z:.9f}" for x, y, z in normals]
    for i in range(len(faces)):
        a, n = 3 * i + 1, i + 1
        lines.append(f"f {a}//{n} {a + 1}//{n} {a + 2}//{n}")
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _write(robot: ElementTree.Element, path: Path) -> Path:
    tree = ElementTree.ElementTree(robot)
    ElementTree.indent(tree)  # PyBullet tears lines of more than 1023 characters
    tree.write(path)
    return path


def _add_parts(
    link: ElementTree.Element, name: str, parts: tuple[Part, ...], colors: tuple[Rgb, ...]
) -> None:
    for i, (part, color) in enumerate(zip(parts, colors, strict=True)):
        visual = _add_shape(link, "visual", part)
        material = ElementTree.SubElement(visual, "material", name=f"{name}_{i}")
        ElementTree.SubElement(material, "color", rgba=_numbers(*color, 1.0))
        _add_shape(link, "collision", part)


def _add_meshes(link: ElementTree.Element, meshes: Sequence[MeshVisual]) -> None:
    for i, mesh in enumerate(meshes):
        visual = ElementTree.SubElement(link, "visual")
        _add_origin(visual, mesh.mesh_in_link.position, mesh.mesh_in_link.rotation)
        geometry = ElementTree.SubElement(visual, "geometry")
        ElementTree.SubElement(geometry, "mesh", filename=str(mesh.file))
        material = ElementTree.SubElement(visual, "material", name=f"{link.get('name')}_mesh_{i}")
        ElementTree.SubElement(material, "color", rgba=_numbers(*mesh.color, 1.0))


def _add_chain_link(robot: ElementTree.Element, link: ChainLink, parent: str, place: Pose) -> None:
    """The link and, between its two joints, a cross without mass."""
    cross = f"{link.name}_cross"
    _add_inertial(ElementTree.SubElement(robot, "link", name=cross), 0.0, np.zeros(3), np.zeros((3, 3)))
    body = ElementTree.SubElement(robot, "link", name=link.name)
    _add_inertial(body, link.mass, link.center_of_mass, link.inertia)
    _add_parts(body, link.name, link.parts, (link.color,) * len(link.parts))
    joints = zip(joint_names(link), (parent, cross), (cross, link.name), ("1 0 0", "0 1 0"), strict=True)
    for name, before, after, axis in joints:
        joint = ElementTree.SubElement(robot, "joint", name=name, type="continuous")
        ElementTree.SubElement(joint, "parent", link=before)
        ElementTree.SubElement(joint, "child", link=after)
        ElementTree.SubElement(joint, "axis", xyz=axis)
        if before == parent:
            _add_origin(joint, place.position, place.rotation)


def _add_inertial(link: ElementTree.Element, mass: float, centre: np.ndarray, inertia: np.ndarray) -> None:
    # Principal axes in the frame, so that no reader has to diagonalise.
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    element = ElementTree.SubElement(link, "inertial")
    _add_origin(element, centre, axes)
    ElementTree.SubElement(element, "mass", value=_numbers(mass))
    ElementTree.SubElement(
        element,
        "inertia",
        ixx=_numbers(moments[0]),
        iyy=_numbers(moments[1]),
        izz=_numbers(moments[2]),
        ixy="0",
        ixz="0",
        iyz="0",
    )


def _add_shape(link: ElementTree.Element, kind: str, part: Part) -> ElementTree.Element:
    shape = ElementTree.SubElement(link, kind)
    _add_origin(shape, part.part_in_body.position, part.part_in_body.rotation)
    geometry = ElementTree.SubElement(shape, "geometry")
    if isinstance(part, Box):
        ElementTree.SubElement(geometry, "box", size=_numbers(*(2 * h for h in part.half_extents)))
    else:
        shape_name = "capsule" if isinstance(part, Capsule) else "cylinder"
        ElementTree.SubElement(
            geometry, shape_name, radius=_numbers(part.radius), length=_numbers(part.length)
        )
    return shape


def _add_origin(element: ElementTree.Element, position: np.ndarray, rotation: np.ndarray) -> None:
    rpy = rpy_from_rotation(rotation)
    ElementTree.SubElement(element, "origin", xyz=_numbers(*position), rpy=_numbers(*rpy))


def _numbers(*values: float) -> str:
    return " ".join(f"{float(v):.12g}" for v in values)
