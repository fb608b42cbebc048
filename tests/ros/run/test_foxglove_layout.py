"""The layout for Foxglove shows topics and fields that exist, in panels that it defines."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import samrl_ros
from samrl_ros.bags.schemas import definition
from samrl_ros.bags.type_hash import parse
from samrl_ros.contract.topics import TOPICS

LAYOUT = json.loads(
    (Path(samrl_ros.__file__).parent / "config" / "foxglove_layout.json").read_text(encoding="utf-8")
)


def texts(value: Any) -> Iterator[str]:
    """Every text in the layout's panels."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for entry in value:
            yield from texts(entry)
    elif isinstance(value, str):
        yield value


def panels(node: Any) -> Iterator[str]:
    """Names of the panels that are laid out."""
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


LIVE = {f"/cell/live_view/{name}" for name in ("difference", "camera_cloud", "model_cloud", "view")}
IN_3D = LAYOUT["configById"]["3D!cell"]["topics"]
SHOWN = {text for text in [*texts(LAYOUT["configById"]), *IN_3D] if text.startswith("/")}
PATHS = sorted(SHOWN - LIVE)  # the others are made for clients of --view and by `samrl bag view`


def test_every_panel_is_defined_and_laid_out_once() -> None:
    assert sorted(panels(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


@pytest.mark.parametrize("path", PATHS)
def test_what_a_panel_shows_exists(path: str) -> None:
    topic, *fields = path.split(".")
    assert TOPICS[topic].recorded  # so that the bag opens the same way
    type_name = TOPICS[topic].type
    described = parse(type_name, definition(type_name).text)
    for field in fields:
        (kind,) = [kind for name, kind in described[type_name][1] if name == field]
        type_name = kind[1]


def test_what_is_made_for_clients_is_shown_to_them() -> None:
    pytest.importorskip("rclpy")
    from samrl_ros.cell.viewer.viewer_messages import MADE

    assert LIVE == set(MADE) and LIVE <= SHOWN and not LIVE & set(TOPICS)


def test_both_arms_are_shown() -> None:
    assert {"/cell/tool_arm/robot_description", "/cell/camera_arm/robot_description"} <= set(PATHS)
