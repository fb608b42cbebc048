"""`samrl run-report`: the page of a run, made anew from its folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from samrl_core.common.errors import InputError
from samrl_ros.cell.report.page import write_run_page
from samrl_ros.contract.exit_codes import OK


@dataclass(frozen=True)
class RunReportOptions:
    """Options of `samrl run-report`."""

    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run of `samrl cell`.")]


def report_run(options: RunReportOptions) -> int:
    """Write run.html and run.webm into the folder.

    Raises:
        InputError: no run is there, or the folder cannot be written.
    """
    try:
        written = write_run_page(options.folder)
    except OSError as error:
        raise InputError(f"cannot write into {options.folder}: {error}; make it writable") from error
    for path in written:
        typer.echo(str(path))
    return OK
