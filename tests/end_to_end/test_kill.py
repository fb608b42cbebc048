"""A live cell whose processes are killed in the middle of an episode: it says so, ends, and keeps its bag."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.repair import repair
from samrl_ros.contract.topics import arm_topic, cell_topic
from tests.end_to_end.live_bag import count_actions
from tests.waiting import PATIENCE_S, wait_for

pytest.importorskip("rclpy")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.ros,
    pytest.mark.live,
    pytest.mark.timeout(3600),
    pytest.mark.usefixtures("hangup"),
]

JOINTS = {role: arm_topic(role, "joint_states") for role in ("tool_arm", "camera_arm")}
AT_REST = 0.02  # [rad/s], above the noise of a measured velocity


class Cell:
    """`samrl cell` as a process."""

    def __init__(self, out: Path, layout: str) -> None:
        self.out = out
        params = out.parent / "params.yaml"
        params.write_text("sim_bridge: {ros__parameters: {command_timeout: 0.3}}\n")  # two cores, other load
        options = ["--layout", layout, "--out", str(out), "--params", str(params), "--episodes", "3"]
        options += ["--restarts", "0"]
        command = [sys.executable, "-m", "samrl_ros.cli.main", "cell", *options]
        with (out.parent / "output.txt").open("wb") as output:
            self.process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)

    @property
    def text(self) -> str:
        return (self.out.parent / "output.txt").read_text(errors="replace")

    def children(self) -> dict[str, int]:
        """Process ids by node."""
        found = {}
        for pid, arguments in _command_lines():
            if "samrl_ros.ros2_run" in arguments and str(self.out / "params.yaml") in arguments:
                found[arguments[arguments.index("samrl_ros.ros2_run") + 1]] = pid
        return found

    def wait_until_it_acts(self) -> None:
        """Return while the first actions are under way, as the bag on disk shows."""

        def acts() -> bool:
            assert self.process.poll() is None, self.text
            return count_actions(self.out / "bag") >= 2

        wait_for(acts, "the first actions", 1.0)

    def end(self) -> int:
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            pytest.fail(f"the cell still runs:\n{self.text}")

    def summary(self) -> dict[str, Any]:
        return json.loads((self.out / "summary.json").read_text())


def _command_lines() -> list[tuple[int, list[str]]]:
    lines = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                lines.append((int(entry.name), (entry / "cmdline").read_text().split("\0")))
            except (FileNotFoundError, ProcessLookupError):
                continue
    return lines


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[str], Cell]]:
    cells: list[Cell] = []

    def make(layout: str) -> Cell:
        cells.append(Cell(tmp_path / "out", layout))
        return cells[-1]

    yield make
    for cell in cells:
        for pid in (*cell.children().values(), cell.process.pid):
            if cell.process.poll() is None or pid != cell.process.pid:
                os.kill(pid, signal.SIGKILL)
        cell.process.wait()


def _values(bag: Path, topic: str) -> list[Any]:
    return [message for _, message in open_bag(bag).decoded([topic])]


@pytest.mark.parametrize(
    ("layout", "node"),
    [
        ("processes", "sim_bridge"),
        ("processes", "model_updater"),
        ("processes", "view_planner"),
        ("processes", "policy"),
        ("processes", "manipulator"),
        ("processes", "recorder"),
        ("split", "model_updater"),
    ],
)
def test_a_killed_node_ends_the_cell_with_its_name(
    start: Any, layout: str, node: str, tmp_path: Path
) -> None:
    cell = start(layout)
    cell.wait_until_it_acts()
    os.kill(cell.children()[node], signal.SIGKILL)
    killed = time.monotonic()
    assert cell.end() == 1
    print(f"{layout}, {node}: ended {time.monotonic() - killed:.1f} s after the kill\n{cell.text}")
    assert f"{node} killed by SIGKILL" in cell.text and "Traceback" not in cell.text
    assert f"{node} killed by SIGKILL" in cell.summary()["error"]
    assert not cell.children()
    bag = cell.out / "bag"
    if node == "recorder":
        assert not (bag / "metadata.yaml").exists()
        repair(bag, tmp_path / "repaired")
        bag = tmp_path / "repaired"
    whole = open_bag(bag)
    assert not whole.truncated and whole.has_metadata
    assert {t.name for t in whole.topics if t.count} >= {*JOINTS.values(), "/clock", cell_topic("phase")}
    if node == "manipulator":
        _assert_that_the_arms_braked(bag)


def _assert_that_the_arms_braked(bag: Path) -> None:
    last = _values(bag, cell_topic("safety_state"))[-1]
    assert last.level == 1, last.message
    for role, topic in JOINTS.items():
        assert f"{role}: no command for" in last.message
        # A slow arm is at rest within one period, so that what is seen may be the hold after it.
        assert {v.key: v.value for v in last.values}[role] in ("BRAKING", "HOLD")
        speeds = [float(np.abs(m.velocity).max()) for m in _values(bag, topic)]
        assert max(speeds[-50:]) < AT_REST, speeds[-50:]


@pytest.mark.parametrize(
    ("number", "times"),
    [(signal.SIGINT, 1), (signal.SIGINT, 2), (signal.SIGTERM, 1), (signal.SIGHUP, 1)],
)
def test_an_interrupt_closes_the_bag(start: Any, number: signal.Signals, times: int) -> None:
    cell = start("split")
    cell.wait_until_it_acts()
    for _ in range(times):
        cell.process.send_signal(number)
        time.sleep(0.3)
    assert cell.end() == 130, cell.text
    assert "Traceback" not in cell.text
    assert cell.summary()["error"].startswith("interrupted")
    assert not open_bag(cell.out / "bag").truncated and (cell.out / "bag" / "metadata.yaml").exists()
    assert not cell.children()


def test_nodes_go_when_their_cell_is_killed(start: Any) -> None:
    cell = start("processes")
    cell.wait_until_it_acts()
    assert len(cell.children()) == 8
    cell.process.kill()
    wait_for(lambda: not cell.children(), "the end of all children", 0.2)
    assert not open_bag(cell.out / "bag").truncated  # the recorder was asked, not killed
