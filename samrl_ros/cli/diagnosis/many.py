"""`samrl diagnose --many DIR`: every set of recordings below a folder, and what changed from day to day.

DIR/ROBOT/DAY is what `samrl diagnose` takes: a bag, a folder of bags, an import's folder, or a log of another
tool. A robot's own options stand in DIR/ROBOT/diagnose.yaml. Each set is diagnosed by itself, in a process of
its own; then the effects that were named on any day of a robot are measured on its other days (`--track`).
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from samrl_core.common import executor
from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder, is_there, write_whole
from samrl_core.common.text_files import parse_yaml, read_text
from samrl_core.diagnosis.history.history import Day, History, history, in_order, wanted
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.json_report import read_report
from samrl_core.diagnosis.result import GAPS
from samrl_ros.bags.reader import open_bag
from samrl_ros.cli.progress import with_progress
from samrl_ros.contract.exit_codes import GAP_FOUND, INPUT_REFUSED, INTERRUPTED, OK, USAGE
from samrl_ros.log_import.formats.rosbag import is_mcap
from samrl_ros.log_import.tables import RARELY_LOGS, SUFFIXES

ROBOT_FILE = "diagnose.yaml"
PATHS = ("urdf", "tolerances", "library", "mapping", "data")  # relative to the robot's folder
ROBOT_OPTIONS = (*PATHS, "arm", "effort", "xacro_arg")  # as on the command line
SINCE_1970 = 978_307_200.0  # [s] 2001; a log that begins before counts from its own start
_DATE = re.compile(r"(20\d\d)[-_]?([01]\d)[-_]?([0-3]\d)(?:[T_ -]?([0-2]\d)[-:_]?([0-5]\d))?")
REFUSED = "refused.txt"  # why a set cannot be used: an answer, as a report is
FAILED = "failed.txt"  # why its diagnosis broke down: a lack of memory, say; the next run tries it again
TRACKED = "tracked"  # folder, beside a set's report, of its second diagnosis


@dataclass(frozen=True)
class RecordingSet:
    """What is diagnosed at once; picklable."""

    robot: str
    name: str
    path: Path
    out: Path
    options: tuple[str, ...]  # further arguments of `samrl diagnose`

    @property
    def finished(self) -> bool:
        """Whether there is an answer, a refusal included."""
        return (self.out / "report.json").exists() or (self.out / REFUSED).exists()


def diagnose_many(
    root: Path, out: Path, options: Sequence[str], workers: int, ray: bool, fail_on_gap: bool
) -> int:
    """Diagnose all sets below `root`, those with a report in `out` excepted, and write the history.

    Args:
        root: folder of robots, or of one robot's days.
        out: gets ROBOT/DAY/report.* and history.json, history.html, history.png.
        options: arguments of `samrl diagnose` that hold for all sets.
        workers: processes side by side.
        ray: on a Ray cluster instead, whose nodes see the same folders.
        fail_on_gap: return 4 where any report names a gap.

    Raises:
        InputError: there is no set of recordings, or a robot's options are wrong; nothing was written.
    """
    screen = Console()
    sets = find_sets(root, out, options)
    mapping = executor.run_on_ray if ray else executor.run_in_threads
    try:
        _work("diagnoses", sets, mapping, workers)
        again = _tracking(sets)
        _work("effects of other days", again, mapping, workers)
    except (KeyboardInterrupt, InterruptedError):
        screen.print("interrupted; finished reports are kept, the same command goes on", highlight=False)
        return INTERRUPTED
    found = history(in_order([_day(s, out) for s in sets]))
    paths = _write(found, out)
    _show(found, screen)
    screen.print(f"[dim]{'  '.join(map(str, paths))}[/]", soft_wrap=True)
    gaps = any(day.verdict in GAPS for day in found.days)
    return GAP_FOUND if fail_on_gap and gaps else OK


def find_sets(root: Path, out: Path, options: Sequence[str]) -> list[RecordingSet]:
    """Sets below a folder by robot and name, in natural order.

    Raises:
        InputError: no such folder, or nothing in it that can be diagnosed.
    """
    if not is_folder(root):
        raise InputError(
            f"{root} is no folder; give one with a folder for each robot, and in it one for each day"
        )
    folders = [
        p for p in _children(root) if p.is_dir() and not _is_set(p) and any(map(_is_set, _children(p)))
    ]
    robots = folders or [root]
    sets = []
    for folder in robots:
        robot, own = folder.resolve().name, (*options, *robot_options(folder))
        for path in _children(folder):
            if _is_set(path):
                name = path.name
                sets.append(RecordingSet(robot, name, path, out / robot / name, own))
    if not sets:
        raise InputError(
            f"{root} holds no recordings at ROBOT/DAY or at DAY; a day is a bag, a folder of bags or a log"
        )
    return sets


def run_set(job: RecordingSet) -> int:
    """Diagnose one set in a process of its own; what was refused or broke down is kept with its reason.

    Raises:
        InterruptedError: it was stopped from outside; nothing is kept.
    """
    job.out.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "samrl_ros.cli.main", "diagnose", str(job.path.resolve())]
    package = Path(__file__).resolve().parents[3]
    path = os.pathsep.join(p for p in (str(package), os.environ.get("PYTHONPATH", "")) if p)
    process = subprocess.run(
        [*command, "--out", str(job.out.resolve()), *job.options],
        env={**os.environ, "PYTHONPATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        preexec_fn=ends_with_parent(),
        check=False,
    )
    if process.returncode == INTERRUPTED or process.returncode < 0:
        raise InterruptedError(f"the diagnosis of {job.path} was stopped; it is done anew next time")
    if process.returncode != OK:
        text = process.stderr.strip() or process.stdout.strip() or f"exit code {process.returncode}"
        refused = process.returncode in (INPUT_REFUSED, USAGE)
        write_whole(job.out / (REFUSED if refused else FAILED), text[-4000:] + "\n")
    return process.returncode


def _work(what: str, sets: Sequence[RecordingSet], mapping: Any, workers: int) -> None:
    todo = [s for s in sets if not s.finished]
    for done in with_progress(what, run_set, todo, len(sets), mapping, workers) if sets else ():
        if done.error is not None:
            raise done.error


def _tracking(sets: Sequence[RecordingSet]) -> list[RecordingSet]:
    """The same sets once more, for the effects that other days of their robot named."""
    days = [_day(s, s.out.parents[1]) for s in sets]
    effects = wanted(days)
    again = []
    for job, day in zip(sets, days, strict=True):
        missing = [e for e in effects[job.robot] if e not in day.named]
        if day.report is not None and missing:
            options = (*job.options, *(text for e in missing for text in ("--track", e)))
            again.append(RecordingSet(job.robot, job.name, job.path, job.out / TRACKED, options))
    return again


def _day(job: RecordingSet, out: Path) -> Day:
    folder = str(job.out.relative_to(out))
    time_s = _recorded(job.path)
    if (job.out / "report.json").exists():
        report = read_report(job.out / "report.json")
        if (again := job.out / TRACKED / "report.json").exists():
            report["tracked"] = read_report(again).get("tracked", [])
        return Day(job.robot, job.name, time_s, report, folder=folder)
    return Day(job.robot, job.name, time_s, None, _why_not(job.out), folder)


def _why_not(folder: Path) -> str:
    """Why a set has no report, in one line: a refusal with what it asks, or the last line of a breakdown."""
    for name in (REFUSED, FAILED):
        if (folder / name).exists():
            text = read_text(folder / name, "the reason").strip()
            _, begins, refusal = text.rpartition("refused: ")
            return " ".join(refusal.split()) if begins else text.splitlines()[-1]
    return "not diagnosed"


@cache  # asked after each of the two rounds
def _recorded(path: Path) -> float | None:
    """When a set was recorded, since 1970 [s]: by its first bag's clock, else by a date in its name."""
    bags = [path] if is_mcap(path) else sorted(path.glob("*.mcap")) if path.is_dir() else []
    try:
        starts = [bag.start_ns * 1e-9 for bag in map(open_bag, bags) if bag.message_count]
    except InputError:  # its diagnosis says what is wrong with it
        starts = []
    if starts and min(starts) > SINCE_1970:
        return min(starts)
    date = _DATE.search(path.name)
    if date is None:
        return None
    try:
        return datetime(*(int(part or 0) for part in date.groups()), tzinfo=UTC).timestamp()
    except ValueError:  # 2024-19-39 is a name, not a date
        return None


