"""The correction in a URDF, and what Gazebo and PyBullet make of one.

A URDF has friction, damping and effort limit of a joint, the inertia of a link, and the joint's zero, which
an encoder's offset turns. Gazebo reads those, and springs from a `<gazebo reference>`. PyBullet reads the
same; rotor inertia it lacks comes nearest as inertia of the link about the joint's axis.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.export.bodies import RigidBody, body_of, ten_of
from samrl_core.diagnosis.export.correction import BODY, Correction
from samrl_core.diagnosis.export.missing import say_missing
from samrl_core.diagnosis.export.nearest import BEYOND, PLAIN, level_and_slope
from samrl_core.diagnosis.export.statement import EXACT, MISSING, NEAREST, Statement
from samrl_core.diagnosis.export.xml_edit import XmlElement, XmlText

KNOWN = {*PLAIN, *BEYOND, "encoder_offset", "effort_limit", BODY}
SIMULATORS = {"urdf": "URDF", "gazebo": "Gazebo", "pybullet": "PyBullet"}


def to_urdf(correction: Correction, source: str, dialect: str = "urdf") -> tuple[str, list[Statement]]:
    """The changed text, and what it says of each change.

    Args:
        correction: what to change.
        source: the URDF.
        dialect: urdf, gazebo or pybullet.

    Raises:
        InputError: the URDF lacks a joint.
    """
    text, done = XmlText(source), []
    known = set(KNOWN)
    for j, name in enumerate(correction.joints):
        joint = text.find("joint", name=name)
        if joint is None or joint.child("child") is None:
            raise InputError(
                f"the URDF has no joint named {name!r}, which the recordings have; give the diagnosed one"
            )
        _losses(correction, text, joint, j, done)
        _zero(correction, text, joint, j, done)
        if correction.changes("effort_limit", j):
            _limit(correction, text, joint, j, done)
        _inertia(correction, text, joint, j, done, rotor=dialect == "pybullet")
        if dialect == "gazebo" and correction.changes("cable_stiffness", j):
            _gazebo_spring(correction, text, name, j, done)
    known |= {"rotor_inertia"} if dialect == "pybullet" else set()
    known |= {"cable_stiffness"} if dialect == "gazebo" else set()
    done += say_missing(correction, known, SIMULATORS[dialect])
    return text.result(), done


def _losses(c: Correction, text: XmlText, joint: XmlElement, j: int, done: list[Statement]) -> None:
    if not any(c.changes(name, j) for name in (*PLAIN, *BEYOND)):
        return
    near = level_and_slope(c, j)
    values: dict[str, str | None] = {"damping": f"{near.damping:.8g}", "friction": f"{near.friction:.8g}"}
    there = joint.child("dynamics")
    if there is not None:
        text.set(there, values)
    else:
        text.add_first(joint, "<dynamics " + " ".join(f'{k}="{v}"' for k, v in values.items()) + "/>")
    said = f"friction {near.friction:.4g} N m, damping {near.damping:.4g} N m s/rad"
    beyond = [name for name in BEYOND if c.changes(name, j)]
    if beyond:
        low, high = near.speeds
        said += f": the best level and slope from {low:.2g} to {high:.2g} rad/s as recorded"
    place, what = f"joint:{c.joints[j]}", ", ".join(beyond) or "friction"
    done.append(Statement(place, what, NEAREST if beyond else EXACT, said, near.error if beyond else None))


def _zero(c: Correction, text: XmlText, joint: XmlElement, j: int, done: list[Statement]) -> None:
    """reading = angle + offset: at a reading of zero the link stands at minus the offset."""
    if not c.changes("encoder_offset", j):
        return
    offset, origin, axis = c.at("encoder_offset", j), joint.child("origin"), joint.child("axis")
    direction = _three(axis.attributes.get("xyz") if axis is not None else None, "1 0 0")
    direction = direction / np.linalg.norm(direction)
    xyz = _three(origin.attributes.get("xyz") if origin is not None else None)
    turn = Rotation.from_euler("xyz", _three(origin.attributes.get("rpy") if origin is not None else None))
    if joint.attributes.get("type") == "prismatic":
        xyz = xyz - offset * turn.apply(direction)
    else:
        turn = turn * Rotation.from_rotvec(-offset * direction)
    values: dict[str, str | None] = {
        "xyz": " ".join(f"{v:.10g}" for v in xyz), "rpy": " ".join(f"{v:.10g}" for v in turn.as_euler("xyz")),
    }  # fmt: skip
    if origin is not None:
        text.set(origin, values)
    else:
        text.add_first(joint, f'<origin xyz="{values["xyz"]}" rpy="{values["rpy"]}"/>')
    said = f"the joint's zero is turned by {-offset:.4g} rad, so that its position is what the encoder reads"
    done.append(Statement(f"joint:{c.joints[j]}", "encoder_offset", EXACT, said))


def _limit(c: Correction, text: XmlText, joint: XmlElement, j: int, done: list[Statement]) -> None:
    limit, there = c.at("effort_limit", j), joint.child("limit")
    place = f"joint:{c.joints[j]}"
    if there is None:
        done.append(Statement(place, "effort_limit", MISSING, "the joint has no <limit>; clip the effort"))
        return
    text.set(there, {"effort": f"{limit:.8g}"})
    done.append(
        Statement(place, "effort_limit", EXACT, f"effort limit {limit:.4g} N m, where the reader clips to it")
    )


def _inertia(
    c: Correction, text: XmlText, joint: XmlElement, j: int, done: list[Statement], rotor: bool
) -> None:
    """The link behind a joint: its frame is the joint's."""
    delta = c.fields[BODY][j] if BODY in c.fields else np.zeros(10)
    spin = float(c.armature[j]) + c.at("rotor_inertia", j) if rotor else 0.0
    if not np.any(delta) and not spin:
        return
    child = joint.child("child")
    assert child is not None
    link = text.find("link", name=child.attributes["link"])
    place = f"joint:{c.joints[j]}"
    if link is None:
        done.append(
            Statement(place, "body", MISSING, f"link {child.attributes['link']!r} is not in the file")
        )
        return
    own = _own(link)
    spinning = new = body_of(ten_of(own) + delta)
    if spin:
        axis = joint.child("axis")
        direction = _three(axis.attributes.get("xyz") if axis is not None else None, "1 0 0")
        direction = direction / np.linalg.norm(direction)
        if joint.attributes.get("type") == "prismatic":
            done.append(
                Statement(place, "rotor_inertia", MISSING, "a motor's mass on a slide cannot be written")
            )
        else:
            # PyBullet takes only moments that obey the triangle inequality: half of the spin goes across.
            across = 0.5 * (np.eye(3) + np.outer(direction, direction))
            spinning = RigidBody(new.mass, new.center, new.inertia + spin * across)
            said = (
                f"{spin:.4g} kg m2 about the joint's axis (nominal rotor included), and half of it across, in"
                " the link's inertia: other joints feel it too"
            )
            if c.changes("rotor_inertia", j) or float(c.armature[j]):
                done.append(Statement(place, "rotor_inertia", NEAREST, said))
    if not new.possible:
        done.append(
            Statement(place, "body", MISSING, f"a mass of {new.mass:.3g} kg with moments that no body has")
        )
        return
    _write(text, link, spinning)
    if np.any(delta):
        said = f"link {link.attributes['name']}: {new.mass:.4g} kg (before {own.mass:.4g}), centre {np.round(new.center, 4).tolist()} m"  # noqa: E501
        done.append(Statement(place, "body", EXACT, said))


