"""Threads, signals and exit codes around nodes."""

from __future__ import annotations

import contextlib
import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from typing import Any, TypeVar

import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy_pybind11
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from samrl_core.common.errors import InputError, SamrlError
from samrl_ros.contract.exit_codes import FAILED, INPUT_REFUSED, OK
from samrl_ros.contract.interrupts import handled
from samrl_ros.contract.quiet_end import let_go_of_terminal
from samrl_ros.hosting.behaviour_node import BehaviourNode, MakeBehaviour
from samrl_ros.hosting.cell_node import ACTIVE, FINALIZED, CellNode
from samrl_ros.hosting.dds import check_domain, configure_dds
from samrl_ros.hosting.leaving import LEAVE_S, leave_graph
from samrl_ros.hosting.shared_memory import pass_over_dead_ports

Result = TypeVar("Result")
# Two unrelated types, RuntimeErrors both, which rclpy does not export by a public name.
_BAD_ARGUMENTS = (_rclpy_pybind11.RCLError, _rclpy_pybind11.UnknownROSArgsError)
WAKE_S = 0.05  # a bound for every wait: EventsExecutor without a timeout spins at full load and runs nothing
JOIN_S = 10.0  # ASSUMPTION: a node that needs longer to stop hangs


def start_ros(arguments: Sequence[str] | None = None) -> None:
    """Initialise ROS with the cell's middleware defaults, leaving SIGINT and SIGTERM to us.

    Raises:
        InputError: what follows `--ros-args` cannot be understood, or there is no such ROS domain.
    """
    check_domain(os.environ)
    configure_dds()
    pass_over_dead_ports()
    try:
        rclpy.init(
            args=list(arguments) if arguments is not None else None,
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except _BAD_ARGUMENTS as error:
        raise InputError(f"ROS arguments refused: {' '.join(str(error).split())}") from error


def check_ros_arguments(arguments: Sequence[str]) -> None:
    """Parse what would follow `--ros-args`, starting nothing that stays.

    Raises:
        InputError: it cannot be understood.
    """
    context = Context()
    try:
        context.init(["check", "--ros-args", *arguments])
    except _BAD_ARGUMENTS as error:
        raise InputError(f"ROS arguments refused: {' '.join(str(error).split())}") from error
    context.try_shutdown()


def stop_ros() -> None:
    """Shut ROS down; once more does no harm."""
    try_shutdown()


@contextlib.contextmanager
def on_graph(arguments: Sequence[str], patience_s: float = LEAVE_S) -> Generator[list[Callable[[], object]]]:
    """Within the block ROS is there; what is appended is closed after it, the last one first, ROS at the end.

    Print and write within the block: leaving may end the process, see `leave_graph`.

    Raises:
        InputError: as `start_ros`.
    """
    start_ros(arguments)
    closers: list[Callable[[], object]] = [stop_ros]
    try:
        yield closers
    finally:
        leave_graph(closers, patience_s)


class NodeThread:
    """One node with its own thread and its own executor; several of these share a process.

    The node is created in the caller's thread, so that bad parameters raise there. Everything else that
    touches it happens in its own thread: use `run` from outside.
    """

    def __init__(self, node: CellNode) -> None:
        self.node = node
        self._work: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._executor = EventsExecutor()
        self._thread = threading.Thread(target=self._loop, name=node.get_name(), daemon=True)
        self.crash: BaseException | None = None  # of the thread itself, outside the node's own guard

    def start(self) -> None:
        """Start the thread; with the parameter `autostart`, configure and activate the node first."""
        self._thread.start()

    def run(self, function: Callable[[], Result], timeout: float = 30.0) -> Result:
        """Run a function in the node's thread and return its result. Raises TimeoutError."""
        future: Future[Result] = Future()

        def work() -> None:
            try:
                future.set_result(function())
            except BaseException as error:  # noqa: BLE001 (handed to the caller, who raises it)
                future.set_exception(error)

        self._work.put(work)
        self._executor.wake()
        return future.result(timeout)

    @property
    def failure(self) -> str:
        """Why the node does not work, empty while it does."""
        if self.crash is not None:
            # The thread's own name: the node is destroyed after a crash and cannot be asked for its.
            return f"{self._thread.name}: {type(self.crash).__name__}: {self.crash}"
        return f"{self.node.get_name()}: {self.node.failure}" if self.node.failure else ""

    def stop(self) -> None:
        """Deactivate, clean up, destroy the node and end its thread. Raises TimeoutError when it hangs."""
        self._stop.set()
        if self._thread.ident is None:
            self.node.destroy_node()
            return
        self._thread.join(JOIN_S)
        if self._thread.is_alive():
            raise TimeoutError(
                f"node {self._thread.name} did not stop within {JOIN_S:.0f} s: one of its callbacks hangs"
            )

    def _loop(self) -> None:
        try:
            self._executor.add_node(self.node)
            if self.node.get_parameter("autostart").value:
                bring_up(self.node)
            while not self._stop.is_set():
                self._executor.spin_once(timeout_sec=WAKE_S)
                self.node.settle()
                self._do_work()
        except BaseException as error:  # noqa: BLE001 (a dead thread must be seen by its owner)
            self.crash = error
        finally:
            self._finish()

    def _do_work(self) -> None:
        while not self._work.empty():
            self._work.get_nowait()()

    def _finish(self) -> None:
        try:
            if self.node.stage != FINALIZED:
                self.node.trigger_shutdown()
            self._executor.remove_node(self.node)
            self.node.destroy_node()
            self._executor.shutdown()
        except Exception as error:  # noqa: BLE001 (as above; the first cause wins)
            self.crash = self.crash or error


def bring_up(node: CellNode) -> bool:
    """Configure and activate; False, with `node.failure` set, when that did not work."""
    for trigger in (node.trigger_configure, node.trigger_activate):
        if trigger() != TransitionCallbackReturn.SUCCESS:
            node.report()
            return False
    return node.stage == ACTIVE


@contextlib.contextmanager
def stop_signals() -> Generator[threading.Event]:
    """An event that SIGINT, SIGTERM and SIGHUP set, however often: terminal and launcher both send SIGINT."""
    stop = threading.Event()

    def ask(number: int, frame: object) -> None:
        let_go_of_terminal(number)
        stop.set()

    with handled(ask):
        yield stop


def run_nodes(threads: Sequence[NodeThread], stop: threading.Event) -> list[str]:
    """Start in order, run until `stop` or the first failure, and return the failures.

    Nodes stop in reverse order, so that commands cease before what executes them.
    """
    for thread in threads:
        thread.start()
    while not stop.wait(WAKE_S) and not any(thread.failure for thread in threads):
        pass
    failures = [thread.failure for thread in threads if thread.failure]
    if failures:
        time.sleep(2 * WAKE_S)  # the failed node's last diagnostics leave
    for thread in reversed(threads):
        try:
            thread.stop()
        except TimeoutError as error:
            failures.append(str(error))
    crashes = [thread.failure for thread in threads if thread.crash is not None]
    return failures + [crash for crash in crashes if crash not in failures]


def run_node(
    make_behaviour: MakeBehaviour, settings_type: type[Any], name: str, arguments: Sequence[str] | None = None
) -> int:
    """Main of an executable with one behaviour; see `run_process`."""
    return run_process([lambda: BehaviourNode(make_behaviour, settings_type, name)], arguments)


def run_process(make_nodes: Sequence[Callable[[], CellNode]], arguments: Sequence[str] | None = None) -> int:
    """Main of an executable: each node with a thread of its own.

    Returns 0 after SIGINT, SIGTERM or SIGHUP, 1 when a node failed, 3 when its parameters were refused.
    """
    threads: list[NodeThread] = []
    with stop_signals() as stop:
        try:
            start_ros(arguments)
            threads += [NodeThread(make_node()) for make_node in make_nodes]
        except SamrlError as error:
            print(f"error: {error}", file=sys.stderr)
            leave_graph([stop_ros])
            return INPUT_REFUSED if isinstance(error, InputError) else FAILED
        failures = run_nodes(threads, stop)
        for failure in failures:
            print(f"error: {failure}", file=sys.stderr)
        leave_graph([stop_ros])
    return FAILED if failures else OK
