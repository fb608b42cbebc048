"""Reading of an arm's URDF, and the check that a `RobotSpec` fits its file."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

_MOVING = ("revolute", "continuous", "prismatic", "floating", "planar")


def read_urdf(path: Path) -> ElementTree.Element:
    """Root element of a URDF.

    Raises:
        InputError: no such file, or not a URDF.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"no URDF at {path}; give the path of an existing file")
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise InputError(f"{path} is not well-formed XML ({error}); xacro files must be expanded") from error
    if root.tag != "robot":
        raise InputError(f"{path} has root <{root.tag}>, a URDF has <robot>; give the arm's URDF")
    return root


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


def with_urdf(spec: RobotSpec, path: Path | str) -> RobotSpec:
    """The same arm described by another file, checked.

    Raises:
        InputError: as `check_robot`.
    """
    other = replace(spec, urdf=Path(path))
    check_robot(other)
    return other


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
