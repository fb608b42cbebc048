"""Processes of a graph under test: started with a mark of their own, and found again by it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
DOES = "as told"  # a helper's answer to an order
MARK = "SAMRL_FAULTS_RUN"  # in the environment of every process of a run: orphans are found by it


def environment(run: str, steps: Path | None = None) -> dict[str, str]:
    """The environment of a run's processes; with `steps`, their world writes down every step."""
    paths = [str(ROOT)] if steps is None else [str(HERE / "hook"), str(ROOT)]
    found = {**os.environ, MARK: run, "PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1"}
    if steps is not None:
        found["SAMRL_FAULTS_STEPS"] = str(steps)
    return found


def kill_marked(run: str) -> None:
    """End all that is left of a run."""
    for pid in marked(run):
        for number in (signal.SIGKILL, signal.SIGCONT):
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                break


def marked(run: str) -> dict[int, list[str]]:
    """Command lines of all living processes of a run, this one left out."""
    wanted, found = f"{MARK}={run}".encode(), {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            if wanted in (entry / "environ").read_bytes().split(b"\0"):
                arguments = (entry / "cmdline").read_text().split("\0")
                if arguments != [""]:  # a zombie has none
                    found[int(entry.name)] = arguments
        except (OSError, UnicodeDecodeError):
            continue
    return found


class Processes:
    """Named processes of one run, each with a log file."""

    def __init__(self, folder: Path, run: str) -> None:
        self.folder, self.run = folder, run
        self.children: dict[str, subprocess.Popen[bytes]] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def start(self, name: str, command: Sequence[str], env: Mapping[str, str]) -> None:
        """Start one; its output is appended to NAME.log."""
        with (self.folder / f"{name}.log").open("ab") as log:
            self.children[name] = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=dict(env),
                start_new_session=True,
            )

    def start_node(self, name: str, arguments: Sequence[str], env: Mapping[str, str], *host: str) -> None:
        """Start a node of the cell, on a host that a command leads to."""
        self.start(name, [*host, sys.executable, "-m", "samrl_ros.ros2_run", name, *arguments], env)

    def start_module(
        self, name: str, arguments: Sequence[str], env: Mapping[str, str], module: str = ""
    ) -> None:
        """Start a helper of the bench; it takes orders on its standard input, and ends with it."""
        self.start(name, [sys.executable, "-m", f"tests.faults.{module or name}", *arguments], env)

    def tell(self, name: str, line: str) -> None:
        """A line to a process's standard input."""
        stream = self.children[name].stdin
        assert stream is not None
        stream.write(f"{line}\n".encode())
        stream.flush()

    def text(self, name: str) -> str:
        """All that a process has said."""
        path = self.folder / f"{name}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    def alive(self, name: str) -> bool:
        """Whether it runs still."""
        return self.children[name].poll() is None

    def end(self) -> None:
        """Kill all that is left of the run, and reap it."""
        kill_marked(self.run)
        for child in self.children.values():
            child.wait()
