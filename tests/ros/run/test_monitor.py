"""The cell's monitor over a long run."""

from __future__ import annotations

import tracemalloc

import pytest

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


def test_diagnostics_of_hours_take_no_memory() -> None:
    """Each node's newest count; benchmarks that want all of them listen."""
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

    from samrl_ros.cell.monitor import Monitor
    from samrl_ros.hosting.host import start_ros, stop_ros

    def diagnostics(second: int) -> DiagnosticArray:
        values = [KeyValue(key=f"figure {k} at {second}"[:9], value=str(second + k)) for k in range(30)]
        return DiagnosticArray(status=[DiagnosticStatus(name="/cell/policy", level=b"\x00", values=values)])

    heard: list[str] = []
    start_ros([])
    try:
        monitor = Monitor(on_figures=lambda node, figures: heard.append(figures["figure 7 "]))
        monitor._on_diagnostics(diagnostics(0))
        tracemalloc.start()
        for second in range(1, 1000):
            monitor._on_diagnostics(diagnostics(second))
        grown, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert monitor.watch.nodes["/cell/policy"].values["figure 7 "] == "1006"
        assert heard == [str(second + 7) for second in range(1000)]
        monitor.close()
    finally:
        stop_ros()
    assert grown < 300_000  # [bytes]; kept whole they were 5,000,000


def test_phases_of_hours_take_little_memory() -> None:
    """An action has about ten marks; a run of two hours has 50,000."""
    from std_msgs.msg import String

    from samrl_ros.cell.monitor import Monitor
    from samrl_ros.hosting.host import start_ros, stop_ros

    names = ("capture", "update", "plan", "move", "act")
    start_ros([])
    try:
        monitor = Monitor()
        tracemalloc.start()
        for episode in range(10):
            monitor._on_phase(String(data=f"episode {episode}"))
            for mark in range(500):
                # A message's text is a new one each time.
                monitor._on_phase(String(data="".join(names[mark % 5])))
        grown, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        kept = {episode: list(marks) for episode, marks in monitor.watch.marks.items()}
        monitor.close()
    finally:
        stop_ros()
    assert {episode: len(marks) for episode, marks in kept.items()} == dict.fromkeys(range(10), 501)
    assert [name for _, name in kept[3][:4]] == ["episode 3", "capture", "update", "plan"]
    times = [time for time, _ in kept[3]]
    assert times == sorted(times)
    assert grown < 200_000  # [bytes]; kept as pairs they were 700,000
