"""Reads a robot's description of any form; what it is shows in its first element."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import read_text
from samrl_core.diagnosis.nominal_model.from_mjcf import from_mjcf
from samrl_core.diagnosis.nominal_model.from_xacro import expand
from samrl_core.diagnosis.nominal_model.nominal_model import NominalModel

_ROOT = re.compile(r"<\s*([A-Za-z_][\w.:-]*)")
_IGNORED = re.compile(r"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>]*>", re.DOTALL)


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
        return from_mjcf(path, text)
    if root == "robot":
        if path.suffix == ".xacro" or "xmlns:xacro" in text:
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


def _checked(urdf: str, path: Path) -> str:
    parse_urdf(urdf, str(path))
    return urdf
