"""The surface of a URDF's link: its <visual> elements as one mesh in the link's frame."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from samrl_core.cell.robots.urdf import numbers, origin_of, read_urdf
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Cylinder, Rgb, SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.scene.mesh_checks import MeshLimits, require_sound
from samrl_core.model.scene.mesh_file import GREY, joined, read_parts
from samrl_core.model.scene.meshes import part_mesh

SEGMENTS = 32  # of a cylinder
_PACKAGE = "package://"


def load_urdf_link(
    path: Path,
    link: str,
    color: Rgb = GREY,
    packages: Mapping[str, Path] | None = None,
    limits: MeshLimits | None = None,
) -> SurfaceMesh:
    """What a link shows, in metres, as a URDF's lengths are; a mesh file counts after its `scale`.

    Args:
        path: URDF; mesh files with a relative name lie beside it.
        link: name of the link.
        color: where neither a material nor the mesh file gives one.
        packages: folder of each package that a `package://` name refers to.
        limits: what may be wrong with each visual; None for closed ones of the cell's size.

    Raises:
        InputError: no such file, link, package or mesh, nothing to see, an unknown shape, or a surface that
            `require_sound` refuses.

    Source: https://wiki.ros.org/urdf/XML/link (geometry, scale, material).
    """
    root = read_urdf(path)
    by_name = {element.get("name"): element for element in root.findall("link")}
    if link not in by_name:
        raise InputError(f"{path} has no link '{link}'; it has {sorted(map(str, by_name))}")
    materials = {str(m.get("name")): m for m in root.findall("material")}
    pieces = []
    for number, visual in enumerate(by_name[link].findall("visual")):
        name = f"visual {number} of link '{link}' of {path}"
        paint = _color_of(visual, materials, name)
        mesh, part = _geometry(visual, Path(path).parent, paint or color, dict(packages or {}), name)
        require_sound(mesh, f"{name} (a URDF is in metres; a mesh has a scale)", limits, part)
        if paint is not None:
            mesh = replace(mesh, face_color=np.tile(paint, (len(mesh.faces), 1)))
        pieces.append(SurfaceMesh(origin_of(visual).apply(mesh.vertices), mesh.faces, mesh.face_color))
    if not pieces:
        raise InputError(f"link '{link}' of {path} has no <visual>; it cannot be seen")
    return joined(pieces)[0]


def _color_of(
    visual: ElementTree.Element, materials: dict[str, ElementTree.Element], name: str
) -> Rgb | None:
    material = visual.find("material")
    if material is None:
        return None
    element = material.find("color")
    if element is None and material.find("texture") is None:
        referred = materials.get(str(material.get("name")))
        if referred is None:
            raise InputError(
                f"{name} refers to material '{material.get('name')}', the file defines {sorted(materials)}; "
                "define it, or give the visual a colour"
            )
        element = referred.find("color")
    if element is None:
        return None  # a texture: the mesh file's own colours are nearer than none
    r, g, b, _ = numbers(element, "rgba", "", 4).tolist()
    return (r, g, b)


def _geometry(
    visual: ElementTree.Element, folder: Path, color: Rgb, packages: dict[str, Path], name: str
) -> tuple[SurfaceMesh, np.ndarray]:
    geometry = visual.find("geometry")
    kinds = [] if geometry is None else list(geometry)
    shape = kinds[0] if len(kinds) == 1 else None
    if shape is not None and shape.tag == "mesh":
        scale = numbers(shape, "scale", "1 1 1", 3)
        if (scale == 0).any():
            raise InputError(f"{name} has scale {scale}, no factor may be 0")
        return read_parts(_resolved(shape.get("filename", ""), folder, packages, name), scale, color)
    if shape is not None and shape.tag == "box":
        x, y, z = (0.5 * numbers(shape, "size", "", 3)).tolist()
        return joined([part_mesh(Box((x, y, z), Pose.identity()), color)])
    if shape is not None and shape.tag == "cylinder":
        radius, length = (float(numbers(shape, a, "", 1)[0]) for a in ("radius", "length"))
        return joined([part_mesh(Cylinder(radius, length, Pose.identity()), color, SEGMENTS)])
    if shape is not None and shape.tag == "sphere":
        ball = trimesh.creation.icosphere(subdivisions=3, radius=float(numbers(shape, "radius", "", 1)[0]))
        faces = np.asarray(ball.faces, dtype=np.int32)
        return joined([SurfaceMesh(np.asarray(ball.vertices), faces, np.tile(color, (len(faces), 1)))])
    raise InputError(
        f"{name} has geometry {[k.tag for k in kinds]}, must be one of box, cylinder, sphere, mesh"
    )


def _resolved(filename: str, folder: Path, packages: dict[str, Path], name: str) -> Path:
    if filename.startswith(_PACKAGE):
        package, _, rest = filename[len(_PACKAGE) :].partition("/")
        if package not in packages:
            raise InputError(
                f"{name} is in package '{package}', folders are known of {sorted(packages)}; hand in its own"
            )
        return Path(packages[package]) / rest
    return folder / filename.removeprefix("file://")