def _children(folder: Path) -> list[Path]:
    return sorted((p for p in folder.iterdir() if not p.name.startswith(".")), key=_natural)


def _natural(path: Path) -> list[tuple[int, str]]:
    """day2 before day10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", path.name)]


def _is_set(path: Path) -> bool:
    if not path.is_dir():
        kind = path.suffix.lower()
        return kind in SUFFIXES and kind not in (*RARELY_LOGS, ".txt")  # notes are kept as .txt
    signs = ("metadata.yaml", "recordings.json", "meta/info.json")
    return any(is_there(path / sign) for sign in signs) or any(path.glob("*.mcap"))


def robot_options(folder: Path) -> tuple[str, ...]:
    """Arguments of `samrl diagnose` by a robot's own file."""
    file = folder / ROBOT_FILE
    if not is_there(file):
        return ()
    content = parse_yaml(read_text(file, "the robot's options"), str(file)) or {}
    if not isinstance(content, dict) or (unknown := sorted(map(str, set(content) - set(ROBOT_OPTIONS)))):
        wrong = unknown if isinstance(content, dict) else content
        raise InputError(f"{file} holds {wrong}; it may have {', '.join(ROBOT_OPTIONS)}")
    arguments: list[str] = []
    for name, value in content.items():
        for one in value if isinstance(value, list) else [value]:
            text = str((folder / str(one)).resolve()) if name in PATHS else str(one)
            arguments += [f"--{name.replace('_', '-')}", text]
    return tuple(arguments)


def _write(found: History, out: Path) -> list[Path]:
    from samrl_core.diagnosis.history.page import to_html, to_png

    paths = [out / "history.html", out / "history.png", out / "history.json"]
    write_whole(paths[0], to_html(found))
    write_whole(paths[1], to_png(found))
    write_whole(paths[2], json.dumps(found.as_dict(), indent=1, allow_nan=False, ensure_ascii=False) + "\n")
    return paths


def _show(found: History, screen: Console) -> None:
    table = Table("robot", "day", "verdict", Column("named", overflow="fold"), "held-out gap shrinks by")
    for day in found.days:
        shrink = None if day.report is None else day.report["gap"]["held_out"]["shrink"]
        what = ", ".join(day.named) or day.refusal
        table.add_row(day.robot, day.name, day.verdict, escape(what), words.percent(shrink))
    screen.print(table)
    for series in found.series:
        for step in series.steps:
            last, first = series.between(step)
            unit = words.symbol(series.unit)
            change = f"from {words.number(step.before)} to {words.number(step.after)} {unit}"
            screen.print(
                f"{series.robot}: {series.effect} {series.parameter} changed {change} between {last.day} "
                f"and {first.day} (by chance {step.p_value:.1g})",
                highlight=False,
                soft_wrap=True,
            )
