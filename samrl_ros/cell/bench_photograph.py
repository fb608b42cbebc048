"""The photograph of a run: the bench of the simulated cell as the last episode left it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.instance.cell_instance import FILE, instance_named, read_instance_file
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.world.evaluation import chain_angles_of, ending_of, read_truth
from samrl_core.cell.world.pybullet.photograph import BenchState, photograph_bench
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import arm_topic
from samrl_ros.conversions.from_message import arm_reading

PHOTOGRAPH = "bench.png"
_JOINTS = {arm_topic(role, "joint_states"): role for role in ROLES}


def write_bench_photograph(
    folder: Path, task: Task, cell: CellSpec, correction: CellCorrection = NO_CORRECTION
) -> Path:
    """Photograph where bag and evaluation truth say that arms and bodies ended.

    Args:
        folder: of the run; gets `bench.png`.
        task: that was run.
        cell: the nominal one.
        correction: that the run had; the bag has joints less the zeros that it takes off.

    Raises:
        InputError: the run has no truth of an ending, no joint states, or no cell instance.
    """
    instance = instance_named(read_instance_file(folder / "evaluation" / FILE)["name"], cell)
    endings = [
        one["end"] for one in read_truth(folder / "evaluation" / "truth.jsonl").values() if "end" in one
    ]
    bag = open_bag(folder / "bag")
    newest = {record.topic: record.data for record in bag.messages(tuple(_JOINTS))}
    last: dict[str, Any] = {_JOINTS[topic]: bag.decoder(topic)(data) for topic, data in newest.items()}
    if not endings or len(last) < len(ROLES):
        raise InputError(f"{folder} has no episode that ended, or no joint states; nothing to photograph")
    ending = ending_of(endings[-1])
    encoders = {}
    for role, message in last.items():
        names = cell.arm(role).joint_names
        encoders[role] = arm_reading(message, names).position + correction.zeros(names, role)
    state = BenchState(encoders, ending.body_in_world, chain_angles_of(task, ending))
    image = photograph_bench(task, cell, instance, state)
    done, png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not done:
        raise InputError(f"OpenCV writes no PNG of {image.shape}")
    write_whole(folder / PHOTOGRAPH, png.tobytes())
    return folder / PHOTOGRAPH
