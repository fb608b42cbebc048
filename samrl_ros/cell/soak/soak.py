"""Hours of episodes of all tasks in turn: what grows, what slows down, what gets lost.

A turn is one `samrl cell` of some episodes of one task, as a user starts it. A soak that was interrupted goes
on behind the last whole turn when it is asked for again.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from shutil import rmtree
from typing import Any

from samrl_core.cell.tasks import task_named
from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.errors import InputError
from samrl_core.common.files import folder_lock, keep_to, room_for, write_whole
from samrl_ros.cell.soak.bag_figures import figures_of
from samrl_ros.cell.soak.options import SAMPLES, TURN, SoakOptions, read_turn, whole_turns
from samrl_ros.cell.soak.process_watch import ProcessWatch
from samrl_ros.contract.exit_codes import INTERRUPTED, OK

SAMPLE_S = 5.0  # wall time from one sample of the processes to the next
STOP_S = 600.0  # wall time in which a cell that is asked to stop sums up; seconds, minutes beside other work


def run_soak(options: SoakOptions, stop: threading.Event, say: Callable[[str], None]) -> list[Path]:
    """Run turns until the hours are over or `stop` is set; returns the folders of all whole turns.

    Raises:
        InputError: unknown tasks, or a folder that holds another soak.
    """
    for task in options.tasks:
        task_named(task)
    with folder_lock(options.out):
        wanted = {"tasks": list(options.tasks), "episodes": options.episodes, "seed": options.seed}
        keep_to(options.out / "soak_settings.json", {**wanted, "layout": options.layout}, "soak", {})
        turns = whole_turns(options.out)
        spent = sum(read_turn(turn)["wall_s"] for turn in turns)
        while spent < 3600.0 * options.hours and not stop.is_set():
            number = len(turns)
            task = options.tasks[number % len(options.tasks)]
            folder = options.out / f"turn-{number:03d}-{task}"
            rmtree(folder, ignore_errors=True)  # of a soak that was killed
            left = 3600.0 * options.hours - spent
            say(f"turn {number}: {task}, {options.episodes} episodes; {left / 60:.0f} min left")
            turn = _run_turn(options, folder, task, number, left, stop)
            if stop.is_set() and not turn["episodes"]:
                rmtree(folder)  # to be run again
                break
            turns.append(folder)
            spent += turn["wall_s"]
            say(f"  {turn['episodes']} episodes, {turn['successes']} succeeded, {turn['wall_s']:.0f} s")
            if turn["error"]:
                say(f"  {turn['error']}")
    return turns


def cell_command(options: SoakOptions, task: str, seed: int, out: Path) -> list[str]:
    """What a turn runs."""
    command = [sys.executable, "-m", "samrl_ros.cli.main", "cell", "--task", task, "--seed", str(seed)]
    return [*command, "--episodes", str(options.episodes), "--layout", options.layout, "--out", str(out)]


def _run_turn(
    options: SoakOptions, folder: Path, task: str, number: int, left_s: float, stop: threading.Event
) -> dict[str, Any]:
    """One `samrl cell`; its figures are written to the turn's folder."""
    folder.mkdir(parents=True)
    seed = options.seed + number * options.episodes
    begun = time.monotonic()
    console_log = folder / "console.log"
    with room_for(console_log), console_log.open("wb") as log:
        cell = subprocess.Popen(
            cell_command(options, task, seed, folder / "run"),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=ends_with_parent(signal.SIGINT),
        )
        watch = ProcessWatch(cell.pid, folder / SAMPLES)
        try:
            while cell.poll() is None and not stop.is_set() and time.monotonic() - begun < left_s:
                watch.sample()
                _wait(cell, SAMPLE_S, stop)
            asked_to_stop = cell.poll() is None
        finally:
            _stop(cell)
    left = watch.left_behind()
    turn = {
        "schema": 1,
        "task": task,
        "seed": seed,
        "exit_code": cell.returncode,
        "wall_s": time.monotonic() - begun,
        "left_in_shared_memory": [path.name for path in left],
        **_figures(folder / "run"),
    }
    expected = (OK, INTERRUPTED) if asked_to_stop else (OK,)
    if not turn["error"] and cell.returncode not in expected:
        turn["error"] = f"exit code {cell.returncode}; see {folder / 'console.log'}"
    elif asked_to_stop and cell.returncode == INTERRUPTED:
        turn["error"] = ""  # it was we who interrupted it
    write_whole(folder / TURN, json.dumps(turn, indent=1) + "\n")
    if not options.keep_bags and turn["episodes"]:  # the bag of a failure is needed
        rmtree(folder / "run" / "bag", ignore_errors=True)
    return turn


def _figures(run: Path) -> dict[str, Any]:
    """Of the run's summary and bag; of a run without them, why there are none."""
    try:
        summary = json.loads((run / "summary.json").read_text())
        found = figures_of(run / "bag")
    except (InputError, OSError, ValueError) as error:
        empty = {"episodes": 0, "successes": 0, "real_time_factor": None, "latencies": {}, "losses": {}}
        return {**empty, "outcomes": [], "error": f"no figures: {error}"}
    return {
        "episodes": len(summary["episodes"]),
        "successes": summary["successes"],
        "real_time_factor": summary["timing"]["real_time_factor_median"],
        "error": summary["error"],
        "outcomes": [reason for _, reason in found.outcomes],
        "latencies": {name: _halves(values) for name, values in found.latencies.items()},
        "losses": found.losses,
    }


def _halves(values: list[tuple[float, float]]) -> dict[str, list[tuple[float, int]]]:
    """Latencies of the first and of the last half of the turn's time: each [s], and how often."""
    middle = 0.5 * (values[0][0] + values[-1][0]) if values else 0.0
    start = Counter(round(v, 6) for t, v in values if t <= middle)
    end = Counter(round(v, 6) for t, v in values if t > middle)
    return {"start": sorted(start.items()), "end": sorted(end.items())}


def _wait(cell: subprocess.Popen[bytes], seconds: float, stop: threading.Event) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until and cell.poll() is None and not stop.wait(0.2):
        pass


def _stop(cell: subprocess.Popen[bytes]) -> None:
    """Ctrl-C, which leaves a summary; who does not heed it is killed."""
    if cell.poll() is None:
        cell.send_signal(signal.SIGINT)
        try:
            cell.wait(STOP_S)
        except subprocess.TimeoutExpired:
            cell.kill()
            cell.wait()
