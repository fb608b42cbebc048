"""What a run with `--observe` tells at its end: it has no episodes, only what the drivers said."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from samrl_core.cell.robots.robot import ROLES
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import arm_topic, cell_topic


def tell_what_was_heard(bag: Path, console: Console) -> bool:
    """Print what of the drivers a bag holds, and the command that goes on; False where it holds nothing.

    Raises:
        InputError: the bag cannot be read.
    """
    counts = {topic.name: topic.count for topic in open_bag(bag).topics}
    joints = {f"joint states of {role}": counts.get(arm_topic(role, "joint_states"), 0) for role in ROLES}
    heard = joints | {"colour images": counts.get(cell_topic("camera/color/image_raw"), 0)}
    if not any(heard.values()):
        console.print(
            f"[bold red]nothing was heard:[/] {escape(str(bag))} has no message of a driver; check with"
            " `samrl preflight` that they run",
            highlight=False,
            soft_wrap=True,
        )
        return False
    lines = [f"{', '.join(f'{count} {what}' for what, count in heard.items() if count)} in {bag}"]
    if any(joints.values()):
        lines.append(f"next:    samrl diagnose {bag}")
    console.print(escape("\n".join(lines)), highlight=False, soft_wrap=True)
    return True
