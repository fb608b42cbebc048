"""URDF texts of anybody: one door that every reader takes, which refuses what no arm can be."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import cast

from samrl_core.common.errors import InputError

DEEPEST = 64  # levels of elements; a URDF needs seven
MOST_KG = 1e6  # of a link
MOST_INERTIA = 1e9  # of a link, any entry [kg m2]
MOST_LENGTH = 1e6  # of an offset [m], or a joint's limit [m or rad]
_WORLD = "world"
_MOVING = ("revolute", "continuous", "prismatic", "planar")
_LIMITS = {"lower": MOST_LENGTH, "upper": MOST_LENGTH, "effort": 1e12, "velocity": 1e12}


def parse_urdf(text: str, where: str) -> ElementTree.Element:
    """Root element of a URDF.

    Raises:
        InputError: not well-formed XML, nested too deeply, another root, a joint or link without a name or
            with the name of another, or a number that no arm has (a mass below zero or not finite, an axis of
            length zero).
    """
    reader = ElementTree.XMLPullParser(("start", "end"))
    depth = 0
    root: ElementTree.Element | None = None
    try:
        for start in range(0, len(text), 1 << 16):  # piecewise: depth is seen before it is all in memory
            reader.feed(text[start : start + (1 << 16)])
            for event, element in cast(Iterator[tuple[str, ElementTree.Element]], reader.read_events()):
                root = element if root is None else root
                depth += 1 if event == "start" else -1
                if depth > DEEPEST:
                    raise InputError(f"{where} is nested more than {DEEPEST} elements deep; no URDF is")
        reader.close()
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(
            f"{where} is not well-formed XML ({error}); it starts with {text.strip()[:60]!r}. Expand xacro"
            " files first; a path is not a description"
        ) from error
    if root is None:
        raise InputError(f"{where} is not well-formed XML (it is empty); give the arm's URDF")
    if root.tag != "robot":
        raise InputError(f"{where} has root <{root.tag}>, must be <robot>; give the arm's URDF")
    for kind in ("link", "joint"):
        _check_names([element.get("name") for element in root.findall(kind)], kind, where)
    for link in root.findall("link"):
        _check_link(link, f"{where}: link '{link.get('name')}'")
    for joint in root.findall("joint"):
        _check_joint(joint, f"{where}: joint '{joint.get('name')}'")
    return root


def with_world(text: str) -> str:
    """A URDF whose joints may hang on `world` without a link of that name, as Drake reads it, with that link.

    Raises:
        InputError: a joint that hangs on any other link that the URDF does not have, or as `parse_urdf`.
    """
    root = parse_urdf(text, "the URDF")
    links = {link.get("name") for link in root.findall("link")}
    missing = {
        (joint.get("name"), end.get("link"))
        for joint in root.findall("joint")
        for end in (*joint.findall("parent"), *joint.findall("child"))
        if end.get("link") not in links
    }
    for joint, link in sorted(missing, key=str):
        if link != _WORLD:
            raise InputError(
                f"the URDF's joint {joint!r} hangs on link {link!r}, which it does not have; add"
                f' <link name="{link}"/>, or take the joint out'
            )
    if not missing:
        return text
    root.insert(0, ElementTree.Element("link", name=_WORLD))
    return ElementTree.tostring(root, encoding="unicode")


def _check_names(names: list[str | None], kind: str, where: str) -> None:
    if None in names or "" in names:
        raise InputError(f"{where} has a {kind} without a name; name it")
    if len(set(names)) != len(names):
        twice = sorted({str(name) for name in names if names.count(name) > 1})
        raise InputError(f"{where} names the {kind}s {twice} twice; each needs a name of its own")


def _check_link(link: ElementTree.Element, where: str) -> None:
    for inertial in link.findall("inertial"):
        for mass in inertial.findall("mass"):
            for value in _numbers(mass, "value", 1, where, MOST_KG):
                if value < 0:
                    raise InputError(f"{where}: mass is {value:g} kg, must be zero or more; mend the URDF")
        for inertia in inertial.findall("inertia"):
            for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
                for value in _numbers(inertia, name, 1, where, MOST_INERTIA):
                    if value < 0 and name[1] == name[2]:
                        raise InputError(
                            f"{where}: {name} is {value:g} kg m2, must be zero or more; mend the URDF"
                        )
        _check_origin(inertial, where)


def _check_joint(joint: ElementTree.Element, where: str) -> None:
    _check_origin(joint, where)
    for axis in joint.findall("axis"):
        direction = _numbers(axis, "xyz", 3, where, MOST_LENGTH)
        if joint.get("type") in _MOVING and direction and math.hypot(*direction) < 1e-9:
            raise InputError(
                f"{where}: axis {axis.get('xyz')!r} has no length; write a direction, as in '0 0 1'"
            )
    for dynamics in joint.findall("dynamics"):
        for name in ("friction", "damping", "armature", "stiffness"):
            for value in _numbers(dynamics, name, 1, where, _LIMITS["effort"]):
                if value < 0:
                    raise InputError(f"{where}: {name} is {value:g}, must be zero or more; mend the URDF")
        _numbers(dynamics, "springref", 1, where, MOST_LENGTH)
    for limit in joint.findall("limit"):
        found = {name: _numbers(limit, name, 1, where, most) for name, most in _LIMITS.items()}
        if found["lower"] and found["upper"] and found["lower"] > found["upper"]:
            raise InputError(
                f"{where}: lower limit {found['lower'][0]:g} is above the upper {found['upper'][0]:g};"
                " exchange them"
            )


def _check_origin(element: ElementTree.Element, where: str) -> None:
    for origin in element.findall("origin"):
        for name in ("xyz", "rpy"):
            _numbers(origin, name, 3, where, MOST_LENGTH)


def _numbers(element: ElementTree.Element, name: str, count: int, where: str, most: float) -> list[float]:
    """Of an attribute, none where it is missing."""
    text = element.get(name)
    if text is None:
        return []
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(abs(value) <= most for value in values):  # not NaN either
        raise InputError(
            f"{where}: <{element.tag} {name}={text[:60]!r}> must be {count} finite"
            f" number{'s' if count > 1 else ''} up to {most:g}; mend the URDF"
        )
    return values