def _own(link: XmlElement) -> RigidBody:
    inertial = link.child("inertial")
    if inertial is None:
        return RigidBody(0.0, np.zeros(3), np.zeros((3, 3)))
    origin, mass, moments = (inertial.child(tag) for tag in ("origin", "mass", "inertia"))
    center = _three(origin.attributes.get("xyz") if origin is not None else None)
    turn = Rotation.from_euler("xyz", _three(origin.attributes.get("rpy") if origin is not None else None))
    r, full = turn.as_matrix(), np.zeros((3, 3))
    if moments is not None:
        for a in range(3):
            for b in range(a, 3):
                value = float(moments.attributes.get(f"i{'xyz'[a]}{'xyz'[b]}", 0.0))
                full[a, b] = full[b, a] = value
    return RigidBody(
        float(mass.attributes.get("value", 0.0)) if mass is not None else 0.0, center, r @ full @ r.T
    )


def _write(text: XmlText, link: XmlElement, body: RigidBody) -> None:
    i = body.inertia
    center = " ".join(f"{v:.10g}" for v in body.center)
    moments: dict[str, str | None] = {
        f"i{'xyz'[a]}{'xyz'[b]}": f"{i[a, b]:.10g}" for a in range(3) for b in range(a, 3)
    }
    there = link.child("inertial")
    parts = [] if there is None else [there.child(tag) for tag in ("origin", "mass", "inertia")]
    if len(parts) == 3 and all(part is not None for part in parts):
        origin, mass, inertia = (part for part in parts if part is not None)
        text.set(origin, {"xyz": center, "rpy": "0 0 0"})
        text.set(mass, {"value": f"{body.mass:.10g}"})
        text.set(inertia, moments)
        return
    words = " ".join(f'{k}="{v}"' for k, v in moments.items())
    whole = f'<origin xyz="{center}" rpy="0 0 0"/><mass value="{body.mass:.10g}"/><inertia {words}/>'
    if there is None:
        text.add_first(link, f"<inertial>{whole}</inertial>")
    else:
        text.replace_content(there, whole)


def _gazebo_spring(c: Correction, text: XmlText, name: str, j: int, done: list[Statement]) -> None:
    spring, rest = c.at("cable_stiffness", j), c.at("cable_rest", j)
    text.add_first(
        text.elements[0],
        f'<gazebo reference="{name}"><springStiffness>{spring:.8g}</springStiffness>'
        f"<springReference>{rest:.8g}</springReference></gazebo>",
    )
    said = f"springStiffness {spring:.4g} N m/rad about springReference {rest:.4g} rad"
    done.append(Statement(f"joint:{name}", "cable_stiffness", EXACT, said))


def _three(text: str | None, default: str = "0 0 0") -> np.ndarray:
    return np.array([float(v) for v in (text or default).split()])
