"""The whole cell: `samrl cell`, `ros2 run samrl_ros cell`. Starts the nodes, watches them, sums up."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from samrl_core.cell.calibration.cell_correction import correction_of
from samrl_core.cell.instance.cell_instance import NOMINAL, InstanceName
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError, SamrlError
from samrl_core.policy.agent.policies import TOUCH
from samrl_ros.cell.driver_check import check_drivers
from samrl_ros.cell.observed import tell_what_was_heard
from samrl_ros.cell.options import CellOptions, prepare
from samrl_ros.cell.reserve import Reserve
from samrl_ros.cell.start_up import CompilationTeller
from samrl_ros.contract.exit_codes import FAILED, INTERRUPTED, OK
from samrl_ros.contract.outcomes import given_up_episodes
from samrl_ros.hosting.ros_check import require_ros

__all__ = ["CellOptions", "run_cell"]

VISITED = "visited.npz"  # of a run's folder: states that Real2Sim found, to learn from
SETTLING_S = 0.5  # wall time in which the last messages reach the recorder
BRAKING_S = 2.0  # wall time in which the bridge brakes arms whose commands ceased, and the recorder sees it
DISCOVERY_S = 1.0  # wall time in which whoever is in the ROS domain already is heard of


def run_cell(
    options: CellOptions,
    console: Console | None = None,
    on_tick: Callable[[dict[str, int]], None] = lambda pids: None,
    keep: dict[str, Any] | None = None,
    on_figures: Callable[[str, dict[str, str]], None] = lambda node, figures: None,
) -> int:
    """Run the cell as asked and return the exit code.

    Args:
        options: what to run.
        console: where to talk to people.
        on_tick: called about twenty times a second with the process ids of the nodes, for benchmarks.
        keep: gets `watch`, all that the monitor saw, for benchmarks.
        on_figures: hears every node's diagnostics, as `Monitor` does, for benchmarks.

    Raises:
        InputError: the options cannot be met; nothing was started.
    """
    screen = console or Console()
    require_ros()
    from samrl_ros.hosting.host import check_ros_arguments, on_graph, stop_signals

    check_ros_arguments(options.node_args)
    _refuse_taken_domain()
    if options.hardware and not check_drivers(options, screen):
        return FAILED
    params = prepare(options)
    arguments = ["--ros-args", "--params-file", str(params), *options.node_args]
    _clean_shared_memory(screen)
    reserve = Reserve(options.out)
    with stop_signals() as stop, on_graph([sys.argv[0], *arguments]) as closers:
        watch, trouble, late = _watch_run(options, arguments, stop, screen, on_tick, on_figures, closers)
        if keep is not None:
            keep["watch"] = watch
        given_up = given_up_episodes(watch.outcomes)
        # Whoever interrupts gets 130, also when a node then needs too long.
        interrupted = stop.is_set() and not trouble
        code = INTERRUPTED if interrupted else FAILED if trouble or late or given_up else OK
        trouble = "; ".join(filter(None, ["interrupted" if interrupted else trouble, late]))
        if trouble and code == FAILED:
            text = f"[bold red]the cell stopped:[/] {escape(trouble)}"
            screen.print(text, highlight=False, soft_wrap=True)
        elif code == INTERRUPTED:
            screen.print(f"{escape(trouble)}; the bag is closed", highlight=False, soft_wrap=True)
        for episode, reason in given_up.items():
            text = f"[bold red]episode {episode} was given up:[/] {escape(reason)}"
            screen.print(text, highlight=False, soft_wrap=True)
        # Within the signal handlers still: an impatient second Ctrl-C must not cost the summary.
        reserve.give_up()
        told = _sum_up(options, watch, trouble, screen)
        _write_page(options, screen)
    return code or (OK if told else FAILED)


def _clean_shared_memory(console: Console) -> None:
    """What killed processes left is removed before it fills the memory."""
    from samrl_ros.hosting.shared_memory import remove_leftovers

    size = sum(one.size for one in remove_leftovers()) / 2**20
    if size >= 1.0:
        console.print(f"removed {size:.0f} MiB of shared memory that killed processes left", highlight=False)


def _refuse_taken_domain() -> None:
    """Two cells in one ROS domain would command each other's arms; the guard stops both in mid-motion.

    Raises:
        InputError: somebody publishes joint states of the tool arm already.
    """
    from samrl_ros.cell.monitor import Monitor
    from samrl_ros.hosting.host import on_graph

    with on_graph([sys.argv[0]]) as closers:
        monitor = Monitor()
        closers.append(monitor.close)
        deadline = time.monotonic() + DISCOVERY_S
        while time.monotonic() < deadline and not monitor.is_taken():
            monitor.spin()
        taken = monitor.is_taken()
    if taken:
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        raise InputError(
            f"another cell or driver publishes joint states in ROS domain {domain}; stop it, or set "
            f"ROS_DOMAIN_ID to a number of its own (0 to 101) for this cell"
        )


def _watch_run(
    options: CellOptions,
    arguments: list[str],
    stop: Any,
    console: Console,
    on_tick: Callable[[dict[str, int]], None],
    on_figures: Callable[[str, dict[str, str]], None],
    closers: list[Callable[[], object]],
) -> tuple[Any, str, str]:
    """Start everything, wait for the end, stop all nodes; what is left to close is added to `closers`.

    Returns:
        What was seen, what went wrong before the end or an interrupt, and what did not stop afterwards.
    """
    from samrl_ros.cell.monitor import Monitor
    from samrl_ros.cell.node_group import MixedGroup, ProcessGroup, ThreadGroup
    from samrl_ros.cell.supervision import Supervision

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("starting nodes", total=options.episodes)
        monitor = Monitor(
            lambda text: progress.console.print(escape(text), highlight=False, soft_wrap=True), on_figures
        )
        closers.append(monitor.close)
        view = _start_view(options)
        desk = _open_desk(options, monitor)
        closers += [one.close for one in (desk, view) if one is not None]
        logs = options.out / "logs"
        group = {
            "split": lambda: MixedGroup(arguments, logs),
            "processes": lambda: ProcessGroup(arguments, logs),
            "threads": ThreadGroup,
        }[options.layout]()
        trouble = ""
        compilations = CompilationTeller(logs)
        try:
            care = Supervision(group, monitor, options.estop_wait, options.restarts)
            trouble = _bring_up(options.nodes, group, monitor, care, stop, compilations)
            if options.observe and not trouble:
                monitor.tell(f"recording what the drivers say into {options.out / 'bag'}; Ctrl-C ends it")
            while not trouble and not stop.is_set() and not _is_done(options, monitor, desk):
                monitor.spin()
                compilations.report()
                if desk is not None:
                    desk.spin()
                    if desk.waits:  # a person takes the time that it takes
                        monitor.excuse_progress()
                on_tick(group.pids())
                trouble = _trouble(care.trouble, stop)
                description = f"episode {len(monitor.watch.outcomes)}: {monitor.watch.phase}"
                description = "recording" if options.observe else description
                progress.update(bar, completed=len(monitor.watch.outcomes), description=description)
            deadline = time.monotonic() + (BRAKING_S if trouble else SETTLING_S)
            while not stop.is_set() and time.monotonic() < deadline:
                monitor.spin()
            trouble = trouble or ("" if stop.is_set() else monitor.arms_stopped())
        except SamrlError as error:
            trouble = str(error)
        finally:
            late = group.stop()
    return monitor.watch, trouble, late


def _trouble(find: Callable[[], str], stop: Any) -> str:
    """Why the run cannot go on; nodes that an interrupt reached as well are no trouble."""
    found = find()
    return "" if stop.is_set() else found


def _bring_up(
    nodes: tuple[str, ...], group: Any, monitor: Any, care: Any, stop: Any, compilations: CompilationTeller
) -> str:
    """Start all nodes but the last, wait until they are active, then start the last, the supervisor."""
    others = nodes[:-1]
    group.start(others)
    while not all(monitor.is_active(name) for name in others):
        monitor.spin()
        compilations.report()
        late = tuple(name for name in others if not monitor.is_active(name))
        trouble = _trouble(partial(care.late, late), stop)
        if trouble or stop.is_set():
            return trouble
    group.start(nodes[-1:])
    return ""


def _open_desk(options: CellOptions, monitor: Any) -> Any:
    """Where a real cell asks its operator; None where there is nobody to ask."""
    if not options.hardware or options.observe:
        return None
    from samrl_ros.cell.operator_desk import OperatorDesk

    return OperatorDesk(monitor.tell)


def _is_done(options: CellOptions, monitor: Any, desk: Any) -> bool:
    """Whether all episodes have ended, and are judged where a person does that; observing has no end."""
    if options.observe:
        return False
    to_judge = desk is not None and options.judge == "operator" and desk.judged < options.episodes
    return len(monitor.watch.outcomes) >= options.episodes and not to_judge


def _start_view(options: CellOptions) -> Any:
    if not options.view:
        return None
    from samrl_ros.cell.live_view import start_live_view

    return start_live_view(options.task, options.cell)


def _sum_up(options: CellOptions, watch: Any, trouble: str, console: Console) -> bool:
    """Write `summary.json` and the picture from what was recorded; say where they are. False: no summary."""
    from samrl_ros.cell.contact_sheet import draw_contact_sheet
    from samrl_ros.cell.summary import summarise, write_json

    task, out = task_named(options.task), options.out
    try:
        summary = summarise(
            out, task, options.as_dict(), watch.wall_time_s, watch.marks, trouble, watch.incidents
        )
        write_json(out / "summary.json", summary)
    except InputError as error:
        console.print(f"[yellow]no summary:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        return False
    if options.observe:
        return tell_what_was_heard(out / "bag", console)
    console.print(_result(summary), highlight=False)
    for episode in summary["episodes"]:
        console.print(_line(episode, options.policy == TOUCH), highlight=False, soft_wrap=True)
    timing = summary["timing"]
    if math.isfinite(timing["real_time_factor_median"]):
        console.print(
            f"real-time factor {timing['real_time_factor_median']:.2f}, longest wall gap "
            f"{1e3 * timing['longest_wall_gap_s']:.0f} ms, "
            f"joint states at {timing['joint_state_hz_median']:.0f} Hz",
            highlight=False,
        )
    console.print(f"summary: {out / 'summary.json'}\nbag:     {out / 'bag'}", highlight=False)
    _keep_visited(options, task, console)
    picture = out / "contact_sheet.png"
    first = next((episode["episode"] for episode in summary["episodes"]), 0)
    try:
        draw_contact_sheet(out / "bag", picture, episode=first)
        console.print(f"picture: {picture}", highlight=False)
    except InputError as error:
        console.print(f"[yellow]no picture:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
    _photograph(options, task, console)
    return True


def _result(summary: dict[str, Any]) -> str:
    """How many episodes succeeded, of those that somebody judged."""
    judged, low, high = summary["judged"], *summary["success_rate_wilson95"]
    others = len(summary["episodes"]) - judged
    if not judged:
        return f"{others} episodes; nobody judged them (on a real cell, --judge operator asks you)"
    judge = "the operator's word" if summary["judged_by"] == "operator" else "evaluation truth"
    rest = f"; {others} not judged" if others else ""
    return (
        f"{summary['successes']} of {judged} episodes succeeded by {judge} (95 %: {low:.2f}-{high:.2f}){rest}"
    )


def _photograph(options: CellOptions, task: Task, console: Console) -> None:
    """The bench of a cell that differs from its model; the model's own is a plain table."""
    from samrl_ros.cell.bench_photograph import write_bench_photograph

    if options.hardware or InstanceName.parse(options.instance).level == NOMINAL:
        return
    try:
        correction = correction_of(str(options.correction or ""))
        written = write_bench_photograph(options.out, task, cell_named(options.cell), correction)
    except InputError as error:
        console.print(f"[yellow]no photograph:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        return
    console.print(f"bench:   {written}", highlight=False)


def _write_page(options: CellOptions, console: Console) -> None:
    """The page that shows the run; a run without one is still a run."""
    from samrl_ros.cell.report.page import write_run_page

    try:
        written = write_run_page(options.out)
    except (InputError, OSError) as error:
        console.print(f"[yellow]no page:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        return
    console.print(f"page:    {written[0]}", highlight=False, soft_wrap=True)


def _keep_visited(options: CellOptions, task: Task, console: Console) -> None:
    """Line 16 of Algorithm 1: what Real2Sim found, for `samrl train --visited`."""
    from samrl_core.learning.states.visited import save_visited
    from samrl_ros.cell.visited_states import visited_in_bag

    try:
        found = visited_in_bag(options.out / "bag", task, cell_named(options.cell))
        if len(found):
            save_visited(options.out / VISITED, found)
    except InputError as error:
        console.print(f"[yellow]no visited states:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        return
    if len(found):
        console.print(f"visited: {options.out / VISITED}", highlight=False)


def _line(episode: dict[str, Any], by_touch: bool) -> str:
    success = {True: "success", False: "failure", None: "not judged"}[episode["success"]]
    # What stands where it should may have been pressed too hard on its way.
    pressed = episode["peak_contact_force_N"]  # of a real cell nobody knows it
    force = f", largest force {pressed:.1f} N" if success == "failure" and math.isfinite(pressed) else ""
    return (
        f"  episode {episode['episode']} (seed {episode['seed']}): {success}{force}, {episode['actions']} "
        f"actions, {_how_near(episode, by_touch)}, {len(episode['views'])} views considered, "
        f"{episode['wall_time_s']:.0f} s"
    )


def _how_near(episode: dict[str, Any], by_touch: bool) -> str:
    """Only a target that stands still has one error of its estimate; all tasks have one of their end."""
    estimate, end = episode["estimate_error_before_contact_m"], episode["final_error_m"]
    if not math.isfinite(estimate):
        return f"ended {1e3 * end:.1f} mm from the goal" if math.isfinite(end) else episode["reason"]
    if not by_touch:
        return f"estimate off by {1e3 * estimate:.2f} mm before contact"
    # A calibrated cell leaves millimetres: what touch is for, and no fault.
    found = ", touch found it" if episode["success"] else ""
    return f"images put the target {1e3 * estimate:.2f} mm beside{found}"
