"""What a forge's folder is made with: counts, seed, versions; and which worlds have their family withheld."""

from __future__ import annotations

import importlib.metadata
import json
import platform
import subprocess
from pathlib import Path
from typing import Any

from samrl_core.blind_test.scores.study import Study
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole

LEFT_OUT_FILE = "left_out.json"
KINDS = ("single", "none", "outside", "double")
SINGLE_ROUNDS, OUTSIDE_ROUNDS = 6, 4  # of worlds over the families
VERSIONS = ("samrl", "numpy", "pybullet", "mujoco", "pin", "warp-lang", "torch")


def same_as_before(study: Study, settings: dict[str, Any]) -> None:
    """Note the settings of a new folder; refuse one that was begun with others, or holds something else."""
    path = study.plan
    text = json.dumps(settings, indent=1) + "\n"
    if path.exists():
        if path.read_text() != text:
            raise InputError(f"{study.root} holds a forge with other settings ({path}); choose another --out")
        return
    if study.root.exists() and any(study.root.iterdir()):
        raise InputError(f"{study.root} is not empty and holds no forge; choose another --out")
    write_whole(path, text)


def commit_before(study: Study) -> str | None:
    """The commit that an unfinished forge began with: HEAD may have moved on."""
    path = study.plan
    return json.loads(path.read_text())["commit"] if path.exists() else None


def usual_counts(families: int, outside: int, usual: dict[str, Any]) -> dict[str, int]:
    """Counts of each kind for a study of some families, in the usual rounds over them and proportions.

    Args:
        families: of the library.
        outside: of those outside it.
        usual: counts over all families.
    """
    single = families * SINGLE_ROUNDS
    share = single / usual["single"]
    return {
        "single": single,
        "none": max(1, round(share * usual["none"])),
        "outside": outside * OUTSIDE_ROUNDS,
        "double": round(share * usual["double"]) if families >= 2 else 0,
    }


def by_engine(
    study: Study, counts: dict[str, int], usual: dict[str, Any], asked: dict[str, int | None]
) -> dict[str, int]:
    """Worlds by each engine beside PyBullet, where nobody says how many.

    The usual shares of what is there, or what an unfinished study began with; never more than are left.
    """
    before: dict[str, Any] = {}
    if study.plan.exists():
        begun = json.loads(study.plan.read_text())["settings"]
        before = begun if all(begun[kind] == counts[kind] for kind in KINDS) else {}
    total, made = sum(counts.values()), {name: n for name, n in asked.items() if n is not None}
    for name in asked:
        if name not in made:
            share = round(usual[name] * total / sum(usual[kind] for kind in KINDS))
            made[name] = before.get(name, max(0, min(share, total - sum(made.values()))))
    return {name: made[name] for name in asked}


def shares(worlds: int, usual: dict[str, Any]) -> dict[str, int]:
    """Counts of each kind that sum to `worlds`, in the usual proportions; one of each if they fit."""
    there = [k for k in KINDS if usual[k]]
    total = sum(usual[k] for k in there)
    counts = dict.fromkeys(KINDS, 0)
    counts |= {k: max(worlds * usual[k] // total, 1 if worlds >= len(there) else 0) for k in there}
    counts[there[0]] += worlds - sum(counts.values())
    return counts


def head() -> str:
    """Hash of the commit that is tested."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(
            "this is no git checkout, so there is no commit to seed from; give --seed or --commit"
        ) from error
    return found.stdout.strip()


def commit_or_none() -> str | None:
    """Hash of the commit that runs, where there is a checkout."""
    try:
        return head()
    except InputError:
        return None


def versions() -> dict[str, str]:
    """Of Python and of what the worlds are made with."""
    found = {name: version for name in VERSIONS if (version := _version(name))}
    return found | {"python": platform.python_version()}


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def left_out(study: Study, count: int) -> dict[str, str]:
    """World to withheld family: chosen once from the opened labels, in the shuffled order, family by family.

    This opens the seal inside the harness alone; what a diagnosis gets is a library without that family.
    """
    path = study.root / LEFT_OUT_FILE
    chosen: dict[str, str] = json.loads(path.read_text()) if path.exists() else {}
    labels = study.open_seal().labels()
    waiting = [w for w in study.published()["worlds"] if labels[w]["set"] == "single" and w not in chosen]
    while len(chosen) < count and waiting:
        families = list(chosen.values())
        counts = [families.count(labels[w]["effects"][0]["family"]) for w in waiting]
        world = waiting.pop(counts.index(min(counts)))
        chosen[world] = labels[world]["effects"][0]["family"]
    write_whole(path, json.dumps(chosen, indent=1) + "\n")
    return chosen
