"""A nominal model of the user's own, put in place of what a recording says of its arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.nominal_model import NominalModel
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_ros.recordings.nominal_texts import parse_controller


def model_of(path: Path, xacro_arguments: Sequence[str] = ()) -> NominalModel:
    """Read a model; arguments are `NAME:=VALUE`, as ROS writes them. Raises `InputError` as `read_model`."""
    return read_model(path, xacro_values(xacro_arguments))


def xacro_values(arguments: Sequence[str]) -> Mapping[str, str]:
    """`NAME:=VALUE` texts as a mapping. Raises `InputError` for any other text."""
    values: dict[str, str] = {}
    for text in arguments:
        name, sign, value = text.partition(":=")
        if not sign or not name:
            raise InputError(f"the xacro argument {text!r} is not NAME:=VALUE; write it as in name:=left")
        values[name] = value
    return values


def described_by(arm: ArmDescription, model: NominalModel) -> tuple[ArmDescription, tuple[str, ...]]:
    """The arm with a model's actuators as controller, where the recording describes none; with notes."""
    text = model.controller(arm.joints)
    if arm.controller is not None or text is None:
        return arm, model.notes
    where = f"the actuators of {model.path or 'the model'}"
    parsed = parse_controller(text, where)
    if parsed.controller is None:
        return arm, (*model.notes, *parsed.notes)
    note = f"no controller was recorded: {where} are taken for it"
    return replace(arm, controller=parsed.controller), (*model.notes, note)
