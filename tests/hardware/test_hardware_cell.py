"""`samrl cell --hardware` over DDS, on a process that speaks the drivers' topics with physics behind them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from samrl_ros.cli.main import run as run_here
from samrl_ros.contract.exit_codes import FAILED, INPUT_REFUSED, INTERRUPTED, OK
from tests.waiting import wait_for

pytest.importorskip("rclpy")
pytestmark = [pytest.mark.ros]
DRIVERS = [f"--hardware={name}" for name in ("franka_ros2", "flexiv_ros2", "realsense_ros", "segmenter")]
ROOT = Path(__file__).resolve().parents[2]
StartFake = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def fake_cell(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[StartFake]:
    monkeypatch.setenv("ROS_DOMAIN_ID", "84")
    children = []

    def start(*options: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "tests.hardware.fake_cell", "peg_insertion", *options]
        command += ["--truth", str(tmp_path / "truth.jsonl"), "--offset", "0.008"]
        children.append(subprocess.Popen(command, cwd=ROOT))
        return children[-1]

    yield start
    for child in children:
        child.kill()
        child.wait()


def samrl(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "samrl_ros.cli.main", *arguments, "--sim-time"]


def agrees() -> bool:
    """Whether the pre-flight passes; the drivers may still be starting."""
    command = samrl("preflight", "--segmenter", "segmenter", "--seconds", "0.5")
    return subprocess.run(command, check=False, capture_output=True).returncode == OK


@pytest.mark.live
def test_drivers_that_disagree_start_nothing(fake_cell: StartFake, tmp_path: Path) -> None:
    fake_cell("--fault", "degrees")
    said: list[str] = []

    def refused() -> bool:
        command = samrl("cell", *DRIVERS, "--out", str(tmp_path / "run"))
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        assert done.returncode == FAILED, done.stdout
        said.append(done.stdout)
        return "order and units" in done.stdout

    wait_for(refused, "the pre-flight names the arm that speaks degrees")
    assert "nothing is started" in said[-1] and not (tmp_path / "run").exists()


@pytest.mark.slow
def test_observing_records_the_arms_and_ends_with_ctrl_c(fake_cell: StartFake, tmp_path: Path) -> None:
    from samrl_ros.bags.reader import open_bag

    fake_cell()
    wait_for(agrees, "the drivers agree")
    command = samrl("cell", *DRIVERS, "--observe", "--out", str(tmp_path / "run"))
    run = subprocess.Popen(command)
    bag = tmp_path / "run" / "bag"

    def recorded() -> bool:
        assert run.poll() is None, "the run has ended"
        return sum(file.stat().st_size for file in bag.glob("*.mcap")) > 600_000

    wait_for(recorded, "joint states and images are in the bag")
    run.send_signal(signal.SIGINT)
    assert run.wait() == INTERRUPTED
    counts = {topic.name: topic.count for topic in open_bag(bag).topics}
    assert counts["/cell/tool_arm/joint_states"] > 100 and counts["/cell/camera/mask/image_raw"] > 3
    assert not counts.get("/cell/tool_arm/command")


@pytest.mark.slow
def test_peg_insertion_runs_on_drivers_alone(fake_cell: StartFake, tmp_path: Path) -> None:
    fake_cell()
    wait_for(agrees, "the drivers agree")
    command = samrl("cell", *DRIVERS, "--judge", "operator", "--episodes", "2")
    outs: list[Path] = []

    def ran() -> bool:  # a busy machine loses images, and a pre-flight then refuses to go on
        outs.append(tmp_path / f"run-{len(outs)}")
        code = subprocess.run([*command, "--out", str(outs[-1])], check=False).returncode
        if code == FAILED and outs[-1].exists():
            assert "pre-flight" in json.loads((outs[-1] / "summary.json").read_text())["error"]
        assert code in (OK, FAILED)
        return code == OK

    wait_for(ran, "the pre-flights pass")
    out = outs[-1]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["judged_by"] == "operator" and len(summary["episodes"]) == 2
    assert summary["successes"] == summary["detector"]["true_positive"] == 2, summary["episodes"]
    replay = [sys.executable, "-m", "samrl_ros.cli.main", "replay", str(out / "bag"), "--out"]
    assert subprocess.run([*replay, str(tmp_path / "replay.json")], check=False).returncode == OK


@pytest.mark.parametrize(
    "options",
    [
        ["--observe"],
        ["--hardware=franka_ros2"],
        [*DRIVERS, "--judge", "nobody"],
        ["--judge", "operator"],
        [*DRIVERS, "--world", "mock"],
        [*DRIVERS, "--real-time-factor", "2.0"],
        [*DRIVERS, "--hand-eye", "no_such_file.json"],
    ],
)
def test_options_that_do_not_fit_are_refused(options: list[str], tmp_path: Path) -> None:
    assert run_here(["cell", *options, "--out", str(tmp_path / "run")]) == INPUT_REFUSED
    assert not (tmp_path / "run").exists()
