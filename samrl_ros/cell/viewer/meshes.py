"""Shapes of the arms for viewers: mesh files that are installed here stand in for a URDF's primitives."""

from __future__ import annotations

import base64
import importlib.util
import os
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, read_whole

SCHEME, GLB = "package://", ".glb"
MESH_BYTES = 100_000_000  # of a mesh file, at most
SUFFIXES = frozenset({".obj", ".stl", ".dae", ".glb", ".gltf", ".ply", ".mtl", ".png", ".jpg", ".jpeg"})


def package_file(uri: str) -> Path | None:
    """File of a `package://NAME/path`, None where it is not installed.

    A package is looked for in the ament prefixes, in this environment and in PyBullet's data. Nothing but
    meshes and their materials is found, and nothing outside of the package's folder.
    """
    name, _, inside = uri.removeprefix(SCHEME).partition("/")
    if not uri.startswith(SCHEME) or not inside or name in ("", ".", ".."):
        return None
    for folder in _package_folders(name):
        root = folder.resolve()
        file = (root / inside).resolve()
        if file.is_relative_to(root) and file.suffix.lower() in SUFFIXES and is_file(file):
            return file
    return None


def _package_folders(name: str) -> list[Path]:
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    folders = [Path(prefix) / "share" / name for prefix in [*prefixes, sys.prefix]]
    data = importlib.util.find_spec("pybullet_data")  # has the Panda's shapes as the package franka_panda
    if data is not None and data.submodule_search_locations:
        folders += [Path(place) / name for place in data.submodule_search_locations]
    return folders


def asset(uri: str) -> bytes | None:
    """Content of a mesh file for a viewer, None where there is none.

    Of `package://NAME/path.obj.glb` it is `path.obj` as binary glTF: OBJ and STL do not say which way is
    up, and viewers disagree about them.
    """
    file = package_file(uri)
    if file is not None:
        return read_whole(file, MESH_BYTES)
    source = package_file(uri.removesuffix(GLB)) if uri.endswith(GLB) else None
    return None if source is None else as_glb(source)


@lru_cache(maxsize=32)
def as_glb(path: Path) -> bytes:
    """A mesh file whose z points up, as binary glTF, whose y does.

    Raises:
        InputError: not a mesh that can be read.
    """
    try:
        scene = trimesh.load_scene(str(path))
        scene.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1.0, 0.0, 0.0]))
        return export_glb(scene)
    # What trimesh raises; ImportError where a file needs a package that is not here to guess its encoding.
    except (ValueError, OSError, LookupError, AttributeError, TypeError, ImportError) as error:
        raise InputError(f"{path} is no mesh that can be read: {error}; export it again") from error


def by_package(uri: str) -> str:
    """URL of a link's mesh for viewers that ask the connection for `package://`."""
    return uri + GLB


def by_value(uri: str) -> str:
    """URL that holds the mesh itself, for a file that is opened elsewhere."""
    file = package_file(uri)
    if file is None:
        raise InputError(f"{uri} is not installed; leave it out")
    return "data:model/gltf-binary;base64," + base64.b64encode(as_glb(file)).decode()


def with_meshes(urdf: str, meshes: Mapping[str, str], url: Callable[[str], str] = by_package) -> str:
    """A URDF for viewers: of links whose mesh is installed, the mesh in place of the visual primitives.

    Args:
        urdf: as published; returned as it is if no mesh is installed.
        meshes: `package://` of links, by their name.
        url: of a mesh in the new URDF.

    Raises:
        InputError: a mesh file that cannot be read.
    """
    installed = {link: uri for link, uri in meshes.items() if package_file(uri) is not None}
    root = ElementTree.fromstring(urdf)
    links = [link for link in root.findall("link") if link.get("name") in installed]
    if not links:
        return urdf
    for link in links:
        for primitive in link.findall("visual"):
            link.remove(primitive)
        geometry = ElementTree.SubElement(ElementTree.SubElement(link, "visual"), "geometry")
        ElementTree.SubElement(geometry, "mesh", filename=url(installed[str(link.get("name"))]))
    return ElementTree.tostring(root, encoding="unicode")
