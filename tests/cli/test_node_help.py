"""`ros2 run samrl_ros NODE --help` says what the node takes and starts nothing; the unknown is refused."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import pytest

pytest.importorskip("rclpy")

from samrl_ros import ros2_run
from samrl_ros.hosting import host
from samrl_ros.nodes.registry import NODES, all_settings

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def nothing_starts(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """What would be handed to ROS."""
    started: list[list[str]] = []
    monkeypatch.setattr(host, "run_process", lambda nodes, arguments: started.append(arguments[1:]) or 0)
    return started


@pytest.mark.parametrize("flag", ["--help", "-h"])
@pytest.mark.parametrize("name", NODES)
def test_every_node_lists_its_parameters(
    name: str, flag: str, nothing_starts: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert ros2_run.run([name, flag]) == 0 and not nothing_starts
    said = capsys.readouterr().out
    assert f"ros2 run samrl_ros {name}" in said and "--params-file" in said and "autostart" in said
    for field in dataclasses.fields(all_settings()[name]):
        assert f"  {field.name} (default " in said
        for choice in field.metadata["choices"]:
            assert choice in said


@pytest.mark.parametrize(
    "arguments",
    [["--foo"], ["--seed", "3"], ["--ros-args", "-p", "seed:=1", "--", "--foo"], ["--params", "x.yaml"]],
)
def test_unknown_arguments_are_refused(
    arguments: list[str], nothing_starts: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert ros2_run.run(["policy", *arguments]) == 2 and not nothing_starts
    said = capsys.readouterr()
    own = next(a for a in (arguments[arguments.index("--") + 1 :] if "--" in arguments else arguments))
    assert own in said.err and "--ros-args" in said.err and not said.out


def test_arguments_of_ros_reach_it(nothing_starts: list[list[str]]) -> None:
    given = ["--ros-args", "-p", "seed:=1", "--log-level", "debug", "--"]
    assert ros2_run.run(["policy", "view_planner", *given]) == 0
    assert nothing_starts == [given]


@pytest.mark.parametrize(("given", "code"), [([], 2), (["--help"], 0), (["-h"], 0), (["policx"], 2)])
def test_without_a_node_it_lists_them(
    given: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ros2_run.run(given) == code
    said = capsys.readouterr()
    assert all(name in (said.out if code == 0 else said.err) for name in (*NODES, "cell"))


@pytest.mark.thorough
def test_help_is_the_executables_own() -> None:
    command = [sys.executable, "-m", "samrl_ros.ros2_run", "recorder", "--help"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and "record_on_start (default true)" in done.stdout, done.stderr
