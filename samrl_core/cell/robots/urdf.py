"""Reading of an arm's URDF, and the check that a `RobotSpec` fits its file."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import fields
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import read_text

_MOVING = ("revolute", "continuous", "prismatic", "floating", "planar")


def read_urdf(path: Path) -> ElementTree.Element:
    """Root element of a URDF.

    Raises:
        InputError: no such file, or not a URDF.
    """
    return parse_urdf(read_text(Path(path), "the URDF"), str(path))


def numbers(element: ElementTree.Element, attribute: str, default: str, count: int) -> np.ndarray:
    """`count` finite numbers of an attribute.

    Raises:
        InputError: another count, or something that is not a finite number.
    """
    text = element.get(attribute, default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise InputError(f'URDF <{element.tag} {attribute}="{text}">: {error}') from error
    if values.shape != (count,) or not np.isfinite(values).all():
        raise InputError(f'URDF <{element.tag} {attribute}="{text}"> must be {count} finite numbers')
    return values


def origin_of(element: ElementTree.Element) -> Pose:
    """Pose of an element's <origin>, identity where it has none."""
    origin = element.find("origin")
    if origin is None:
        return Pose.identity()
    roll, pitch, yaw = numbers(origin, "rpy", "0 0 0", 3).tolist()
    return Pose.from_rpy(numbers(origin, "xyz", "0 0 0", 3), (roll, pitch, yaw))


def mesh_file(urdf: Path, mesh: ElementTree.Element) -> Path:
    """File of a <mesh>: beside the URDF, or of `package://NAME/...`, where NAME is a folder above the URDF.

    Raises:
        InputError: no such file.
    """
    name = mesh.get("filename", "").removeprefix("file://")
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        found = [folder / rest for folder in urdf.resolve().parents if folder.name == package]
    else:
        found = [urdf.parent / name]
    for path in found:
        if path.is_file():
            return path
    raise InputError(
        f"{urdf} names mesh '{mesh.get('filename', '')}', which is not there; put the file beside the URDF, "
        "or the URDF below the folder of the package"
    )


def links_to_flange(spec: RobotSpec) -> list[str]:
    """Names of the links from the base to the flange; what branches off is left out."""
    parents: dict[str, str] = {}
    for joint in read_urdf(spec.urdf).findall("joint"):
        ends = [end.get("link", "") for tag in ("parent", "child") if (end := joint.find(tag)) is not None]
        if len(ends) == 2:
            parents[ends[1]] = ends[0]
    links = [spec.flange]
    while links[-1] in parents:
        links.append(parents[links[-1]])
    return links[::-1]


def description_of(spec: RobotSpec) -> str:
    """The URDF's text for whoever gets no spec, who takes the last link of the chain as the flange.

    Massless links that branch off the way to the flange are left out.
    """
    text = read_text(spec.urdf, "the URDF")
    root, kept = parse_urdf(text, str(spec.urdf)), links_to_flange(spec)
    for link in root.findall("link"):
        name = str(link.get("name"))
        if name in kept or _mass(link) or root.find(f"joint/parent[@link='{name}']") is not None:
            continue
        root.remove(link)
        for joint in root.findall("joint"):
            if joint.find(f"child[@link='{name}']") is not None:
                root.remove(joint)
    return text if len(root) == len(ElementTree.fromstring(text)) else ElementTree.tostring(root, "unicode")


def _mass(link: ElementTree.Element) -> float:
    mass = link.find("inertial/mass")
    return 0.0 if mass is None else float(numbers(mass, "value", "0", 1)[0])


def child_link(spec: RobotSpec, joint: str) -> str:
    """Name of the link that a joint moves."""
    found = read_urdf(spec.urdf).find(f"joint[@name='{joint}']/child")
    assert found is not None, joint  # `check_robot` has seen it
    return found.get("link", "")


def check_robot(spec: RobotSpec) -> None:
    """Refuse a spec that does not fit its URDF.

    Raises:
        InputError: no file; a joint or link that it lacks; moving joints beyond those named; figures of
            the wrong length, not finite, or wider than the URDF's limits; home outside the limits.
    """
    root = read_urdf(spec.urdf)
    links = {link.get("name") for link in root.iter("link")}
    for link in (spec.base_link, spec.flange):
        if link not in links:
            raise InputError(
                f"{spec.urdf} has no link '{link}' that robot '{spec.name}' names; it has "
                f"{sorted(str(n) for n in links)}; mend the spec or the file"
            )
    children = {child.get("link") for child in root.iter("child")}
    if spec.base_link in children:
        raise InputError(
            f"link '{spec.base_link}' of {spec.urdf} hangs on another link; robot '{spec.name}' needs its "
            "base link at the root: cut what is before it, the cell says where the base stands"
        )
    moving = [j for j in root.findall("joint") if j.get("type") in _MOVING]
    names = [j.get("name") for j in moving]
    if sorted(map(str, names)) != sorted(spec.joint_names):
        raise InputError(
            f"{spec.urdf} moves joints {names}, robot '{spec.name}' names {list(spec.joint_names)}; "
            'they must be the same: fix further joints (type="fixed") or mend the spec'
        )
    _check_figures(spec)
    by_name = {j.get("name"): j for j in moving}
    for i, name in enumerate(spec.joint_names):
        limit = by_name[name].find("limit")
        if by_name[name].get("type") != "revolute" or limit is None:
            raise InputError(f"joint '{name}' of {spec.urdf} must be revolute with a <limit>")
        lower, upper = numbers(limit, "lower", "0", 1)[0], numbers(limit, "upper", "0", 1)[0]
        if spec.limits.lower[i] < lower - 1e-6 or spec.limits.upper[i] > upper + 1e-6:
            raise InputError(
                f"joint '{name}': limits {spec.limits.lower[i]:.4f}..{spec.limits.upper[i]:.4f} rad of robot "
                f"'{spec.name}' exceed {lower:.4f}..{upper:.4f} of {spec.urdf}; narrow the spec"
            )


def _check_figures(spec: RobotSpec) -> None:
    arrays = {f"limits.{f.name}": getattr(spec.limits, f.name) for f in fields(spec.limits)}
    arrays |= {"stiffness": spec.controller.stiffness, "damping": spec.controller.damping}
    arrays |= {"home": spec.home, "armature": spec.armature}
    for name, array in arrays.items():
        if np.shape(array) != (len(spec.joint_names),) or not np.isfinite(array).all():
            raise InputError(
                f"{name} of robot '{spec.name}' is {array}, must be {len(spec.joint_names)} finite numbers"
            )
    if (spec.home < spec.limits.lower).any() or (spec.home > spec.limits.upper).any():
        raise InputError(f"home {spec.home} of robot '{spec.name}' lies outside its joint limits")
