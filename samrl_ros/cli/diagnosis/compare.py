"""`samrl diagnose REAL --sim LOG`: where and when a simulator's log leaves the machine's, without a model."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there, write_whole
from samrl_core.diagnosis.report.parting_page import parting_page
from samrl_core.diagnosis.two_logs import Parting, compare_logs

ARRAYS = ("time", "real", "simulated")
Load = Callable[[Path], tuple[ArmRecording, list[str]]]


def compare(real: Path, simulated: Path, out: Path, load: Load, screen: Console) -> None:
    """Compare, and write parting.json and parting.html.

    Raises:
        InputError: a log that cannot be used, logs that do not fit, or a folder with a comparison.
    """
    if is_there(out / "parting.json"):
        raise InputError(f"{out} has a comparison already; give another --out")
    with screen.status("reading both logs"):
        (a, first), (b, second) = load(real), load(simulated)
        found = compare_logs(a, b)
    notes = [*first, *second, *found.notes]
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "parting.html", parting_page(found, real.name, simulated.name, notes))
    write_whole(out / "parting.json", json.dumps(_as_json(found, notes), indent=1, allow_nan=False) + "\n")
    for line in _lines(found, notes, out):
        screen.print(escape(line), highlight=False, soft_wrap=True)


def _as_json(found: Parting, notes: list[str]) -> dict:
    channels = [
        {k: v for k, v in asdict(c).items() if k not in ARRAYS} | {"unit": c.unit} for c in found.channels
    ]
    return {
        "schema": 1, "shift_s": found.shift_s, "command_error": found.command_error, "channels": channels,
        "notes": notes,
    }  # fmt: skip


def _lines(found: Parting, notes: list[str], out: Path) -> list[str]:
    lines = [f"note: {note}" for note in notes]
    parted = [c for c in found.channels if c.parts_at is not None]
    if not parted:
        return [*lines, "the two logs agree in all channels", f"files {out / 'parting.html'}"]
    first = parted[0]
    lines.append(
        f"they part first in the {first.quantity} of {first.joint}, at {first.parts_at:.2f} s,"
        f" most at {first.phase}"
    )
    lines += [
        f"  {c.joint} {c.quantity}: from {c.parts_at:.2f} s, {c.share:.0%} of the time,"
        f" {c.rms:.3g} {c.unit} rms"
        f" ({c.relative:.0%} of its range), most at {c.phase}"
        for c in parted[:8]
    ]
    lines += [f"  and {len(parted) - 8} channels more"] if len(parted) > 8 else []
    return [*lines, f"files {out / 'parting.html'}"]
