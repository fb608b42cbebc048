"""Message and service classes by their ROS 2 name."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

from samrl_core.common.errors import InputError


@cache
def message_class(name: str) -> Any:
    """The class of `package/msg/Type` or `package/srv/Type`.

    Raises:
        InputError: no such package or type in this environment.
    """
    package, kind, type_ = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), type_)
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"message type {name} is not installed ({error}); install the ros extra and build the "
            "interfaces (`make setup`)"
        ) from error
