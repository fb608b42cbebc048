"""What a run does about nodes that die, stand or fall silent; processes and graph are stand-ins here."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from tests.waiting import wait_for

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


class Group:
    """Processes that end when a test says so."""

    def __init__(self, pid: int = 0) -> None:
        self.pid = pid
        self.alive: dict[tuple[str, ...], bool] = dict.fromkeys(
            [("policy",), ("model_updater",), ("recorder",), ("sim_bridge",)], True
        )
        self.restarted: list[tuple[str, ...]] = []

    def homes(self) -> list[Any]:
        from samrl_ros.cell.node_group import Home

        return [Home(nodes, self.pid) for nodes in self.alive]

    def ended(self) -> dict[tuple[str, ...], str]:
        ends = [nodes for nodes, alive in self.alive.items() if not alive]
        return {nodes: f"{nodes[0]} killed by SIGKILL; its log: x.log" for nodes in ends}

    def restarts_alone(self, nodes: tuple[str, ...]) -> bool:
        return True

    def restart(self, nodes: tuple[str, ...]) -> None:
        self.restarted.append(nodes)
        self.alive[nodes] = True

    def kill(self, nodes: tuple[str, ...]) -> None:
        self.alive[nodes] = False


class Ears:
    """What a monitor would tell of the graph."""

    def __init__(self) -> None:
        self.watch = SimpleNamespace(outcomes={}, estop="", estop_since=0.0, last_joints=0.0, reports=0)
        self.active = {"policy", "model_updater", "recorder", "sim_bridge"}
        self.told: list[tuple[str, int]] = []
        self.notes: list[str] = []
        self.publishers = True

    def is_active(self, node: str) -> bool:
        return node in self.active

    def trouble(self, excused: frozenset[str] = frozenset()) -> str:
        return ""

    def publish_watch(self, node: str, level: int, text: str) -> None:
        self.told.append((node, level))

    def forget(self, node: str) -> None:
        self.active.discard(node)

    def note(self, what: str, text: str) -> None:
        self.notes.append(what)

    def excuse_progress(self) -> None:
        pass

    def has_joint_publisher(self) -> bool:
        return self.publishers


class Clock:
    """Wall time of a test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from samrl_ros.cell import supervision

        self.now = 1000.0
        monkeypatch.setattr(supervision, "time", SimpleNamespace(monotonic=lambda: self.now))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


