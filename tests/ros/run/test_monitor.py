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
