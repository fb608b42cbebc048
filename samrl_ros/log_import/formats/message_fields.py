"""A decoded message as numbers by path: names that stand beside an array become part of the path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_LONGEST = 256  # numbers of one array; more is an image or a cloud
_MOST_ELEMENTS = 64  # of a list of messages, such as the points of a trajectory
_TIMES = (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"))  # of ROS 2, ROS 1 and its bags


def flatten(message: Any) -> dict[str, float | np.ndarray]:
    """Numbers, arrays (K,) and times [s] of a message by path.

    An array whose length is that of a list of names beside it or above it (`name`, `joint_names`,
    `interface_names`) is given per name as well: `position.JOINT`. Elements of a list of messages have
    their name, their own `name` field, their own number or that of `ids` (tags come in any order), or their
    place in the path: `points.0.positions.JOINT`.
    """
    found: dict[str, float | np.ndarray] = {}
    _add(found, "", message, [])
    return found


def split_time(fields: Mapping[str, Any]) -> tuple[Any, Any] | None:
    """Seconds and nanoseconds of a message that is a time or a duration; None of any other."""
    for names in _TIMES:
        if fields.keys() == set(names):
            return fields[names[0]], fields[names[1]]
    return None


def _fields(message: Any) -> dict[str, Any]:
    names = [name for name in getattr(message, "__dataclass_fields__", ()) if not name.startswith("__")]
    return {name: getattr(message, name) for name in names}


def _add(found: dict[str, float | np.ndarray], prefix: str, message: Any, labels: list[list[str]]) -> None:
    fields = _fields(message)
    own = [value for value in fields.values() if _is_names(value)]
    own += [ids for name, value in fields.items() if name.endswith("ids") and (ids := _different(value))]
    inside = [*own, *labels]  # the nearest first
    for name, value in fields.items():
        path = f"{prefix}{name}"
        if isinstance(value, bool | int | float | np.number):
            found[path] = float(value)
        elif isinstance(value, np.ndarray):
            _add_array(found, path, value, inside)
        elif isinstance(value, list):
            _add_list(found, path, value, inside)
        elif (parts := _fields(value)) and (time := split_time(parts)) is not None:
            found[path] = float(time[0]) + 1e-9 * float(time[1])
        elif parts:
            _add(found, f"{path}.", value, inside)


def _add_array(
    found: dict[str, float | np.ndarray], path: str, value: np.ndarray, labels: list[list[str]]
) -> None:
    if value.dtype.kind not in "fiub" or not 0 < value.size <= _LONGEST:
        return
    found[path] = value.astype(float).ravel()
    for names in labels:
        if len(names) == value.size:
            found |= {f"{path}.{name}": float(each) for name, each in zip(names, value.ravel(), strict=True)}
            return


def _add_list(
    found: dict[str, float | np.ndarray], path: str, value: list[Any], labels: list[list[str]]
) -> None:
    if not value or len(value) > _MOST_ELEMENTS or isinstance(value[0], str):
        return
    if isinstance(value[0], bool | int | float):
        _add_array(found, path, np.array(value, dtype=float), labels)
        return
    names = next((names for names in labels if len(names) == len(value)), None)
    if names is None:
        own = [getattr(each, "name", "") for each in value]
        names = own if _is_names(own) else _ids_of(value) or [str(k) for k in range(len(value))]
    for name, each in zip(names, value, strict=True):
        _add(found, f"{path}.{name}.", each, labels)


def _ids_of(elements: list[Any]) -> list[str]:
    """What their field `id` or `..._id` says, where it says something else of each; else empty."""
    for name in _fields(elements[0]):
        if name == "id" or name.endswith("_id"):
            ids = [getattr(each, name, None) for each in elements]
            if said := _different([_joined(each) if isinstance(each, np.ndarray) else each for each in ids]):
                return said
    return []


def _joined(ids: np.ndarray) -> str:
    """Of a bundle of tags: 3_7."""
    return "_".join(str(each) for each in ids.ravel())


def _different(ids: Any) -> list[str]:
    """Whole numbers or names as text, where all of them differ; else empty."""
    if isinstance(ids, np.ndarray) and ids.dtype.kind not in "iu":
        return []
    if not isinstance(ids, list | np.ndarray) or not all(
        isinstance(each, str | int | np.integer) for each in ids
    ):
        return []
    said = [str(each) for each in ids]
    return said if all(said) and len(set(said)) == len(said) else []


def _is_names(value: Any) -> bool:
    """Whether a value is a list of different names."""
    whole = isinstance(value, list) and value and all(isinstance(each, str) and each for each in value)
    return bool(whole) and len(set(value)) == len(value)
