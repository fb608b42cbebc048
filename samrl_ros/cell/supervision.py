"""Keeps a run going while that is safe, and says why where it is not."""

from __future__ import annotations

import time
from typing import Any

from samrl_ros.cell.monitor import Monitor


class Supervision:
    """Looks after the nodes of one run; ask `trouble` often."""

    def __init__(self, group: Any, monitor: Monitor, estop_wait_s: float) -> None:
        """`estop_wait_s`: longest wait for the reset of an emergency stop by the wall clock, 0 for ever."""
        self._group, self._monitor, self._estop_wait_s = group, monitor, estop_wait_s

    def trouble(self) -> str:
        """Why the run cannot go on, empty while it can."""
        return self._group.trouble() or self._monitor.trouble() or self._overdue()

    def _overdue(self) -> str:
        watch, limit = self._monitor.watch, self._estop_wait_s
        if watch.estop and limit and time.monotonic() - watch.estop_since > limit:
            return f"emergency stop not reset within {limit:g} s (--estop-wait): {watch.estop}"
        return ""
