"""The process that trains the residual, `python -m` this module `FOLDER --task TASK`.

It takes what the processors have to spare: one thread, low priority, and rests between updates. It ends with
the process that started it, or on SIGTERM, and saves its state first.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from dataclasses import asdict
from pathlib import Path

import torch

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import InputError, SamrlError
from samrl_core.common.files import folder_lock, write_whole
from samrl_core.learning.residual.learners import settings_from_json, settings_to_json
from samrl_core.learning.residual.training import ResidualTraining, TrainingSettings
from samrl_core.learning.residual.transitions import nominal_encoder

NICENESS = 10  # of 19: control goes first, the rest of the computer as well
REFUSED = 3  # exit code; the reason is on standard error
BEFORE_S = 10.0  # for one whose node was killed to see it and save: an update and a sleep


def write_settings(folder: Path, settings: TrainingSettings) -> None:
    """Record what a worker in this folder shall do; it reads nothing else."""
    text = json.dumps({**asdict(settings), "learner": settings_to_json(settings.learner)}, indent=1)
    write_whole(folder / "settings.json", f"{text}\n".encode())


def read_settings(folder: Path) -> TrainingSettings:
    """What `write_settings` wrote.

    Raises:
        InputError: it is not there, or does not fit.
    """
    path = folder / "settings.json"
    try:
        found = json.loads(path.read_text())
        return TrainingSettings(learner=settings_from_json(found.pop("learner")), **found)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"cannot read {path} ({error}); the node that starts a worker writes it") from error


def main(arguments: list[str] | None = None) -> int:
    """Train until told to stop. Returns 0, or 3 with the reason on standard error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--task", required=True)
    parser.add_argument("--cell", default=DEFAULT_CELL, help="name of the cell")
    parser.add_argument("--weights", type=Path, help="folder of the task's `sim_actor`, else the package's")
    parser.add_argument("--parent", type=int, required=True, help="process with which this one ends")
    options = parser.parse_args(arguments)
    asked: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: asked.append(received))
    os.nice(NICENESS)
    torch.set_num_threads(1)
    try:
        with folder_lock(options.folder, BEFORE_S):
            settings, cell = read_settings(options.folder), cell_named(options.cell)
            encoder = nominal_encoder(options.task, cell, options.weights)
            training = ResidualTraining(
                options.folder, options.task, cell, encoder, settings, lambda text: print(text, flush=True)
            )
            training.run(lambda: bool(asked) or os.getppid() != options.parent)
    except SamrlError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main())
