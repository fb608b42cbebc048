"""All files of a report in one folder, each written whole or not at all."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.diagnosis.report.html_report import to_html
from samrl_core.diagnosis.report.json_report import to_json, write_json
from samrl_core.diagnosis.report.summary_picture import to_png
from samrl_core.diagnosis.result import Diagnosis


def write_report(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write report.json, report.html, summary.png and the next experiment, if any; the paths, in that order.

    Raises:
        InputError: the next experiment's file is no plain name below `folder`.
        OSError: the folder cannot be written.
    """
    report = to_json(diagnosis)
    picture = to_png(diagnosis)
    page = to_html(diagnosis, picture)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "report.json", folder / "report.html", folder / "summary.png"]
    if (n := diagnosis.next_experiment) is not None:
        name = PurePosixPath(n.file)
        if name.is_absolute() or ".." in name.parts or len(name.parts) != 1:
            raise InputError(f"next experiment's file is {n.file!r}, must be a plain name such as next.yaml")
        paths.append(folder / n.file)
        write_whole(paths[-1], yaml.safe_dump(n.programme, sort_keys=False, allow_unicode=True))
    write_whole(paths[1], page)
    write_whole(paths[2], picture)
    # Last, so that a folder with a report.json is complete.
    write_json(report, paths[0])
    return paths
