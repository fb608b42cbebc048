"""One border for every description of a robot: text in, one normal form out.

The normal form is a URDF, because everything behind the border reads one: the joint tree with inertias,
limits, and `<dynamics friction damping armature>` as nominal losses and rotors. What a URDF cannot hold,
the gains of the model's actuators, stands beside it. The original text is kept: a correction is written
into that, not into ours.

No geometry is needed for dynamics, so a missing mesh is no error; only a body that would get its mass from
one is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import read_text

_ROOT = re.compile(r"<\s*([A-Za-z_][\w.:-]*)")
_IGNORED = re.compile(r"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>]*>", re.DOTALL)


@dataclass(frozen=True)
class JointActuator:
    """What a model's actuator does at its joint: effort = stiffness (q_d - q) + damping (dq_d - dq)."""

    joint: str
    kind: str  # position, velocity, motor or other
    stiffness: float = 0.0  # [N m/rad]
    damping: float = 0.0  # [N m s/rad]
    effort_limit: float = np.inf  # [N m]


@dataclass(frozen=True)
class NominalModel:
    """A robot's description."""

    form: str  # urdf, xacro or mjcf
    path: Path | None  # None where it came as text
    source: str  # as its files hold it, included files and macros written out
    urdf: str  # normal form
    actuators: tuple[JointActuator, ...] = ()
    period_s: float = 0.001  # of the model's own time step
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)  # in the model's world [m/s2]
    compensated: bool = False  # whether the model takes gravity off its bodies
    notes: tuple[str, ...] = ()

    def controller(self, joints: Sequence[str]) -> str | None:
        """The contract's JSON of the controller that the model's actuators make; None where they make none.

        A position actuator is a joint impedance, without gravity compensation unless the model takes it off.
        """
        by_joint = {a.joint: a for a in self.actuators}
        found = [by_joint.get(name) for name in joints]
        if not found or any(a is None or a.kind != "position" for a in found):
            return None
        these = [a for a in found if a is not None]
        about: dict[str, Any] = {
            "type": "joint_impedance",
            "joints": list(joints),
            "stiffness": [a.stiffness for a in these],
            "damping": [a.damping for a in these],
            "gravity_compensation": self.compensated,
            "period_s": self.period_s,
            "gravity": list(self.gravity),
        }
        if all(np.isfinite(a.effort_limit) for a in these):
            about["effort_limit"] = [a.effort_limit for a in these]
        return json.dumps(about)


def read_model(path: Path, xacro_arguments: Mapping[str, str] | None = None) -> NominalModel:
    """Read a model of any of the three forms; what it is shows in its first element.

    Args:
        path: of the file; files it includes are looked for beside it.
        xacro_arguments: values of `<xacro:arg>`.

    Raises:
        InputError: no such file, neither `<robot>` nor `<mujoco>`, or a model that cannot be read: with the
            file, the line or element, and what to do.
    """
    text = read_text(path, "the model")
    root = root_of(text)
    if root == "mujoco":
        from samrl_core.diagnosis.nominal_model.from_mjcf import from_mjcf

        return from_mjcf(path, text)
    if root == "robot":
        if path.suffix == ".xacro" or "xmlns:xacro" in text:
            from samrl_core.diagnosis.nominal_model.from_xacro import expand

            text = expand(path, xacro_arguments or {})
            return NominalModel("xacro", path, text, _checked(text, path))
        if xacro_arguments:
            raise InputError(
                f"{path} is no xacro file: it takes no arguments {sorted(xacro_arguments)}; leave them out"
            )
        return NominalModel("urdf", path, text, _checked(text, path))
    found = f"starts with <{root}>" if root else f"is no XML, it starts with {text.strip()[:40]!r}"
    raise InputError(f"{path} {found}; give a URDF or xacro (<robot>) or an MJCF (<mujoco>)")


def root_of(text: str) -> str:
    """Name of the first element; empty where there is none."""
    match = _ROOT.search(_IGNORED.sub("", text[: 1 << 20]))
    return match[1] if match else ""


def is_mjcf(text: str) -> bool:
    """Whether a text is MuJoCo's format."""
    return root_of(text) == "mujoco"


def _checked(urdf: str, path: Path) -> str:
    parse_urdf(urdf, str(path))
    return urdf
