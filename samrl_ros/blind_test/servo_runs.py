"""A stand-in's logs, URDF and mapping, written as its user has them, and its label. Picklable."""

from __future__ import annotations

import json
import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from samrl_core.blind_test.scores.diagnosis_run import MAPPING
from samrl_core.blind_test.scores.study import Study, move_folder, write_atomically
from samrl_core.blind_test.servo_worlds.plan import ServoItem
from samrl_core.common.files import write_whole


@dataclass(frozen=True)
class ServoMaking:
    """A stand-in to be made in a study's folder."""

    root: Path
    item: ServoItem


def make_servo(job: ServoMaking) -> float:
    """Make a stand-in; its observations are moved into place last.

    Returns:
        how long it took [s].

    Raises:
        RanAwayError: it cannot be made.
    """
    from samrl_core.blind_test.servo_worlds.world import make_servo_world

    began = time.monotonic()
    study = Study(job.root)
    half = job.root / "obs" / f".{job.item.id}.{os.getpid()}"
    made = make_servo_world(job.item)
    shutil.rmtree(half, ignore_errors=True)
    half.mkdir(parents=True)
    style = made.mapping["sources"]["log"]["csv"]
    for letter, table in made.tables.items():
        write_whole(half / f"log_{letter}.csv", csv_text(table, style["delimiter"], style["decimal"]))
    write_whole(half / "model.urdf", made.urdf)
    write_whole(half / MAPPING, yaml.safe_dump(made.mapping, sort_keys=False))
    write_atomically(study.label(job.item.id), (json.dumps(made.label, indent=1) + "\n").encode())
    move_folder(half, study.observations(job.item.id))
    return time.monotonic() - began


def csv_text(table: dict[str, np.ndarray], separator: str, decimal: str) -> str:
    """Columns (N,) as a file's text, numbers as short as they are exact."""
    rows = [separator.join(table)]
    for row in zip(*(column.tolist() for column in table.values()), strict=True):
        rows.append(separator.join(repr(x if x % 1 else int(x)).replace(".", decimal) for x in row))
    return "\n".join(rows) + "\n"
