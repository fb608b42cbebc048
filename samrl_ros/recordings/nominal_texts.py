"""The contract's JSON texts of controller and tool, and tolerance files: to and from the core's types.

Reading is lenient about what it does not know (a note lists it) and strict about what it does know.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.urdf_text import MOST_KG
from samrl_core.cell.types.arm_description import (
    HELD,
    ArmController,
    ArmDescription,
    NominalTool,
    Tolerances,
)
from samrl_core.cell.types.controllers import KINDS, joint_names
from samrl_core.cell.types.controllers.impedance import JointImpedance
from samrl_core.cell.types.controllers.kind import not_negative, numbers, shown
from samrl_core.cell.types.stated_tolerances import HALF_WIDTH
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_json, parse_yaml, read_text

LAW = JointImpedance.name
UNDESCRIBED = "unknown"  # `type` of a text that only carries joints and tolerances, of a log without a law
_CENTER = ("center_of_mass", "centre_of_mass", "com")
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")

TOLERANCE_FILE = """\
# How far the real arm may be from its nominal model and still count as nominal: half widths of
# what is plausible, unless stated_as says that they are standard deviations. All optional; values below are
# the defaults.
# A value is one number for all joints, or (last group) a list with one per joint.
mass: 0.02              # of each link, fraction
center_of_mass: 0.002   # of each link, per axis [m]
inertia: 0.03           # of each link's moments, fraction
tool_mass: 0.02         # of the payload at the flange, fraction
base_tilt: 0.0005       # per horizontal axis [rad]
armature: 0.02          # rotor inertia, fraction
stamp: 0.0002           # of a channel against another, constant in a recording [s]
torque_offset: 0.004    # of drive and sensor, fraction of the joint's effort limit
coulomb_friction: 0.001 # fraction of the joint's effort limit
viscous_friction: 0.001 # fraction of effort limit over velocity limit
motor_constant: 0.01    # of a motor: torque per volt or ampere, fraction
stated_as: half_width   # or standard_deviation, of all of them
"""


@dataclass(frozen=True)
class ControllerText:
    """The controller that a text describes."""

    joints: tuple[str, ...]  # empty if it names none
    controller: ArmController | None  # None if its law is not the contract's
    tolerances: Tolerances | None  # None if it states none
    notes: tuple[str, ...] = ()


def controller_text(arm: ArmDescription) -> str:
    """The contract's JSON; without a controller, joints and tolerances alone."""
    controller, tolerances = arm.controller, asdict(arm.tolerances)
    if tolerances["stated_as"] == HALF_WIDTH:
        del tolerances["stated_as"]  # as it always was
    if controller is None:
        return json.dumps({"type": UNDESCRIBED, "joints": list(arm.joints), "tolerances": tolerances})
    about: dict[str, Any] = {
        "type": controller.kind,
        "joints": list(controller.joints),
        **KINDS[controller.kind].describe(controller),
        "gravity_compensation": bool(controller.gravity_compensation),
        "period_s": controller.period_s,
        "gravity": list(controller.gravity),
        "tolerances": tolerances,
    }
    if controller.between_commands == HELD:
        about["between_commands"] = controller.between_commands
    return json.dumps(about)


def tool_text(tool: NominalTool) -> str:
    """The contract's JSON."""
    return json.dumps(
        {
            "mass": tool.mass,
            "center_of_mass": np.asarray(tool.center_of_mass).tolist(),
            "inertia": np.asarray(tool.inertia).tolist(),
        }
    )


def parse_controller(text: str, where: str) -> ControllerText:
    """The controller and what comes with it.

    Raises:
        InputError: no JSON object, a missing key, or numbers that do not fit the joints.
    """
    about = _object(text, where)
    law = about.get("type", LAW)
    kind = KINDS.get(law) if isinstance(law, str) else None
    notes = _unknown(about, set(about) - set((kind or KINDS[LAW]).unknown(about)), where)
    tolerances = None
    if about.get("tolerances") is not None:
        tolerances, more = lenient_tolerances(about["tolerances"], f"{where}: tolerances")
        notes += more
    joints = joint_names(about.get("joints", []), where)
    if kind is None:
        if law != UNDESCRIBED:
            notes += (
                f"{where}: the law {law!r} is none of {', '.join(KINDS)};"
                " the controller is taken as not described",
            )
        return ControllerText(joints, None, tolerances, notes)
    controller = kind.read(about, joints, where)
    return ControllerText(joints, controller, tolerances, notes)


