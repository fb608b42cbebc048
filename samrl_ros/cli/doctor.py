"""`samrl doctor`: whether the cell can run here, and what to do where not."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from samrl_ros.contract.exit_codes import FAILED, OK
from samrl_ros.doctor.check import Check, Level
from samrl_ros.doctor.reach import check_reach, check_security
from samrl_ros.doctor.ros import (
    check_middleware,
    check_profile,
    check_ros,
    check_talk,
    configured_environment,
)
from samrl_ros.doctor.system import (
    check_disk,
    check_gpu,
    check_kernel_cache,
    check_processors,
    check_python,
    check_shared_memory,
    clean_shared_memory,
)
from samrl_ros.doctor.versions import check_lock, check_requirements
from samrl_ros.doctor.weights import check_weights

COLOR = {Level.OK: "green", Level.WARNING: "yellow", Level.PROBLEM: "bold red"}


@dataclass(frozen=True)
class DoctorOptions:
    """Options of `samrl doctor`."""

    out: Annotated[Path, typer.Option(help="Where recordings will lie: its disk is looked at.")] = Path("out")
    clean: Annotated[
        bool, typer.Option("--clean", help="First remove shared memory that killed processes left.")
    ] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead.")] = False


def checks(out: Path) -> Iterator[Check]:
    """All checks, one by one; what needs ROS is left out where there is none."""
    yield check_python()
    yield check_requirements()
    yield check_lock()
    environment = configured_environment()
    found = check_ros()
    yield found
    yield check_middleware(environment)
    yield check_profile(environment)
    yield check_shared_memory()
    if found.level is not Level.PROBLEM:
        yield check_talk()
        yield check_reach(environment)
    yield check_security(environment)
    rest: tuple[Callable[[], Check], ...] = (check_processors, check_gpu, check_weights, check_kernel_cache)
    for check in rest:
        yield check()
    yield check_disk(out)


def doctor(options: DoctorOptions) -> int:
    """Print a line per check; the exit code is 1 when there is a problem."""
    console = Console()
    made = []
    for check in (*([clean_shared_memory()] if options.clean else []), *checks(options.out)):
        made.append(check)
        if not options.as_json:
            line = f"[{COLOR[check.level]}]{check.level:8}[/] {check.name}: {escape(check.found)}"
            console.print(line, highlight=False, soft_wrap=True)
            if check.remedy:
                console.print(f"         -> {escape(check.remedy)}", highlight=False, soft_wrap=True)
    count = Counter(check.level for check in made)
    if options.as_json:
        summary = {"schema": 1, **{level.value: count[level] for level in Level}}
        typer.echo(json.dumps({**summary, "checks": [asdict(check) for check in made]}, indent=1))
    else:
        console.print(f"{count[Level.PROBLEM]} problems, {count[Level.WARNING]} warnings", highlight=False)
    return FAILED if count[Level.PROBLEM] else OK
