"""ROS parameters from a frozen settings dataclass, whose fields `contract.settings.setting` declares."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node

from samrl_core.common.errors import InputError
from samrl_ros.contract.settings import why_refused

Settings = TypeVar("Settings")


def declare(node: Node, settings_type: type[Any]) -> None:
    """Declare every field as a parameter. Raises InputError for a value from outside that does not fit."""
    for field in dataclasses.fields(settings_type):
        default = field.default
        if default is dataclasses.MISSING:
            raise InputError(f"{settings_type.__name__}.{field.name} needs a default to become a parameter")
        value = list(default) if isinstance(default, tuple) else default
        former = _under_former_name(node, field)
        value = value if former is None else former
        try:
            node.declare_parameter(field.name, value, _descriptor(field))
        except InvalidParameterTypeException as error:
            raise InputError(
                f"parameter {field.name} of {node.get_fully_qualified_name()} is a {type(default).__name__} "
                f"(default {default!r}); a float needs its point in YAML, as in 5.0: {error}"
            ) from error
        except InvalidParameterValueException as error:
            raise InputError(
                f"parameter {field.name} of {node.get_fully_qualified_name()}: {error}"
            ) from error
        reason = why_refused(field, node.get_parameter(field.name).value)
        if reason:
            raise InputError(reason)


def read(node: Node, settings_type: type[Settings]) -> Settings:
    """The settings as the parameters stand now."""
    values = {}
    for field in dataclasses.fields(settings_type):  # ty: ignore[invalid-argument-type]
        value: Any = node.get_parameter(field.name).value
        values[field.name] = tuple(value) if isinstance(field.default, tuple) else value
    return settings_type(**values)


def _under_former_name(node: Node, field: dataclasses.Field[Any]) -> Any:
    """What a file or command line gives under the name that the parameter had, None if nothing.

    Raises:
        InputError: a value of another type.
    """
    name = field.metadata.get("former", "")
    if not name or "." in name:  # of another node: `samrl cell --params` moves it
        return None
    value = node.declare_parameter(name, None, ParameterDescriptor(dynamic_typing=True)).value
    node.undeclare_parameter(name)
    if value is None:
        return None
    node.get_logger().warning(f"parameter {name} is called {field.name}; rename it")
    if not isinstance(field.default, tuple) and type(value) is not type(field.default):
        raise InputError(f"parameter {name} is a {type(value).__name__}, must be as {field.default!r}")
    return value


def _descriptor(field: dataclasses.Field[Any]) -> ParameterDescriptor:
    metadata = field.metadata
    unit = f" [{metadata['unit']}]" if metadata.get("unit") else ""
    descriptor = ParameterDescriptor(
        name=field.name,
        description=f"{metadata.get('description', '')}{unit}",
        read_only=bool(metadata.get("read_only", False)),
    )
    if metadata.get("choices"):
        descriptor.additional_constraints = "one of: " + ", ".join(metadata["choices"])
    if metadata.get("range"):
        low, high = metadata["range"]
        if isinstance(field.default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))
            ]
        elif isinstance(field.default, int):
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
        else:  # ROS has no range for arrays; `why_refused` checks each item
            descriptor.additional_constraints = f"each item in {low} .. {high}"
    return descriptor
