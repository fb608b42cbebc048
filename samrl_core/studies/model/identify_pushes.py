"""Physical parameters from files of recorded pushes: a JSON with intervals and sentences, and a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.model.physical_parameters.identifiability import describe_parameters
from samrl_core.model.physical_parameters.identify import Identified, identify
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord

NAME = "identify"
SCALARS = {"period_s": float, "push_steps": int}


def write_push(path: Path, push: PushRecord) -> None:
    """Write a push as NPZ, an array for each field of `PushRecord`."""
    write_arrays(path, {f.name: np.asarray(getattr(push, f.name)) for f in fields(PushRecord)})


def read_push(path: Path) -> PushRecord:
    """Read a push that `write_push` or `numpy.savez` wrote.

    Raises:
        InputError: the file cannot be read, or its arrays are not those of a `PushRecord`.
    """
    arrays: dict[str, Any] = read_arrays(
        path, [f.name for f in fields(PushRecord)], "give an .npz file of one push"
    )
    for name, kind in SCALARS.items():
        if arrays[name].shape or arrays[name].dtype.kind not in "iuf":
            raise InputError(f"{path}: {name} has shape {arrays[name].shape}, must be one number")
        arrays[name] = kind(arrays[name])
    try:
        return PushRecord(**arrays)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def identify_files(paths: Sequence[Path], disc: Disc, mass_guess: float, out: Path) -> Identified:
    """Fit all pushes together; write identify.json and identify.png into `out`.

    Args:
        paths: of NPZ files, one push each.
        disc: shape of what was pushed.
        mass_guess: [kg].
        out: folder.

    Raises:
        InputError: a file is no push, or the guess is no mass.
    """
    found = identify([read_push(path) for path in paths], disc, mass_guess)
    record = {
        "schema": 1,
        "pushes": [path.name for path in paths],
        "disc": asdict(disc),
        "mass_guess_kg": mass_guess,
        "why_stopped": found.why_stopped,
        "explained": found.explained,
        "misfit": found.misfit if np.isfinite(found.misfit) else None,
        "mass_path_kg": found.mass_path.tolist(),
        "physical_parameters": [asdict(p) | {"determined": p.determined} for p in found.parameters],
        "combinations": [asdict(c) for c in found.combinations],
        "summary": list(describe_parameters(found.parameters, found.combinations)),
    }
    write_whole(out / f"{NAME}.json", json.dumps(record, indent=1) + "\n")
    _write_picture(found, out / f"{NAME}.png")
    return found


def _write_picture(found: Identified, path: Path) -> None:
    """Left: the mass over the iterations. Right: each parameter's 95 % interval as a share of its value."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    path_axis, axis = figure.subplots(1, 2)
    path_axis.plot(found.mass_path, marker="o")
    path_axis.set(xlabel="iteration", ylabel="mass [kg]")
    for row, one in enumerate(found.parameters):
        low, high = 100 * (1 - one.lower / one.value), 100 * (one.upper / one.value - 1)
        color = "tab:blue" if one.determined else "0.7"
        axis.errorbar([0.0], [row], xerr=[[low], [high]], fmt="o", color=color, capsize=3)
    axis.set_yticks(range(len(found.parameters)))
    axis.set_yticklabels([f"{p.name.replace('_', ' ')} {p.value:.3g}" for p in found.parameters])
    axis.set_xscale("symlog", linthresh=10)
    axis.set(xlabel="95 % interval about the value [%]; grey: not determined by the data")
    FigureCanvasAgg(figure).print_png(str(path))
