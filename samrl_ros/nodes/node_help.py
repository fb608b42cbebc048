"""What `--help` of a node's executable says: the node's parameters, with defaults, units and limits."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Sequence

from samrl_ros.nodes.registry import all_settings

WIDTH, INDENT = 100, 8
HEAD = """usage: ros2 run samrl_ros {name} [--help] [--ros-args [-p NAME:=VALUE]... [--params-file FILE] ...]

Node /cell/{name}. Ctrl-C stops it. Exit codes: 0 stopped, 1 failed, 2 wrong usage, 3 parameters refused,
130 stopped before it worked.

parameters:"""
EVERY_NODE = (
    ("autostart", "true", "", "configure and activate when the node starts"),
    ("use_sim_time", "false", "", "take the time from /clock"),
)


def node_help(names: Sequence[str]) -> str:
    """Help on nodes that share a process."""
    return "\n\n".join(_help_on(name) for name in names)


def _help_on(name: str) -> str:
    settings = all_settings()[name]
    rows = [(f.name, shown(f.default), _allowed(f), _meaning(f)) for f in dataclasses.fields(settings)]

    lines = [HEAD.format(name=name)]
    for parameter, default, allowed, meaning in [*rows, *EVERY_NODE]:
        limits = f", {allowed}" if allowed else ""
        lines.append(f"  {parameter} (default {default}{limits})")
        lines.append(textwrap.indent(textwrap.fill(meaning, WIDTH - INDENT), " " * INDENT))
    return "\n".join(lines)


def shown(value: object) -> str:
    """A default as `-p NAME:=VALUE` takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(shown(item) for item in value)}]"
    return f"'{value}'" if isinstance(value, str) else str(value)


def _allowed(field: dataclasses.Field[object]) -> str:
    if field.metadata["choices"]:
        return f"one of {', '.join(field.metadata['choices'])}"
    if field.metadata["range"]:
        low, high = field.metadata["range"]
        return f"{low:g} .. {high:g}"
    return ""


def _meaning(field: dataclasses.Field[object]) -> str:
    unit = f" [{field.metadata['unit']}]" if field.metadata["unit"] else ""
    return f"{field.metadata['description']}{unit}"
