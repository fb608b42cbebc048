"""Work on one world that needs bags: making it, and a baseline's answer. Picklable, for other processes."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.blind_test.scores.study import Study, move_folder
from samrl_core.blind_test.worlds.plan import PlanItem
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.array_file import write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.diagnosis.selection.gap_metric import QUANTITIES, channel_scales, gap_metric, shrink


@dataclass(frozen=True)
class Making:
    """A world to be made in a study's folder."""

    root: Path
    item: PlanItem


@dataclass(frozen=True)
class BaselineJob:
    """A baseline to be asked about a world."""

    root: Path
    world: str
    name: str

    @property
    def stage(self) -> str:
        """Folder of its answers."""
        return f"baselines/{self.name}"

    @property
    def finished(self) -> bool:
        """Whether there is an answer, a crash included."""
        return (Study(self.root).run_folder(self.stage, self.world) / "run.json").exists()


def make(job: Making) -> float:
    """Make a world; its observations are moved into place last, so that a killed run leaves nothing half.

    Returns:
        how long it took [s].

    Raises:
        InputError: the world cannot be made (its simulation ran away).
    """
    from samrl_core.blind_test.worlds.world import make_world
    from samrl_ros.recordings.write import write_recording

    began = time.monotonic()
    study = Study(job.root)
    half = job.root / "obs" / f".{job.item.id}.{os.getpid()}"
    _quiet(job.root / "making.log")
    recordings, label, oracle = make_world(job.item)
    shutil.rmtree(half, ignore_errors=True)
    half.mkdir(parents=True)
    for name, recording in recordings.items():
        write_recording(recording, half / f"{name}.mcap")
    write_arrays(study.oracle(job.item.id), oracle_arrays(recordings["C"], oracle))
    write_whole(study.label(job.item.id), json.dumps(label, indent=1) + "\n")
    move_folder(half, study.observations(job.item.id))
    return time.monotonic() - began


def oracle_arrays(held_out: ArmRecording, oracle: Any) -> dict[str, np.ndarray]:
    """What is sealed of the best possible answer: the re-simulation, the metric's scales, and its shrink."""
    controller = held_out.arm.controller
    assert controller is not None and controller.effort_limit is not None  # the forge describes both
    scales = channel_scales(held_out.arm, controller.effort_limit)
    time_s = oracle.effect_states.time
    true = _channels(oracle.effect_states, oracle.effect_commanded, time_s)
    nominal = _channels(oracle.nominal_states, oracle.nominal_commanded, time_s)
    measured = _channels(held_out.states, held_out.commanded_effort, time_s)
    before, after = gap_metric(measured, nominal, scales), gap_metric(measured, true, scales)
    return {
        "time": time_s,
        **{f"effect_{name}": values.astype(np.float32) for name, values in true.items()},
        **{f"scale_{name}": values for name, values in scales.items()},
        "oracle_nominal": np.array(before),
        "oracle_effect": np.array(after),
        "oracle_shrink": np.array(shrink(before, after)),
    }


def ask_baseline(job: BaselineJob) -> dict[str, Any]:
    """Let a baseline read the bags that may be fitted, and store its claim in the shape of a report."""
    from samrl_core.blind_test.baselines.registry import baseline
    from samrl_ros.recordings.read import read_recordings

    study = Study(job.root)
    _quiet(job.root / "making.log")
    began = time.monotonic()
    code, output, report = 0, "", None
    try:
        bags = [study.observations(job.world) / f"{part}.mcap" for part in ("A", "B")]
        report = baseline(job.name)(
            [recording for bag in bags for recording in read_recordings(bag)]
        ).as_report()
    except (InputError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        code, output = 1, f"{type(error).__name__}: {error}"  # a crash is an answer, and a wrong one
    run = {"world": job.world, "exit_code": code, "seconds": time.monotonic() - began, "output": output}
    half = study.root / job.stage / f".{job.world}.{os.getpid()}"
    shutil.rmtree(half, ignore_errors=True)
    half.mkdir(parents=True)
    if report is not None:
        write_whole(half / "report.json", json.dumps(report) + "\n")
    write_whole(half / "run.json", json.dumps(run) + "\n")
    move_folder(half, study.run_folder(job.stage, job.world))
    return run


def _channels(states: Any, commanded: Any, time_s: np.ndarray) -> dict[str, np.ndarray]:
    """Channels of the metric at common stamps, (N, J) each."""
    found = {name: (states.time, getattr(states, name)) for name in ("position", "velocity", "effort")}
    if commanded is not None:
        found["commanded_effort"] = (commanded.time, commanded.effort)
    return {
        name: np.stack([np.interp(time_s, found[name][0], column) for column in found[name][1].T], axis=1)
        for name in QUANTITIES
        if name in found and found[name][1] is not None
    }


def _quiet(log: Path) -> None:
    """Physics engines write to the process' output past Python; in a worker that goes to a file."""
    if multiprocessing.parent_process() is not None:
        target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(target, 1)
        os.dup2(target, 2)
        os.close(target)
