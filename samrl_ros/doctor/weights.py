"""The trained networks that come with the package."""

from __future__ import annotations

from samrl_core.common.errors import SamrlError
from samrl_ros.doctor.check import Check, ok, problem


def check_weights() -> Check:
    """Actor and Q of every task open, for the default cell."""
    from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
    from samrl_core.cell.tasks import TASKS
    from samrl_core.policy.agent.settings import trained_networks

    for task in TASKS:
        try:
            trained_networks(task, cell_named(DEFAULT_CELL))
        except SamrlError as error:
            return problem(
                "weights", f"{task}: {error}", "install samrl again; or --policy optimised --strategy best"
            )
    return ok("weights", f"networks of {', '.join(TASKS)} open")
