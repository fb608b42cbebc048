"""The fault bench sees what it is there for; some of its cells at each commit, all by `make faults`."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.world import make_world
from tests.faults.limits import extremes, read_rows
from tests.faults.watched_world import StateFile, WatchedWorld, row_type

STEP_NS = 1_000_000


def _rows(count: int) -> np.ndarray:
    """Both arms at rest at home."""
    rows = np.zeros(count, row_type(7))
    rows["time_ns"] = STEP_NS * np.arange(1, count + 1)
    rows["placed"][0] = 1
    for role in ROLES:
        for part in ("position", "measured_position"):
            rows[role][part] = cell_named().arm(role).home
    return rows


def test_rest_at_home_keeps_every_limit() -> None:
    assert all(extreme.kept for extreme in extremes(_rows(50)).values())


@pytest.mark.parametrize(
    ("broken", "part", "first", "value"),
    [
        ("position", "position", 20, 9.0),
        ("velocity", "velocity", 20, 9.0),
        ("acceleration", "acceleration", 20, 1e3),
        ("measured position", "measured_position", 20, 9.0),
        ("measured velocity", "measured_velocity", 20, 9.0),
        ("position", "position", 20, float("nan")),
    ],
)
def test_a_limit_that_is_broken_is_found(broken: str, part: str, first: int, value: float) -> None:
    rows = _rows(50)
    rows["tool_arm"][part][first, 3] = value
    found = extremes(rows)
    assert not found[broken].kept and "panda_joint4 at 0.021 s" in found[broken].place


def test_a_jump_is_found_whatever_the_fields_say_unless_the_arms_were_placed_anew() -> None:
    rows = _rows(50)
    rows["camera_arm"]["position"][20:, 0] += 0.01
    assert not extremes(rows)["speed"].kept
    rows["placed"][20] = 1
    assert extremes(rows)["speed"].kept
    rows["tool_arm"]["velocity"][30:, 0] = 0.1
    assert not extremes(rows)["change of velocity"].kept


def test_a_watched_world_writes_down_what_it_is_made_to_do(tmp_path: Path) -> None:
    from samrl_core.cell.tasks import task_named

    inner = make_world("mock", task_named("peg_insertion"), cell_named())
    world = WatchedWorld(inner, str(tmp_path / "steps"))
    held = world.read_arm("tool_arm").position
    for i in range(5):
        moved = ArmCommand(world.time_ns, held + 1e-4 * i, held * 0 + 0.1, held * 0, held * 0)
        world.command("tool_arm", moved)
        world.advance()
    world.close()
    rows = read_rows(tmp_path / "steps")
    np.testing.assert_array_equal(rows["tool_arm"]["position"][:, 2], held[2] + 1e-4 * np.arange(5))
    assert rows["placed"].tolist() == [1, 0, 0, 0, 0] and (np.diff(rows["time_ns"]) == STEP_NS).all()
    assert StateFile(tmp_path / "steps.state").read()[1] == 0.1


class _Sent:
    def __init__(self) -> None:
        self.data: list[bytes] = []

    def publish(self, data: bytes) -> None:
        self.data.append(data)


@pytest.mark.ros
@pytest.mark.parametrize(
    ("mode", "amount", "arrived"),
    [
        ("pass", 0, [b"aa", b"bb", b"cc", b"dd"]),
        ("drop", 1, []),
        ("cease", 0, []),
        ("duplicate", 2, [b"aa", b"aa", b"bb", b"bb", b"cc", b"cc", b"dd", b"dd"]),
        ("reorder", 2, [b"bb", b"aa", b"dd", b"cc"]),
        ("truncate", 1, [b"a", b"b", b"c", b"d"]),
        ("delay", 0, [b"aa", b"bb", b"cc", b"dd"]),
        ("delay", 1e6, []),
    ],
)
def test_a_relay_does_what_it_is_told(mode: str, amount: float, arrived: list[bytes]) -> None:
    pytest.importorskip("rclpy")
    from tests.faults.relay import Channel

    sent = _Sent()
    channel = Channel(sent, Random(0))
    channel.set(mode, amount)
    for data in (b"aa", b"bb", b"cc", b"dd"):
        channel.take(data)
    channel.send_late()
    assert sent.data == arrived


def test_a_broken_promise_stands_in_table_and_picture(tmp_path: Path) -> None:
    from tests.faults.page import draw, write_page
    from tests.faults.trial import Trial

    for fault, ok in (("sound", True), ("unsound", False)):
        trial = Trial(fault, "motion", "it holds", tmp_path / "none", str)
        trial.check("it holds", ok, "0.3 of 0.1")
        trial.save(tmp_path / "cells", "abc")
    said = write_page(tmp_path / "cells", tmp_path / "faults.md")
    assert "1 of 2 promises kept" in said and "broken: unsound @ motion" in said
    assert (
        "| unsound | motion | it holds | it holds: 0.3 of 0.1 | NO |" in (tmp_path / "faults.md").read_text()
    )
    draw(tmp_path / "cells", tmp_path / "faults.png")
    assert (tmp_path / "faults.png").stat().st_size > 1000
    assert json.loads((tmp_path / "cells" / "sound@motion.json").read_text())["passed"]


def test_every_cell_of_the_table_has_a_name_of_its_own() -> None:
    pytest.importorskip("rclpy")
    from tests.faults.bench import table

    names = [(fault, moment) for _, fault, moment in table("", "")]
    assert len(names) == len(set(names)) > 60


@pytest.fixture
def graph(tmp_path: Path) -> Any:
    pytest.importorskip("rclpy")
    from samrl_ros.hosting.host import start_ros, stop_ros
    from tests.faults.arms_graph import ArmsGraph

    start_ros([])
    made = ArmsGraph(tmp_path, "plain")
    try:
        made.start()
        yield made
    finally:
        made.stop()
        stop_ros()


@pytest.mark.ros
@pytest.mark.slow  # `make faults` tries the whole table
def test_some_cells_of_the_table(graph: Any) -> None:
    from tests.faults.arms_faults import FAULTS, run

    faults = {fault.name: fault for fault in FAULTS}
    for name in ("manipulator_paused_3s", "foreign_command"):
        trial = run(graph, faults[name], "motion")
        assert trial.passed, [check for check in trial.checks if not check.ok]
