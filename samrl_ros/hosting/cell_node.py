"""A lifecycle node with declared parameters, 1 Hz diagnostics, and failures that become visible."""

from __future__ import annotations

import dataclasses
import time
import traceback
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from samrl_core.common.errors import InputError, SamrlError
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import NAMESPACE, TOPICS
from samrl_ros.hosting import parameters
from samrl_ros.hosting.diagnostics import Health

UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = "unconfigured", "inactive", "active", "finalized"
REPORT_PERIOD_S = 1.0  # REP-107: diagnostics at about 1 Hz


class CellNode(LifecycleNode):
    """Base of every node of the cell. Subclasses fill in the five hooks and nothing else.

    All callbacks run in the one thread that spins the node. Parameters are read when the node is configured,
    and refused while it is inactive or active, so that what `ros2 param get` shows is what is in force.
    An exception in a hook or callback ends the node's work: it is logged (with its trace unless it is
    one of ours), shown on /diagnostics as ERROR, and the node falls back to unconfigured; `configure` starts
    it anew.

    Raises:
        InputError: a parameter from a file or the command line does not fit.
    """

    def __init__(self, name: str, settings_type: type[Any], **node_options: Any) -> None:
        super().__init__(name, namespace=NAMESPACE, **node_options)
        self.health = Health()
        self.stage = UNCONFIGURED
        self._settings_type = settings_type
        self._failure: str = ""  # waits for `settle`
        self.declare_parameter(
            "autostart", True, ParameterDescriptor(description="configure and activate when the node starts")
        )
        try:
            parameters.declare(self, settings_type)
        except InputError:
            self.destroy_node()
            raise
        self.add_on_set_parameters_callback(self._check_parameters)
        self._diagnostics = self.create_publisher(
            message_class(TOPICS["/diagnostics"].type),
            "/diagnostics",
            qos_named(TOPICS["/diagnostics"].qos),
        )
        # Steady time: a node that waits for /clock, or whose simulation stands still, still reports.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._report_timer = self.create_timer(REPORT_PERIOD_S, self.report, clock=steady)

    # --- hooks ---

    @abstractmethod
    def set_up(self, settings: Any) -> None:
        """Create what the node needs: publishers, subscriptions, its logic."""

    @abstractmethod
    def begin(self) -> None:
        """Start working."""

    @abstractmethod
    def halt(self) -> None:
        """Stop working and leave the robot at rest; also called after a failure."""

    @abstractmethod
    def tear_down(self) -> None:
        """Destroy what `set_up` created, as far as it came."""

    @abstractmethod
    def figures(self) -> dict[str, str]:
        """Key figures for /diagnostics; called in every state."""

    # --- failures ---

    @property
    def failure(self) -> str:
        """Why the node stopped working, empty while it has not. Cleared by the next `configure`."""
        return self.health.error

    def guard(self, what: str, function: Callable[..., Any], *arguments: Any) -> bool:
        """Call a function of the node's logic; True when it returned, False after an exception."""
        start = time.perf_counter()
        try:
            function(*arguments)
        except Exception as error:  # noqa: BLE001 (the border: whatever it is, it must be seen and must stop the node)
            # A refusal says what is wrong and how to mend it; only the unforeseen needs its trace.
            self.fail(_describe(what, error), "" if isinstance(error, SamrlError) else traceback.format_exc())
            return False
        finally:
            self.health.count_handler(time.perf_counter() - start)
        return True

    def fail(self, text: str, trace: str = "") -> None:
        """Record a failure. Its effect, halting and falling back, comes with the host's next `settle`."""
        self.health.errors += 1
        self.get_logger().error(f"{text}\n{trace}" if trace else text)
        if not self.health.error:
            self.health.error = self._failure = text

    def log(self, level: str, text: str) -> None:
        """Log a line, as an `Outbox` does.

        Raises:
            InputError: a level that is none of debug, info, warn, error.
        """
        logger = self.get_logger()
        # One call site per level: rclpy refuses a call site whose severity changes.
        if level == "debug":
            logger.debug(text)
        elif level == "info":
            logger.info(text)
        elif level == "warn":
            logger.warning(text)
        elif level == "error":
            logger.error(text)
        else:
            raise InputError(f"log level {level!r} is none of debug, info, warn, error")

    def settle(self) -> None:
        """Called by the host between callbacks: a failed node must not destroy what is just calling it."""
        if not self._failure:
            return
        if self.stage == ACTIVE:
            self.trigger_deactivate()  # answers ERROR, which leads to on_error
        elif self.stage == INACTIVE:
            self.trigger_cleanup()
        self._failure = ""
        self.report()

    # --- lifecycle ---

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create the node's parts from its parameters."""
        self.health.error = self._failure = ""
        self.health.topics.clear()
        self.health.published.clear()
        ok = self.guard("configure", lambda: self.set_up(parameters.read(self, self._settings_type)))
        if ok and not self._failure:
            self.stage = INACTIVE
            return TransitionCallbackReturn.SUCCESS
        self.guard("clean up", self.tear_down)
        self._failure = ""
        return TransitionCallbackReturn.FAILURE  # stays unconfigured

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start working."""
        self.stage = ACTIVE  # what `begin` publishes is sent
        if self.guard("activate", self.begin) and not self._failure:
            return super().on_activate(state)
        return TransitionCallbackReturn.ERROR

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop working; with a failure pending, go through error processing."""
        if self._failure:
            return TransitionCallbackReturn.ERROR
        if not self.guard("deactivate", self.halt):
            return TransitionCallbackReturn.ERROR
        self.stage = INACTIVE
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the node's parts."""
        self.stage = UNCONFIGURED
        self.guard("clean up", self.tear_down)
        self._failure = ""
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop, destroy, end."""
        self._release()
        self.stage = FINALIZED
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Halt and fall back to unconfigured, from where `configure` starts anew."""
        self._release()
        self._failure = ""
        self.stage = UNCONFIGURED
        return TransitionCallbackReturn.SUCCESS

    def _release(self) -> None:
        if self.stage == ACTIVE:
            self.guard("halt", self.halt)
        if self.stage in (ACTIVE, INACTIVE):
            self.guard("clean up", self.tear_down)

    # --- reports ---

    def report(self) -> None:
        """Publish the node's diagnostics now."""
        try:
            figures = self.figures()
        except SamrlError as error:
            figures = {"figures": f"not available: {error}"}
        message = self.health.report(self.get_fully_qualified_name(), self.stage, figures)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _check_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        fields = {field.name: field for field in dataclasses.fields(self._settings_type)}
        for change in changes:
            if change.name not in fields:
                continue
            if self.stage != UNCONFIGURED:
                reason = f"{change.name} is read at configure; the node is {self.stage}: clean it up first"
                return SetParametersResult(successful=False, reason=reason)
            reason = parameters.why_refused(fields[change.name], change.value)
            if reason:
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)


def _describe(what: str, error: Exception) -> str:
    kind = "" if isinstance(error, SamrlError) else f"{type(error).__name__}: "
    return f"{what}: {kind}{error}"
