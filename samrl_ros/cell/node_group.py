"""The cell's nodes as threads of this process, or each in its own process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.files import room_for
from samrl_ros.cell.pulse import Silence, pulse_of
from samrl_ros.hosting.threads import FreedMemory, one_thread_per_library

STOP_TIMEOUT_S = 15.0  # asleep, held by a signal, or of processor time
STOP_LOOK_S = 0.02
SWITCH_INTERVAL_S = 2e-4
# Nodes that compute for long, by process. The planner and the policy take turns: they share one.
# So is the border to real arms: it must keep up with a kilohertz of joint states.
COMPUTING = (("hardware_bridge",), ("model_updater",), ("view_planner", "policy"), ("residual_trainer",))


@dataclass(frozen=True)
class Home:
    """Where nodes live."""

    nodes: tuple[str, ...]
    pid: int
    threads: frozenset[int] = frozenset()  # native ids of theirs; empty where the process is theirs alone


class ThreadGroup:
    """Every node with its own executor thread in this process."""

    def __init__(self) -> None:
        # The world's thread gives up the interpreter in every NumPy call; with the default of 5 ms it would
        # wait that long each time for a thread that computes.
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        one_thread_per_library()
        self._memory = FreedMemory()
        self._names: list[str] = []
        self._threads: list[Any] = []

    def start(self, names: Sequence[str]) -> None:
        """Create and start nodes; parameters come from the arguments that ROS was started with."""
        from samrl_ros.hosting import NodeThread
        from samrl_ros.nodes.registry import make_node

        for name in names:
            thread = NodeThread(make_node(name))
            self._names.append(name)
            self._threads.append(thread)
            thread.start()

    def pids(self) -> dict[str, int]:
        """All nodes share this process."""
        return {"cell": os.getpid()}

    def homes(self) -> list[Home]:
        """Each node with its threads, by their names."""
        found = []
        for name in self._names:
            own = {t.native_id for t in threading.enumerate() if t.name.partition(" ")[0] == name}
            found.append(Home((name,), os.getpid(), frozenset(one for one in own if one is not None)))
        return found

    def ended(self) -> dict[tuple[str, ...], str]:
        """Nodes that do not work any more, and why."""
        pairs = zip(self._names, self._threads, strict=True)
        return {(name,): thread.failure for name, thread in pairs if thread.failure}

    def restarts_alone(self, nodes: tuple[str, ...]) -> bool:
        """Threads share their process's memory: none is started anew."""
        return False

    def trouble(self) -> str:
        """The first failure, empty while all work."""
        return next(iter(self.ended().values()), "")

    def stop(self) -> str:
        """Stop in reverse order; returns what did not stop."""
        hanging = []
        for thread in reversed(self._threads):
            try:
                thread.stop()
            except TimeoutError as error:
                hanging.append(str(error))
        self._memory.stop()
        return "; ".join(hanging)


class MixedGroup:
    """Nodes that compute for long in processes of their own, all others as threads of this one.

    Python runs one thread at a time: with the renderer's gradients in the same process the world and the
    manipulator stand still meanwhile (measured: a third of the speed on two cores).
    """

    def __init__(self, arguments: list[str], logs: Path) -> None:
        self._threads = ThreadGroup()
        self._processes = ProcessGroup(arguments, logs)

    def start(self, names: Sequence[str]) -> None:
        """Start nodes where they belong."""
        together = {process[0]: process for process in COMPUTING}
        beside = {name for process in COMPUTING for name in process[1:]}
        for name in names:
            if name in together:
                self._processes.start_process(together[name])
            elif name not in beside:
                self._threads.start([name])

    def pids(self) -> dict[str, int]:
        """Process ids: the computing nodes, and this process for all others."""
        return {**self._threads.pids(), **self._processes.pids()}

    def homes(self) -> list[Home]:
        """Where each node lives."""
        return self._processes.homes() + self._threads.homes()

    def ended(self) -> dict[tuple[str, ...], str]:
        """Nodes that do not work any more, and why."""
        return {**self._processes.ended(), **self._threads.ended()}

    def restarts_alone(self, nodes: tuple[str, ...]) -> bool:
        """Whether these have a process of their own."""
        return self._processes.restarts_alone(nodes)

    def restart(self, nodes: tuple[str, ...]) -> None:
        """Start nodes anew whose process has ended."""
        self._processes.start_process(nodes)

    def kill(self, nodes: tuple[str, ...]) -> None:
        """End the process of nodes at once."""
        self._processes.kill(nodes)

    def trouble(self) -> str:
        """The first failure, empty while all work."""
        return next(iter(self.ended().values()), "")

    def stop(self) -> str:
        """Stop the threads first: the recorder's among them has then heard all."""
        return "; ".join(filter(None, [self._threads.stop(), self._processes.stop()]))


