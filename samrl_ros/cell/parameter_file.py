"""A ROS parameter file from outside, read and checked before any node starts.

ROS itself ignores parameters that no node declares, so that a misspelt one would silently do nothing.
Names that older files use are understood; `setting(former=...)` lists them.
"""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.common.text_files import parse_yaml, read_text
from samrl_ros.contract.settings import why_refused
from samrl_ros.nodes.registry import all_settings

_OF_EVERY_NODE = ("autostart", "use_sim_time", "start_type_description_service")


def load_parameters(path: Path, nodes: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Values by node name.

    Args:
        path: a ROS parameter file; its nodes may be named with or without the cell's namespace.
        nodes: the nodes that there are.

    Raises:
        InputError: no such file, not YAML, not a parameter file, or a node, parameter or value that no node
            of the cell would take.
    """
    if not is_file(path):
        raise InputError(f"no parameter file at {path}; give the path of an existing file")
    try:
        data = parse_yaml(read_text(path, "the parameters"), str(path))
    except InputError as error:
        raise InputError(f"{path} is not YAML: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} is not a ROS parameter file: the top level must name nodes")
    found: dict[str, dict[str, Any]] = {}
    for key, body in data.items():
        if not isinstance(body, dict) or set(body) != {"ros__parameters"}:
            raise InputError(f"{path}: {key!r} must hold ros__parameters and nothing else")
        values = body["ros__parameters"] or {}
        if not isinstance(values, dict):
            raise InputError(f"{path}: ros__parameters of {key!r} maps no names to values: {values!r}")
        node = str(key).removeprefix("/cell/")
        if node not in nodes:
            raise InputError(f"{path} names unknown node {key!r}; there are {', '.join(nodes)}")
        if node in found:
            raise InputError(f"{path} names node {node} twice; merge the two")
        found[node] = values
    found, moved = with_present_names(found)
    for sentence in moved:
        warnings.warn(f"{path}: {sentence}", FutureWarning, stacklevel=2)
    for node, values in found.items():
        _check(path, node, values)
    return found


def with_present_names(
    values: dict[str, dict[str, Any]],
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Values by node, with those under a former name moved to where their parameter is now.

    A value under the present name wins.

    Returns:
        The values, and a sentence for each name that is out of date.
    """
    found = {node: dict(body) for node, body in values.items()}
    sentences = []
    for node, settings in all_settings().items():
        for field in dataclasses.fields(settings):
            *place, name = field.metadata["former"].split(".")
            before = place[0] if place else node
            if name and name in found.get(before, {}):
                value = found[before].pop(name)
                found.setdefault(node, {}).setdefault(field.name, value)
                sentences.append(f"{name} of {before} is called {field.name} of {node}; rename it")
    return found, sentences


def _check(path: Path, node: str, values: dict[str, Any]) -> None:
    fields = {field.name: field for field in dataclasses.fields(all_settings()[node])}
    for name, value in values.items():
        if name in _OF_EVERY_NODE or str(name).startswith("qos_overrides"):
            continue
        if name not in fields:
            raise InputError(f"{path}: {node} has no parameter {name!r}; it has {', '.join(fields)}")
        reason = _wrong_type(fields[name], value) or why_refused(fields[name], value)
        if reason:
            raise InputError(f"{path}: {node}: {reason}")


def _wrong_type(field: dataclasses.Field[Any], value: Any) -> str:
    default = field.default
    fits = isinstance(value, list) if isinstance(default, tuple) else type(value) is type(default)
    if fits:
        return ""
    hint = "; write a float with its point, as in 5.0" if isinstance(default, float) else ""
    kind = "list" if isinstance(default, tuple) else type(default).__name__
    return f"parameter {field.name} = {value!r} is a {type(value).__name__}, must be a {kind}{hint}"