def parse_tool(text: str, where: str) -> tuple[NominalTool | None, tuple[str, ...]]:
    """Tool, None for an empty text or object, and notes.

    The inertia may be 3x3, nine or six numbers (ixx ixy ixz iyy iyz izz), or an object with these names.

    Raises:
        InputError: no JSON object, a missing key, or numbers that no body has.
    """
    about = _object(text, where) if text.strip() else {}
    if not about:
        return None, ()
    center = next((key for key in _CENTER if key in about), None)
    if missing := [key for key, there in (("mass", "mass" in about), (_CENTER[0], center)) if not there]:
        raise InputError(f"{where} lacks {', '.join(missing)}; it has {sorted(about)}")
    notes = _unknown(about, ("mass", "inertia", *_CENTER), where)
    mass = float(not_negative(about["mass"], None, f"{where}: mass"))
    if mass > MOST_KG:
        raise InputError(f"{where}: mass is {mass:g} kg, must be at most {MOST_KG:g}; is it in kg?")
    position = numbers(about[center or _CENTER[0]], (3,), f"{where}: {center}")
    inertia = _inertia(about.get("inertia", [0.0] * 9), f"{where}: inertia")
    if np.linalg.eigvalsh(inertia).min() < -1e-9 * max(1.0, np.abs(inertia).max()):
        raise InputError(f"{where}: inertia {inertia.tolist()} has a negative principal moment")
    return NominalTool(mass, position, inertia), notes


def lenient_tolerances(values: Any, where: str) -> tuple[Tolerances, tuple[str, ...]]:
    """Tolerances of the known names; unknown ones become notes. Raises `InputError` for bad values."""
    if not isinstance(values, dict):
        raise InputError(f"{where} is {type(values).__name__}, must be a mapping of names to numbers")
    known = {f.name for f in fields(Tolerances)}
    notes = _unknown(values, known, where)
    try:
        return Tolerances.from_mapping({str(k): v for k, v in values.items() if k in known}), notes
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def read_tolerances(path: Path | str) -> Tolerances:
    """Tolerances from a YAML (or JSON) file, see `TOLERANCE_FILE`; names left out keep their defaults.

    Raises:
        InputError: no file, no mapping, an unknown name (a misspelt tolerance must not pass in silence),
            or a value that is no number.
    """
    path = Path(path)
    values = parse_yaml(read_text(path, "the tolerances"), str(path))
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise InputError(f"{path} holds {type(values).__name__}, must be a mapping of names to numbers")
    try:
        return Tolerances.from_mapping(values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _object(text: str, where: str) -> dict[str, Any]:
    about = parse_json(text, where)
    if not isinstance(about, dict):
        raise InputError(f"{where} is a JSON {type(about).__name__}, must be an object")
    return about


def _unknown(about: dict[str, Any], known: Any, where: str) -> tuple[str, ...]:
    unknown = sorted(str(key) for key in set(about) - set(known))
    return (f"{where}: unknown keys {', '.join(unknown)} are ignored",) if unknown else ()


def _inertia(value: Any, where: str) -> np.ndarray:
    if isinstance(value, dict):
        value = [value.get(key, 0.0) for key in _MOMENTS]
    flat = np.ravel(_ragged(value, where))
    if len(flat) == 6:
        xx, xy, xz, yy, yz, zz = flat.tolist()
        flat = np.array([xx, xy, xz, xy, yy, yz, xz, yz, zz])
    matrix = numbers(flat, (9,), where).reshape(3, 3)
    if not np.allclose(matrix, matrix.T, atol=1e-6 * max(1e-6, np.abs(matrix).max())):
        raise InputError(f"{where} {matrix.tolist()} is not symmetric")
    return matrix


def _ragged(value: Any, where: str) -> np.ndarray:
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where} is {shown(value)}, must be 3x3, nine or six numbers") from error
