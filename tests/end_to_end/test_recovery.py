"""A live cell that is stopped, reset, and loses a node: it goes on, and says what happened."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import cell_topic
from tests.end_to_end.live_bag import count_actions
from tests.waiting import PATIENCE_S, wait_for

pytest.importorskip("rclpy")
pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.timeout(3600)]
CLI = [sys.executable, "-m", "samrl_ros.cli.main"]


class Cell:
    """`samrl cell` as a process: two episodes of three actions."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.out, self._output = folder / "out", folder / "output.txt"
        given = ["--episodes", "2", "--max-actions", "3", "--out", str(self.out), *options]
        with self._output.open("wb") as output:
            self.process = subprocess.Popen([*CLI, "cell", *given], stdout=output, stderr=subprocess.STDOUT)

    @property
    def text(self) -> str:
        return self._output.read_text(errors="replace")

    def wait_for_text(self, text: str) -> None:
        def said() -> bool:
            assert self.process.poll() is None, self.text
            return text in self.text

        wait_for(said, text, 0.05)

    def wait_until_it_acts(self) -> None:
        def acts() -> bool:
            assert self.process.poll() is None, self.text
            return count_actions(self.out / "bag") > 0

        wait_for(acts, "the first action", 0.2)

    def child(self, node: str) -> int:
        """Process id of a node's process."""
        for child in Path(f"/proc/{self.process.pid}/task").glob("*/children"):
            for pid in child.read_text().split():
                if node in Path(f"/proc/{pid}/cmdline").read_text().split("\0"):
                    return int(pid)
        raise AssertionError(f"no process of {node}\n{self.text}")


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    cell = Cell(tmp_path)
    yield cell
    cell.process.send_signal(signal.SIGINT)
    try:
        cell.process.wait(PATIENCE_S)
    finally:
        cell.process.kill()


def test_a_run_outlasts_a_stop_and_a_death(cell: Cell) -> None:
    cell.wait_until_it_acts()
    stopped = subprocess.run([*CLI, "estop"], capture_output=True, text=True)
    assert stopped.returncode == 0, stopped.stdout + stopped.stderr
    cell.wait_for_text("samrl estop --reset")  # it says how to go on
    os.kill(cell.child("policy"), signal.SIGKILL)
    cell.wait_for_text("restart 1 of 3")

    def reset() -> bool:  # refused while an arm moves
        return subprocess.run([*CLI, "estop", "--reset"], capture_output=True).returncode == 0

    wait_for(reset, "the reset", 0.2)
    assert cell.process.wait(PATIENCE_S) == 0, cell.text
    summary = json.loads((cell.out / "summary.json").read_text())
    assert [e["reason"] for e in summary["episodes"]] == ["action_limit"] * 2 and summary["given_up"] == 0
    # A stop in motion gives the motion up, too; between two motions there is none.
    told = [one["what"] for one in summary["incidents"] if one["what"] != "motion"]
    assert told[:3] == ["estop", "restart", "reset"] and told.count("back") == 2, told
    phases = [message.data for _, message in open_bag(cell.out / "bag").decoded([cell_topic("phase")])]
    assert phases[phases.index("stopped") + 1] == "update" and phases.count("stopped") == 1
    assert "node policy" in (cell.out / "run.html").read_text()
