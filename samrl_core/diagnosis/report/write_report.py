"""All files of a report in one folder, each written whole or not at all; drawing them comes first."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.diagnosis.report.html_report import to_html
from samrl_core.diagnosis.report.json_report import json_text, to_json
from samrl_core.diagnosis.report.summary_picture import to_png
from samrl_core.diagnosis.result import Diagnosis

JSON = "report.json"


def write_report(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write report.json, report.html, summary.png and the next experiment, if any; the paths, in that order.

    Raises:
        InputError: the next experiment's file is no plain name below `folder`.
        OSError: the folder cannot be written.
    """
    return write_contents(report_contents(diagnosis), folder)


def report_contents(diagnosis: Diagnosis) -> dict[str, str | bytes]:
    """Contents of a report's files by name, as `write_report` names them; takes seconds.

    Raises:
        InputError: the next experiment's file is no plain name.
    """
    report = to_json(diagnosis)
    picture = to_png(diagnosis)
    page = to_html(diagnosis, picture)
    contents = {JSON: json_text(report), "report.html": page, "summary.png": picture}
    if (n := diagnosis.next_experiment) is not None:
        name = PurePosixPath(n.file)
        if name.is_absolute() or ".." in name.parts or len(name.parts) != 1:
            raise InputError(f"next experiment's file is {n.file!r}, must be a plain name such as next.yaml")
        contents[n.file] = yaml.safe_dump(n.programme, sort_keys=False, allow_unicode=True)
    return contents


def write_contents(contents: Mapping[str, str | bytes], folder: Path) -> list[Path]:
    """Write what `report_contents` made; the paths, in its order.

    Raises:
        InputError: there is no room.
        OSError: the folder cannot be written.
    """
    # report.json last, so that a folder that has one is complete.
    for name in sorted(contents, key=lambda name: name == JSON):
        write_whole(folder / name, contents[name])
    return [folder / name for name in contents]
