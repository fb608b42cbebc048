"""A servo world's logs, URDF and mapping, written as its user has them, and its label. Picklable."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from samrl_core.blind_test.scores.diagnosis_run import MAPPING
from samrl_core.blind_test.scores.study import Study, move_folder
from samrl_core.blind_test.servo_worlds.log_style import STATES_TOPIC, TARGETS_TOPIC
from samrl_core.blind_test.servo_worlds.plan import ServoItem
from samrl_core.common.files import write_whole
from samrl_ros.bags.writer import BagWriter
from samrl_ros.recordings.joint_messages import JOINT_STATE, QUANTITIES, encode_topic

_EFFORTS = ("torque", "volt", "mA", "input")  # headings of what stands in a message's effort


@dataclass(frozen=True)
class ServoMaking:
    """A servo world to be made in a study's folder."""

    root: Path
    item: ServoItem


def make_servo(job: ServoMaking) -> float:
    """Make a servo world; its observations are moved into place last.

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
    sources = made.mapping["sources"]
    for letter, table in made.tables.items():
        if "log" in sources:
            style = sources["log"]["csv"]
            write_whole(half / f"log_{letter}.csv", csv_text(table, style["delimiter"], style["decimal"]))
        else:
            write_log(half / f"log_{letter}.mcap", table, made.mapping["joints"])
    write_whole(half / "model.urdf", made.urdf)
    write_whole(half / MAPPING, yaml.safe_dump(made.mapping, sort_keys=False))
    write_whole(study.label(job.item.id), json.dumps(made.label, indent=1) + "\n")
    move_folder(half, study.observations(job.item.id))
    return time.monotonic() - began


def write_log(path: Path, table: dict[str, np.ndarray], joints: list[str]) -> None:
    """Columns in SI units as the topics of a bag of ROS 2, by their headings."""
    stamps = np.rint((table["time"] + 1.0) * 1e9).astype(np.int64)

    def of(heading: str) -> np.ndarray | None:
        found = [table[name] for j in joints if (name := f"{heading}_{j}") in table]
        return np.stack(found, axis=1) if found else None

    efforts = [found for heading in _EFFORTS if (found := of(heading)) is not None]
    states = {"position": of("pos"), "velocity": of("vel"), "effort": efforts[0] if efforts else None}
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".bag_") as folder:
        bag = Path(folder) / "bag"
        with BagWriter(bag) as writer:
            for topic, values in ((STATES_TOPIC, states), (TARGETS_TOPIC, {"position": of("target")})):
                if values["position"] is None:
                    continue
                every = {name: values.get(name) for name in QUANTITIES[JOINT_STATE]}
                writer.add_topic(topic, JOINT_STATE)
                for stamp, data in zip(
                    stamps.tolist(), encode_topic(JOINT_STATE, stamps, tuple(joints), every), strict=True
                ):
                    writer.write(topic, stamp, data)
        (bag / "bag_0.mcap").rename(path)


def csv_text(table: dict[str, np.ndarray], separator: str, decimal: str) -> str:
    """Columns (N,) as a file's text, numbers as short as they are exact."""
    rows = [separator.join(table)]
    for row in zip(*(column.tolist() for column in table.values()), strict=True):
        rows.append(separator.join(repr(x if x % 1 else int(x)).replace(".", decimal) for x in row))
    return "\n".join(rows) + "\n"