class ProcessGroup:
    """Every node as a child process that dies with this one; output goes to a log file per process."""

    def __init__(self, arguments: list[str], logs: Path) -> None:
        self._arguments = arguments
        self._logs = logs
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        logs.mkdir(parents=True, exist_ok=True)

    def start(self, names: Sequence[str]) -> None:
        """Start each node's executable."""
        for name in names:
            self.start_process((name,))

    def start_process(self, nodes: Sequence[str]) -> None:
        """Start several nodes in one process, which is called by all their names."""
        command = [sys.executable, "-m", "samrl_ros.ros2_run", *nodes, *self._arguments]
        name = "+".join(nodes)
        path = self._logs / f"{name}.log"
        with room_for(path), path.open("ab") as log:
            self._children[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # a terminal's Ctrl-C reaches us alone; we stop them in order
                preexec_fn=ends_with_parent(signal.SIGINT),  # no arm is commanded by an orphan
            )

    def pids(self) -> dict[str, int]:
        """Process ids by the names of their nodes."""
        return {name: child.pid for name, child in self._children.items()}

    def homes(self) -> list[Home]:
        """Each child with its nodes."""
        return [Home(tuple(name.split("+")), child.pid) for name, child in self._children.items()]

    def ended(self) -> dict[tuple[str, ...], str]:
        """Children that have ended, each with the end of its log."""
        found = {}
        for name, child in self._children.items():
            code = child.poll()
            if code is not None:
                how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
                log = self._logs / f"{name}.log"
                found[tuple(name.split("+"))] = f"{name} {how}; its log: {log}{self._tail(name)}"
        return found

    def restarts_alone(self, nodes: tuple[str, ...]) -> bool:
        """Whether these have a process of their own."""
        return "+".join(nodes) in self._children

    def restart(self, nodes: tuple[str, ...]) -> None:
        """Start nodes anew whose process has ended."""
        self.start_process(nodes)

    def kill(self, nodes: tuple[str, ...]) -> None:
        """End the process of nodes at once."""
        self._children["+".join(nodes)].kill()

    def trouble(self) -> str:
        """The first child that has ended, empty while all run."""
        return next(iter(self.ended().values()), "")

    def stop(self) -> str:
        """SIGINT in reverse order, then SIGKILL for what hangs; returns what had to be killed.

        On a busy machine a process is slow to stop, not hung: what counts is the time that it had.
        """
        hanging = []
        for child in reversed(self._children.values()):
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
        silences = {name: Silence(time.monotonic()) for name in reversed(self._children)}
        while silences:
            for name, silence in list(silences.items()):
                child = self._children[name]
                if child.poll() is not None:
                    del silences[name]
                    continue
                silence.look(pulse_of(child.pid), time.monotonic())
                if max(silence.asleep_s, silence.used_s, silence.stopped_s) > STOP_TIMEOUT_S:
                    child.kill()
                    child.wait()
                    hanging.append(f"{name} did not stop within {STOP_TIMEOUT_S:g} s and was killed")
            time.sleep(STOP_LOOK_S)
        return "; ".join(hanging)

    def _tail(self, name: str) -> str:
        lines = (self._logs / f"{name}.log").read_text(errors="replace").strip().splitlines()
        return "\n  " + "\n  ".join(lines[-5:]) if lines else ""
