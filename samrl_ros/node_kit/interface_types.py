"""Message and service classes by their ROS names."""

from __future__ import annotations

import importlib
from typing import Any

from samrl_core.errors import InputError


def interface_class(type_name: str) -> Any:
    """For example `interface_class("sensor_msgs/msg/Image")`. Raises InputError when it cannot be had."""
    package, kind, name = type_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"the interface {type_name} is not available ({error}); own interfaces are built by "
            "python -m samrl_ros.interfaces.build"
        ) from error
