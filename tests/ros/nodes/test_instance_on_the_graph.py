"""A cell instance behind the bridge: nothing of it is told, images come late, its values are sealed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy")

from samrl_core.cell.calibration.cell_correction import CellCorrection, write_correction
from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.errors import InputError
from samrl_ros.cell.local_graph import LocalGraph
from samrl_ros.cell.options import CellOptions, prepare
from samrl_ros.contract.topics import camera_topic
from samrl_ros.conversions.from_message import stamp_ns

pytestmark = pytest.mark.ros

CELL, TYPICAL = cell_named(), "typical:1"
COLOR = camera_topic("color/image_raw")


def graph_of(instance: str) -> tuple[LocalGraph, list[tuple[int, str, Any]]]:
    """A graph, and what its bridge published: when, on what topic, what."""
    heard: list[tuple[int, str, Any]] = []
    graph = LocalGraph("peg_insertion", instance=instance)
    graph.listener = lambda topic, message: heard.append((graph.bridge.time_ns, topic, message))
    return graph, heard


def test_what_is_announced_is_the_nominal_cell() -> None:
    told = []
    for name in ("nominal", TYPICAL):
        graph, heard = graph_of(name)
        graph.bridge.announce()
        graph.drain()
        graph.close()
        told.append([(topic, message) for _, topic, message in heard])
    assert len(told[0]) > 8
    for (topic, nominal), (same, found) in zip(*told, strict=True):
        assert (topic, nominal) == (same, found)


def test_images_come_late_with_their_own_stamps() -> None:
    graph, heard = graph_of(TYPICAL)
    graph.bridge.start_episode(0, 3)
    for _ in range(400):
        graph.bridge.tick()
    graph.drain()
    graph.close()
    timing = instance_named(TYPICAL, CELL).timing
    stamps = [stamp_ns(message) for _, topic, message in heard if topic == COLOR]
    assert len(stamps) == 4, "those of 0, 100, 200 and 300 ms; that of 400 ms is under way"
    offset = 1e9 * (timing.clock_offset + timing.stamp_late)
    start = graph.bridge.time_ns - 400_000_000
    for k, stamp in enumerate(stamps):
        assert stamp == pytest.approx(start + k * 100_000_000 + offset, abs=1.0)


def test_frames_under_way_do_not_reach_the_next_episode() -> None:
    graph, heard = graph_of(TYPICAL)
    graph.bridge.start_episode(0, 3)
    for _ in range(105):
        graph.bridge.tick()
    graph.bridge.start_episode(1, 4)
    begun = graph.bridge.time_ns
    for _ in range(90):
        graph.bridge.tick()
    graph.drain()
    graph.close()
    since = [message for _, topic, message in heard if topic == COLOR]
    assert sum(stamp_ns(m) >= begun for m in since) == 1 and len(since) == 2


@pytest.mark.parametrize("options", [{"world": "mock"}, {"hardware": ("panda",)}])
def test_instances_are_for_the_simulated_cell(options: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--instance typical:1"):
        prepare(CellOptions(out=tmp_path / "out", instance=TYPICAL, **options))


def test_the_run_is_told_which_cell(tmp_path: Path) -> None:
    options = CellOptions(
        out=tmp_path / "out", instance="typical:test:4", scale=("depth=2",), policy="optimised"
    )
    assert "instance: typical:test:4 depth=2" in prepare(options).read_text()


def test_bridge_and_loop_are_told_of_a_correction(tmp_path: Path) -> None:
    file = tmp_path / "cell.json"
    write_correction(file, CellCorrection(numbers={"depth_scale": 0.02}))
    options = CellOptions(
        out=tmp_path / "out",
        instance="typical:4",
        scale=("depth_scale=1",),
        policy="optimised",
        correction=file,
    )
    nodes = yaml.safe_load(prepare(options).read_text())
    told = nodes["/cell/sim_bridge"]["ros__parameters"]
    assert told["correction"] == str(file) and told["instance"] == "typical:4 depth_scale=1"
    for name in ("model_updater", "view_planner", "policy"):
        assert nodes[f"/cell/{name}"]["ros__parameters"]["correction"] == str(file)
    with pytest.raises(InputError, match=r"missing\.json"):
        prepare(replace(options, out=tmp_path / "other", correction=tmp_path / "missing.json"))
    assert not (tmp_path / "other").exists()
