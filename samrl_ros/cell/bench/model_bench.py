"""`samrl bench renderer|physics|emd`: the model beside its peers, as JSON, a table and a picture."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from samrl_core.common.errors import InputError
from samrl_core.studies.speed.plots import ratio_picture
from samrl_ros.cell.summary import write_json
from samrl_ros.contract.exit_codes import FAILED, OK

Part = Callable[[], Any]
_LLVM = "DRJIT_LIBLLVM_PATH"
_EXTRA = "pip install -c constraints.txt -e '.[bench]'"


def measure(name: str, parts: Mapping[str, Part], out: Path) -> int:
    """Runs every part, writes `bench_NAME.json`; parts whose peer is not installed are named, and fail.

    Raises:
        InputError: the results are there already.
    """
    path = out / f"bench_{name}.json"
    if path.exists():
        raise InputError(f"{path} exists already; choose another folder with --out")
    console = Console()
    report: dict[str, Any] = {"schema": 1, "torch_threads": torch.get_num_threads(), "cores": os.cpu_count()}
    missing: dict[str, str] = {}
    with Progress(console=console) as progress:
        task = progress.add_task(name, total=len(parts))
        for part, work in parts.items():
            progress.update(task, description=part)
            try:
                report[part] = work()
            except ImportError as error:
                missing[part] = f"{error}; {_EXTRA}"
            progress.advance(task)
    if missing:
        report["missing"] = missing
    out.mkdir(parents=True, exist_ok=True)
    write_json(path, report)
    picture = path.with_suffix(".png")
    ratio_picture(report, picture)
    for part in parts:
        if part in report:
            console.print(_table(part, report[part]))
    for part, why in missing.items():
        console.print(
            f"{part}: not measured: {why}", style="yellow", highlight=False, markup=False, soft_wrap=True
        )
    console.print(f"bench:   {path}\npicture: {picture}", highlight=False)
    return FAILED if missing else OK


def _table(title: str, rows: Any) -> Table:
    rows = rows if isinstance(rows, list) else [rows]
    table = Table(title=title, show_header=False)
    for key in rows[0]:
        table.add_row(key.replace("_", " "), *(_shown(row.get(key, "")) for row in rows))
    return table


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def renderer_parts(rounds: int, batches: Sequence[int], device: str) -> dict[str, Part]:
    """Against Mitsuba and TinyRenderer on this CPU; rates over the batch on `device`."""
    from samrl_core.studies.speed import batches as rates
    from samrl_core.studies.speed import renderer_peers as peers

    _find_llvm()
    return {
        "gradients beside Mitsuba": lambda: [
            peers.against_mitsuba(size, lit, rounds) for lit in (False, True) for size in peers.SCENES
        ],
        "images beside TinyRenderer": lambda: [
            peers.against_tiny_renderer(s, 5 * rounds) for s in peers.SCENES
        ],
        "two threads": lambda: peers.with_threads("2k", 16, rounds),
        f"images per second on {device}": lambda: rates.image_rates(device, batches, rounds),
    }


def physics_parts(rounds: int, batches: Sequence[int], device: str, nimble: Path | None) -> dict[str, Part]:
    """Against MuJoCo, Newton and, with its Python, Nimble on this CPU; rates on `device`."""
    from samrl_core.studies.speed import batches as rates
    from samrl_core.studies.speed import physics_peers as peers

    parts: dict[str, Part] = {
        "chain beside MuJoCo": lambda: peers.chain_alone(rounds),
        "chain beside Newton": lambda: peers.chain_beside_newton(rounds),
        "disc beside Newton": lambda: peers.disc_beside_newton(rounds),
    }
    if nimble is not None:
        parts["chain beside Nimble"] = lambda: peers.chain_beside_nimble(nimble, rounds)
    for scene in rates.STEPPED:
        parts[f"{scene}: steps per second on {device}"] = lambda scene=scene: rates.step_rates(
            scene, device, batches, rounds
        )
    return parts


def emd_parts(rounds: int) -> dict[str, Part]:
    """Against POT and GeomLoss."""
    from samrl_core.studies.speed import emd_peers as peers

    return {"distances": lambda: [peers.against_transport(size, rounds) for size in peers.SIZES]}


def _find_llvm() -> None:
    """Mitsuba compiles with LLVM 19 or newer, which Debian 12 keeps beside its older default."""
    if _LLVM in os.environ:
        return
    for folder in ("/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib64"):
        found = sorted(Path(folder).glob("libLLVM.so.[12][0-9]*"))
        if found:
            os.environ[_LLVM] = str(found[-1])
            return
