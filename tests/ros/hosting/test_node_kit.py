"""The host of behaviours on a live graph: states, parameters, failures, services, processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from tests.waiting import PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.live]
ROOT = Path(__file__).resolve().parents[3]
ECHO = Path(__file__).with_name("echo_node.py")


def _load_echo() -> Any:
    import importlib.util

    spec = importlib.util.spec_from_file_location("echo_node", ECHO)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["echo_node"] = module
    spec.loader.exec_module(module)
    return module


echo = _load_echo()


class Probe:
    """The other side: speaks phases, hears answers and diagnostics."""

    def __init__(self) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor
        from std_msgs.msg import String

        from samrl_ros.contract.qos import PROFILES

        self.node = rclpy.create_node("probe")
        self.answers: list[str] = []
        self.statuses: list[Any] = []
        self._string = String
        self.phase = self.node.create_publisher(String, echo.PHASE, PROFILES["state"])
        self.node.create_subscription(String, echo.WEIGHTS, self._take_answer, PROFILES["latched"])
        self.node.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            self._take_statuses,
            PROFILES["diagnostics"],
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def _take_answer(self, message: Any) -> None:
        self.answers.append(message.data)

    def _take_statuses(self, message: Any) -> None:
        self.statuses.extend(message.status)

    def wait(self, condition: Callable[[], Any], seconds: float = PATIENCE_S) -> bool:
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def say(self, text: str) -> None:
        assert self.wait(lambda: self.phase.get_subscription_count() > 0), "nobody listens"
        self.phase.publish(self._string(data=text))

    def heard(self, part: str, seconds: float = PATIENCE_S) -> bool:
        return self.wait(lambda: any(part in answer for answer in self.answers), seconds)

    def close(self) -> None:
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self._executor.shutdown()


@pytest.fixture
def probe(graph: None) -> Iterator[Probe]:
    probe = Probe()
    yield probe
    probe.close()


@pytest.fixture
def make(graph: None) -> Iterator[Callable[..., Any]]:
    from rclpy.parameter import Parameter

    from samrl_ros.hosting import BehaviourNode, NodeThread

    threads = []

    def make(start: bool = True, **overrides: Any) -> Any:
        values = [Parameter(name, value=value) for name, value in overrides.items()]
        node = BehaviourNode(echo.Echo, echo.EchoSettings, "echo", parameter_overrides=values)
        threads.append(NodeThread(node))
        if start:
            threads[-1].start()
        return threads[-1]

    yield make
    for thread in threads:
        thread.stop()


def test_an_active_node_answers_with_its_settings(make: Any, probe: Probe) -> None:
    make(gain=3.5, weights=[0.25])
    assert probe.heard("started")
    probe.say("hello")
    assert probe.heard("hello gain=3.5 weights=(0.25,)")


def test_a_parameter_is_heard_under_its_former_name(make: Any, probe: Probe) -> None:
    thread = make(strength=3.0)
    assert probe.heard("started")
    probe.say("hello")
    assert probe.heard("hello gain=3.0")
    assert not thread.run(lambda: thread.node.has_parameter("strength"))


def test_an_inactive_node_handles_nothing_and_counts_what_it_ignored(make: Any, probe: Probe) -> None:
    thread = make(autostart=False)
    thread.run(thread.node.trigger_configure)
    probe.say("early")
    counter = thread.node.health.topics[echo.PHASE]
    assert probe.wait(lambda: counter.ignored == 1)
    thread.run(thread.node.trigger_activate)
    assert probe.heard("started")
    probe.say("late")
    assert probe.heard("late")
    assert not any("early" in answer for answer in probe.answers)
    thread.run(thread.node.trigger_deactivate)
    probe.say("too late")
    assert probe.wait(lambda: counter.ignored == 2)


def test_diagnostics_tell_state_rate_and_figures(make: Any, probe: Probe) -> None:
    make()
    probe.say("x")
    assert probe.wait(lambda: any("1" in _values(status).get("handled", "") for status in probe.statuses))
    values = _values(probe.statuses[-1])
    assert probe.statuses[-1].name == "/cell/echo" and probe.statuses[-1].level == b"\x00"
    assert values["state"] == "active" and values[f"{echo.PHASE} received"] == "1"
    assert values[f"{echo.WEIGHTS} published"] == "2"  # started, x
    assert float(values["handler_last_ms"]) > 0


def _values(status: Any) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


def test_a_failing_handler_is_seen_and_the_node_can_be_started_anew(make: Any, probe: Probe) -> None:
    thread = make()
    probe.say("boom")
    # A node is unconfigured before its start as well, so the failure has to be there first.
    assert probe.wait(lambda: thread.failure and thread.node.stage == "unconfigured")
    assert "ValueError: boom was asked for" in thread.failure and echo.PHASE in thread.failure
    assert probe.wait(lambda: any(status.level == b"\x02" for status in probe.statuses))
    error = next(status for status in probe.statuses if status.level == b"\x02")
    assert "boom was asked for" in error.message and _values(error)["errors"] == "1"
    thread.run(thread.node.trigger_configure)
    thread.run(thread.node.trigger_activate)
    assert thread.failure == "" and thread.node.stage == "active"
    probe.say("again")
    assert probe.heard("again")


def test_the_lifecycle_services_drive_the_node(make: Any, probe: Probe) -> None:
    """As `ros2 lifecycle set /cell/echo ...` does, twice through all states."""
    from lifecycle_msgs.srv import ChangeState

    thread = make()
    assert probe.heard("started")
    client = probe.node.create_client(ChangeState, "/cell/echo/change_state")
    assert probe.wait(client.service_is_ready)
    expected = {4: "inactive", 2: "unconfigured", 1: "inactive", 3: "active"}  # lifecycle_msgs/Transition
    for transition, stage in list(expected.items()) * 2:
        request = ChangeState.Request()
        request.transition.id = transition
        answer = client.call_async(request)
        assert probe.wait(answer.done)
        result = answer.result()
        assert result is not None and result.success and thread.node.stage == stage
    probe.say("still here")
    assert probe.heard("still here")


def test_a_long_queue_keeps_what_comes_while_the_node_computes(make: Any, probe: Probe) -> None:
    """The topic's QoS keeps 10."""
    thread = make()
    probe.say("hang")
    for number in range(30):
        probe.say(str(number))
    counter = thread.node.health.topics[echo.PHASE]
    assert probe.wait(lambda: counter.received == 31)