@pytest.fixture
def pulse(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What every process is seen to do."""
    from samrl_ros.cell import supervision
    from samrl_ros.cell.pulse import Pulse

    seen = {"states": "S", "cpu_s": 1.0}
    monkeypatch.setattr(
        supervision, "pulse_of", lambda pid, threads: Pulse(frozenset(seen["states"]), seen["cpu_s"])
    )
    return seen


def supervision_of(group: Group, ears: Ears, **options: Any) -> Any:
    from samrl_ros.cell.supervision import Supervision

    settings = {"estop_wait_s": 0.0, "restarts": 2, **options}
    return Supervision(group, ears, settings["estop_wait_s"], settings["restarts"])


def step(clock: Clock, care: Any, seconds: float) -> str:
    """Time goes by in looks of a second."""
    found = ""
    for _ in range(round(seconds)):
        clock.now += 1.0
        found = care.trouble()
        if found:
            return found
    return found


def test_a_node_is_restarted_and_told_as_away_until_it_is_back(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    assert step(clock, care, 3) == ""
    group.kill(("policy",))
    assert step(clock, care, 30) == ""
    assert group.restarted == [("policy",)] and ears.told == [("policy", 2)]
    ears.active.add("policy")
    assert step(clock, care, 2) == ""
    assert ears.told == [("policy", 2), ("policy", 0)] and ears.notes == ["restart", "back"]


def test_what_its_former_process_said_does_not_bring_a_node_back(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    step(clock, care, 3)
    group.kill(("policy",))
    care.trouble()
    ears.active.add("policy")  # from its last breath
    clock.now += 0.1
    assert care.trouble() == "" and ears.told == [("policy", 2)] and "policy" not in ears.active


def test_restarts_have_a_bound(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    step(clock, care, 3)
    for _ in range(2):
        group.kill(("model_updater",))
        assert step(clock, care, 5) == ""
        ears.active.add("model_updater")
        assert step(clock, care, 5) == ""
    group.kill(("model_updater",))
    found = step(clock, care, 5)
    assert "killed by SIGKILL" in found and "restarted 2 times" in found


@pytest.mark.parametrize("node", ["sim_bridge", "recorder"])
def test_nodes_that_must_not_be_restarted_end_the_run(clock: Clock, pulse: Any, node: str) -> None:
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    step(clock, care, 3)
    group.kill((node,))
    assert f"{node} killed by SIGKILL" in step(clock, care, 1) and not group.restarted
    assert ears.told == [(node, 2)]


def test_a_node_that_never_was_active_is_not_restarted(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    ears.active.clear()
    care = supervision_of(group, ears)
    step(clock, care, 3)
    group.kill(("policy",))
    assert "killed by SIGKILL" in step(clock, care, 1)


def test_a_node_that_does_not_answer_is_killed_and_started_anew(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    step(clock, care, 3)
    ears.watch.outcomes[0] = SimpleNamespace(reason="error: no answer to 'act' within 30 s")
    assert step(clock, care, 3) == ""
    assert group.restarted == [("policy",)] and ears.notes[:2] == ["killed", "restart"]


def silent(clock: Clock, care: Any, ears: Ears, seconds: float) -> str:
    """Joint states are heard once, and then no more."""
    ears.watch.last_joints = clock.now
    care.trouble()
    return step(clock, care, seconds)


def test_a_bridge_that_computes_slowly_is_waited_for(clock: Clock, pulse: Any) -> None:
    """A busy machine gives it a tenth of a processor: 10 minutes without joint states are no fault."""
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    ears.watch.last_joints = clock.now
    for _ in range(600):
        clock.now, pulse["cpu_s"] = clock.now + 1.0, pulse["cpu_s"] + 0.1
        assert care.trouble() == ""
    assert ears.notes == ["silence"]
    ears.watch.last_joints = clock.now
    assert care.trouble() == "" and ears.notes == ["silence", "joints"]


def test_a_bridge_that_waits_for_its_turn_is_waited_for(clock: Clock, pulse: Any) -> None:
    care, ears = supervision_of(Group(), ears := Ears()), ears
    pulse["states"] = "R"
    assert silent(clock, care, ears, 600) == ""


def test_a_bridge_that_sleeps_for_good_is_told(clock: Clock, pulse: Any) -> None:
    care, ears = supervision_of(Group(), ears := Ears()), ears
    assert silent(clock, care, ears, 25) == ""
    assert "sim_bridge hangs" in silent(clock, care, ears, 40)


def test_a_bridge_that_computes_without_end_is_told(clock: Clock, pulse: Any) -> None:
    care, ears = supervision_of(Group(), ears := Ears()), ears
    ears.watch.last_joints = clock.now
    for _ in range(300):
        clock.now, pulse["cpu_s"] = clock.now + 1.0, pulse["cpu_s"] + 1.0
        found = care.trouble()
        if found:
            break
    assert "in 120 s of processor time" in found


def test_a_driver_of_somebody_else_is_judged_by_the_graph(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    del group.alive["sim_bridge",]
    care = supervision_of(group, ears)
    assert "driver is silent" in silent(clock, care, ears, 12)
    ears.publishers = False
    assert "driver is gone" in silent(clock, care, ears, 12)


def test_a_held_bridge_that_left_the_graph_is_waited_for(clock: Clock, pulse: Any) -> None:
    """The middleware's lease is shorter than the patience with SIGSTOP."""
    care, ears = supervision_of(Group(), ears := Ears()), ears
    pulse["states"], ears.publishers = "T", False
    assert silent(clock, care, ears, 40) == ""


def test_a_node_held_by_a_signal_is_told_at_once_and_not_for_ever(clock: Clock, pulse: Any) -> None:
    group, ears = Group(), Ears()
    care = supervision_of(group, ears)
    step(clock, care, 3)
    pulse["states"] = "T"
    assert step(clock, care, 2) == "" and ("sim_bridge", 1) in ears.told
    pulse["states"] = "S"
    assert step(clock, care, 2) == ""
    ears.active |= {"policy", "model_updater", "recorder", "sim_bridge"}
    assert step(clock, care, 2) == "" and ("sim_bridge", 0) in ears.told
    pulse["states"] = "T"
    assert "SIGCONT" in step(clock, care, 80)


def test_an_emergency_stop_has_a_bound_where_one_is_set(clock: Clock, pulse: Any) -> None:
    care, ears = supervision_of(Group(), ears := Ears(), estop_wait_s=20.0), ears
    ears.watch.estop, ears.watch.estop_since = "asked for", clock.now
    assert step(clock, care, 15) == ""
    assert "--estop-wait" in step(clock, care, 10)


@pytest.fixture
def child() -> Iterator[subprocess.Popen[bytes]]:
    code = "import sys\nsys.stdin.read(1)\nwhile True: pass"
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE)
    yield process
    process.kill()
    process.wait()


def test_a_pulse_tells_what_a_process_does(child: subprocess.Popen[bytes]) -> None:
    from samrl_ros.cell.pulse import pulse_of

    wait_for(lambda: pulse_of(child.pid).states == {"S"}, "the child to sleep")
    assert not pulse_of(child.pid).busy and not pulse_of(child.pid).stopped
    assert child.stdin is not None
    child.stdin.write(b"x")
    child.stdin.flush()
    wait_for(lambda: pulse_of(child.pid).busy, "the child to compute")
    before = pulse_of(child.pid).cpu_s
    wait_for(lambda: pulse_of(child.pid).cpu_s > before, "processor time")
    child.send_signal(signal.SIGSTOP)
    wait_for(lambda: pulse_of(child.pid).stopped, "the child to be held")
    child.kill()
    child.wait()
    assert not pulse_of(child.pid).states
