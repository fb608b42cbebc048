"""`samrl diagnose --watch`: the live graph, window after window."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from samrl_ros.contract.exit_codes import GAP_FOUND, INTERRUPTED, OK
from samrl_ros.hosting.ros_check import require_ros

QUIET_S = 15.0  # without any topic, after which it is told


def watch_graph(
    out: Path, options: Sequence[str], window_s: float, windows: int, keep: int, fail_on_gap: bool
) -> int:
    """Diagnose a graph in windows until it is interrupted, or for a number of windows.

    Args:
        out: gets windows/NNNN (bags), reports/NNNN and watch.jsonl.
        options: further arguments of `samrl diagnose`.
        window_s: length of each window [s] of the graph's clock.
        windows: after as many answers it ends; 0 for never.
        keep: newest bags without a gap that stay.
        fail_on_gap: return 4 where any window showed a gap.

    Raises:
        InputError: a window's length, or a folder with an earlier watch.
    """
    require_ros()
    from samrl_ros.hosting.host import on_graph, stop_signals
    from samrl_ros.watch.gap_watch import GapWatch, WatchSettings, lines_of
    from samrl_ros.watch.judgement import Judgement
    from samrl_ros.watch.watch_node import WatchNode

    screen = Console()
    gaps: list[int] = []

    def heard(found: Judgement) -> None:
        if found.is_gap:
            gaps.append(found.window)
        for line in lines_of(found):
            screen.print(escape(line), highlight=False, soft_wrap=True)

    def note(text: str) -> None:
        screen.print(escape(text), highlight=False, soft_wrap=True)

    watch = GapWatch(WatchSettings(out, window_s, keep, tuple(options)), heard)
    # An exception in a callback would be told as a fault of it: Ctrl-C is noted, and ends the loop.
    with stop_signals() as stop, on_graph([]) as closers:
        node = WatchNode(watch, note)
        closers += [node.close, watch.close]
        began, told = time.monotonic(), False
        while not stop.is_set() and not (windows and watch.answered >= windows):
            node.spin()
            if not told and not node.topics and time.monotonic() - began > QUIET_S:
                told = True
                note(
                    f"no joint states for {QUIET_S:.0f} s; is the robot's graph in this ROS_DOMAIN_ID, and on"
                    " this computer (else set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET)?"
                )
        if stop.is_set():
            judged = f"{watch.judged} windows were diagnosed, {watch.refused} not judged"
            note(f"interrupted; {judged}, {watch.skipped} skipped, see {out}")
            return INTERRUPTED
        node.report()
    return GAP_FOUND if fail_on_gap and gaps else OK
