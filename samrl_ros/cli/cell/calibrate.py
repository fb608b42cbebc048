"""`samrl calibrate`: hand-eye and base-to-base calibration from recorded poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from samrl_core.cell.calibration.calibrate import FOUND, calibrate, write_calibration
from samrl_ros.contract.exit_codes import OK


@dataclass(frozen=True)
class CalibrateOptions:
    """Options of `samrl calibrate`."""

    pairs: Annotated[
        Path, typer.Argument(help="JSON file of recorded pairs; its kind determines what is calibrated.")
    ]
    hand_eye: Annotated[
        Path | None, typer.Option(help="Result of a hand-eye calibration, for base-to-base.")
    ] = None
    out: Annotated[Path, typer.Option(help="Folder of calibration.json and calibration.png.")] = Path(
        "out/calibration"
    )


def run_calibration(options: CalibrateOptions) -> int:
    """Calibrate, write the result, and print it."""
    found = calibrate(options.pairs, options.hand_eye)
    write_calibration(found, options.pairs, options.out)
    console = Console()
    deviation = np.sqrt(np.diag(found.covariance))
    x, y, z = 1e3 * found.pose.position
    console.print(f"{FOUND[found.kind]}: {x:.2f}, {y:.2f}, {z:.2f} mm, quaternion", end=" ", highlight=False)
    console.print(", ".join(f"{q:.6f}" for q in found.pose.quat_xyzw), highlight=False)
    console.print(
        f"standard deviation: {', '.join(f'{1e3 * s:.2f}' for s in deviation[:3])} mm; "
        f"{', '.join(f'{np.rad2deg(s):.3f}' for s in deviation[3:])} deg",
        highlight=False,
    )
    console.print(f"{options.out / 'calibration.json'}", highlight=False, soft_wrap=True)
    return OK
