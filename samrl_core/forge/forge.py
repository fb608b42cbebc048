"""A whole forge in a folder: `obs/<id>/{A,B,C}.mcap`, the truth sealed apart, `forge.json`; resumable."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path

from samrl_core.errors import InputError
from samrl_core.forge.plan import ForgeSettings, PlanItem, plan_worlds
from samrl_core.forge.seal import SEALED, seal, write_truth
from samrl_core.forge.world import make_world
from samrl_core.types.arm_recording import ArmRecording

# Writes one recording; core knows no bags. Must be importable by name where several processes are used.
Writer = Callable[[ArmRecording, Path], None]


def is_done(folder: Path, world_id: str) -> bool:
    """Whether a world is there whole: its label is written last."""
    return (folder / SEALED / f"{world_id}.json").is_file()


def write_world(item: PlanItem, folder: Path, write_recording: Writer, suffix: str = ".mcap") -> None:
    """Make one world's files.

    Raises:
        DivergedError: the world ran away; its family's range must be mended.
    """
    recordings, label, oracle = make_world(item)
    place = folder / "obs" / item.id
    place.mkdir(parents=True, exist_ok=True)
    for letter, recording in recordings.items():
        write_recording(recording, place / f"{letter}{suffix}")
    write_truth(folder / SEALED, label, oracle)


def forge(
    settings: ForgeSettings,
    folder: Path,
    write_recording: Writer,
    workers: int = 1,
    suffix: str = ".mcap",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> str:
    """Make all worlds that are not there yet, seal them, write `forge.json`; returns the seal's SHA-256.

    Raises:
        InputError: the folder holds a forge of other settings.
        DivergedError: a world ran away.
    """
    if workers < 1:
        raise InputError(f"{workers} workers; give at least one")
    folder.mkdir(parents=True, exist_ok=True)
    begun = folder / "settings.json"
    wanted = asdict(settings)
    if begun.is_file() and json.loads(begun.read_text()) != wanted:
        raise InputError(
            f"{folder} holds a forge of other settings; give another folder or the same settings"
        )
    begun.write_text(json.dumps(wanted, indent=1) + "\n")
    plan = plan_worlds(settings)
    # Worlds of one arm and programme follow each other: what is kept of a trajectory is then used again.
    due = sorted((i for i in plan if not is_done(folder, i.id)), key=lambda i: (i.arm, i.programme, i.id))
    _make(
        due, folder, write_recording, workers, suffix, lambda n: progress(len(plan) - len(due) + n, len(plan))
    )
    sha256 = seal(folder)
    published = {"schema": 1, **wanted, "worlds": [i.id for i in plan], "sealed_sha256": sha256}
    (folder / "forge.json").write_text(json.dumps(published, indent=1) + "\n")
    return sha256


def _make(
    due: Sequence[PlanItem],
    folder: Path,
    write_recording: Writer,
    workers: int,
    suffix: str,
    progress: Callable[[int], None],
) -> None:
    if workers == 1:
        for n, item in enumerate(due, start=1):
            write_world(item, folder, write_recording, suffix)
            progress(n)
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = [pool.submit(write_world, item, folder, write_recording, suffix) for item in due]
        for n, done in enumerate(as_completed(waiting), start=1):
            done.result()
            progress(n)
