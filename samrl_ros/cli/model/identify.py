"""`samrl identify`: mass, inertia and friction of a pushed disc, with intervals."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there
from samrl_core.model.physical_parameters.identifiability import describe_parameters
from samrl_core.model.physical_parameters.push_record import Disc
from samrl_core.studies.model.identify_pushes import NAME, identify_files


@dataclass(frozen=True)
class IdentifyOptions:
    """Options of `samrl identify`."""

    pushes: Annotated[
        tuple[Path, ...],
        typer.Argument(help="NPZ files, one push each; without any, pushes are made in PyBullet."),
    ] = ()
    out: Annotated[Path, typer.Option(help="Folder of the JSON and the picture.")] = Path("out/identify")
    mass: Annotated[float, typer.Option(help="First guess of the mass in kg; needed with files.")] = 0.0
    radius: Annotated[float, typer.Option(help="Of the disc in metres; needed with files.")] = 0.0
    thickness: Annotated[float, typer.Option(help="Of the disc in metres; needed with files.")] = 0.0
    rim_radius: Annotated[
        float,
        typer.Option(help="Of the circle on which the disc stands, in metres; its radius unless given."),
    ] = 0.0
    cases: Annotated[int, typer.Option(help="Simulated discs of 0.5-1 kg, without files.", min=0)] = 20
    light: Annotated[int, typer.Option(help="Simulated discs of 0.08 kg, without files.", min=0)] = 5
    seed: Annotated[int, typer.Option(help="Of the simulated pushes; a fit of files has none.", min=0)] = 0


def identify_pushes(options: IdentifyOptions) -> int:
    """Fit the files' pushes together, or run the study on simulated ones.

    Raises:
        InputError: a file is no push, a size or the guess is missing, or the folder cannot be written.
    """
    o, console = options, Console()
    try:
        if not o.pushes:
            from samrl_core.studies.model.mass_from_pushes import run_study  # needs PyBullet

            run_study(o.out, o.cases, o.light, o.seed)
            return 0
        if missing := [path for path in o.pushes if not is_there(path)]:
            raise InputError(f"{missing[0]} does not exist; give recorded pushes")
        if not o.mass > 0:
            raise InputError(f"--mass is {o.mass} kg; give a first guess above 0")
        if not (o.radius > 0 and o.thickness > 0):
            raise InputError(f"--radius {o.radius} m and --thickness {o.thickness} m must be given, above 0")
        disc = Disc(o.radius, o.thickness, o.rim_radius or o.radius)
        found = identify_files(o.pushes, disc, o.mass, o.out)
    except OSError as error:
        raise InputError(f"cannot write to {o.out} ({error}); give another --out") from error
    for line in describe_parameters(found.parameters, found.combinations):
        console.print(line, highlight=False, soft_wrap=True)
    if not found.explained:
        console.print(
            f"[yellow]the model does not explain these pushes[/] ({found.why_stopped}, mean squared residual "
            f"{found.misfit:.3g} of the noise): the values mean nothing",
            soft_wrap=True,
        )
    for kind in ("json", "png"):
        console.print(o.out / f"{NAME}.{kind}", highlight=False, soft_wrap=True)
    return 0