def test_speaking_on_a_topic_that_is_no_output_is_a_failure(make: Any, probe: Probe) -> None:
    thread = make()
    probe.say("stray")
    assert probe.wait(lambda: "not among its outputs" in thread.failure)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"gain": 11.0}, "gain"),
        ({"gain": float("nan")}, "nan"),
        ({"gain": 5}, "float"),
        ({"count": 9}, "count"),
        ({"strength": 11.0}, "gain"),
        ({"strength": 5}, "strength is a int"),
        ({"mode": "silent"}, "none of plain, loud"),
        ({"weights": [0.5, 1.5]}, r"1.5 is outside 0.0 .. 1.0"),
    ],
)
def test_bad_parameters_are_refused_with_the_reason(make: Any, overrides: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(start=False, **overrides)


def test_parameters_change_only_while_unconfigured_and_within_range(make: Any) -> None:
    from rclpy.parameter import Parameter

    thread = make(autostart=False)
    node = thread.node

    def change(name: str, value: Any) -> Any:
        return thread.run(lambda: node.set_parameters([Parameter(name, value=value)])[0])

    assert not change("gain", 12.0).successful
    assert not change("gain", float("inf")).successful
    refused = change("mode", "silent")
    assert not refused.successful and "none of plain, loud" in refused.reason
    assert change("gain", 4.0).successful
    thread.run(node.trigger_configure)
    refused = change("gain", 5.0)
    assert not refused.successful and "clean it up first" in refused.reason
    described = node.describe_parameter("gain")
    assert described.floating_point_range[0].to_value == 10.0 and "[1/s]" in described.description


def test_a_service_is_called_when_its_server_comes_up(make: Any, probe: Probe) -> None:
    from std_srvs.srv import Trigger

    make()
    probe.say("estop")
    assert probe.heard("estop gain")  # the handler did not wait

    def answer(_: Any, response: Any) -> Any:
        response.success, response.message = True, "done"
        return response

    probe.node.create_service(Trigger, echo.ESTOP, answer)
    assert probe.heard("estop done")


def test_a_missing_server_becomes_a_failure(make: Any, probe: Probe, monkeypatch: Any) -> None:
    from samrl_ros.hosting import behaviour_node

    monkeypatch.setattr(behaviour_node, "SERVICE_WAIT_S", 0.3)
    thread = make()
    probe.say("estop")
    assert probe.wait(lambda: "/cell/estop is not there" in thread.failure)


def test_a_hanging_callback_does_not_hang_the_owner(make: Any, probe: Probe, monkeypatch: Any) -> None:
    from samrl_ros.hosting import host

    monkeypatch.setattr(host, "JOIN_S", 0.3)
    thread = make()
    probe.say("hang")
    probe.wait(lambda: False, 0.3)
    with pytest.raises(TimeoutError, match="callbacks hangs"):
        thread.stop()
    monkeypatch.undo()


def test_qos_names_all_exist() -> None:
    from samrl_ros.contract.qos import qos_named
    from samrl_ros.contract.topics import TOPICS

    for topic in TOPICS.values():
        qos_named(topic.qos)
    with pytest.raises(InputError, match="unknown QoS"):
        qos_named("fast")


# --- in a process of its own ---


@pytest.fixture
def spawn() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    processes = []

    def spawn(*arguments: str, script: Path = ECHO) -> Any:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        processes.append(
            subprocess.Popen(
                [sys.executable, str(script), *arguments],
                env=environment,
                stderr=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        )
        return processes[-1]

    yield spawn
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_process_stops_cleanly_on_two_signals(spawn: Any, probe: Probe, number: int) -> None:
    process = spawn()
    assert probe.heard("started")
    process.send_signal(number)
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors


def test_a_failed_process_ends_with_one_and_says_why(spawn: Any, probe: Probe) -> None:
    process = spawn()
    assert probe.heard("started")
    probe.say("boom")
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1 and "error: echo: handling /cell/phase: ValueError: boom" in errors
    assert "echo_node.py" in errors  # the trace is in the log


def test_a_process_reads_its_parameter_file(spawn: Any, probe: Probe, tmp_path: Path) -> None:
    file = tmp_path / "echo.yaml"
    file.write_text("/cell/echo:\n  ros__parameters:\n    gain: 7.5\n")
    spawn("--ros-args", "--params-file", str(file))
    assert probe.heard("started")
    probe.say("hello")
    assert probe.heard("gain=7.5")


def test_a_process_refuses_bad_parameters_with_three(spawn: Any) -> None:
    process = spawn("--ros-args", "-p", "gain:=99.0")
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 3 and "gain" in errors and "Traceback" not in errors


def test_own_messages_travel_between_processes(spawn: Any, probe: Probe, tmp_path: Path) -> None:
    from samrl_msgs.msg import ModelState

    from samrl_ros.contract.qos import PROFILES

    script = tmp_path / "sender.py"
    script.write_text(
        "import rclpy, time\n"
        "from samrl_msgs.msg import ModelState\n"
        "from samrl_ros.contract.qos import PROFILES\n"
        "rclpy.init()\n"
        "node = rclpy.create_node('sender')\n"
        "publisher = node.create_publisher(ModelState, '/cell/model_updater/state', PROFILES['latched'])\n"
        "publisher.publish(ModelState(step=7, names=['x', 'y'], values=[0.1, -0.2]))\n"
        "time.sleep(10)\n"
    )
    got: list[Any] = []
    probe.node.create_subscription(ModelState, "/cell/model_updater/state", got.append, PROFILES["latched"])
    spawn(script=script)
    assert probe.wait(lambda: got)
    assert got[0].step == 7 and got[0].names == ["x", "y"] and list(got[0].values) == [0.1, -0.2]
