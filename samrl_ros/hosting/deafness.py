"""A node that nothing reaches, although others speak to it.

Fast DDS 2.14 makes such nodes: the process that takes a killed one's place, and its port in shared memory,
can announce itself and publish, and yet no message comes in (github.com/eProsima/Fast-DDS, issues 5053 and
5469). Nodes keep off such ports (`shared_memory.pass_over_dead_ports`); what is deaf all the same says so,
and only a new process mends it.
"""

from __future__ import annotations

from samrl_core.cell.robots.robot import ROLES
from samrl_ros.contract.topics import arm_topic

SOUNDING = tuple(arm_topic(role, "joint_states") for role in ROLES)  # at all times, once somebody publishes
PATIENCE_REPORTS = 60  # of a node, 1 Hz of its own running time: a busy computer connects late


class Deafness:
    """Counts a node's reports in which it had not heard anything since it was activated."""

    def __init__(self) -> None:
        self._in_vain = 0

    def look(self, received: int, publishers: int) -> str:
        """Once a report: why the node is deaf, empty while it may hear.

        Args:
            received: messages on all its inputs so far.
            publishers: of `SOUNDING`, as the graph tells.
        """
        self._in_vain = self._in_vain + 1 if publishers and not received else 0
        if self._in_vain < PATIENCE_REPORTS:
            return ""
        return (
            f"not one message in {self._in_vain} s although {publishers} publish joint states: the middleware"
            " does not reach this process; end it and start it anew"
        )
