"""Writes a correction for one simulator: changed model, diff, page, ranges, re-simulation."""

from __future__ import annotations

import difflib
import json
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.array_file import write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there, write_whole
from samrl_core.common.names import known_are
from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.generated_mjcf import generated_mjcf
from samrl_core.diagnosis.export.page import page_of, picture_of
from samrl_core.diagnosis.export.randomise import SCRIPT, as_text, ranges_of
from samrl_core.diagnosis.export.statement import CONTROLLER, Statement
from samrl_core.diagnosis.export.to_isaaclab import to_isaaclab
from samrl_core.diagnosis.export.to_mjcf import in_model, to_mjcf
from samrl_core.diagnosis.export.to_urdf import to_urdf

TARGETS = ("mujoco", "urdf", "pybullet", "isaaclab", "gazebo")
SCRIPTS = Path(__file__).parent / "scripts"
RESIMULATED = {"mujoco": "resimulate_mujoco.py", "pybullet": "resimulate_pybullet.py"}
COMPARISON = "held_out_comparison.py"  # what both need, beside them
MOST_SECONDS = 1800.0  # of a re-simulation
# What the controller's own code does to its command and effort, and the neutral value of each.
IN_CODE = {
    "stiffness_scale": 1.0, "damping_scale": 1.0, "command_delay": 0.0, "command_cutoff": np.inf,
    "effort_delay": 0.0, "effort_cutoff": np.inf, "effort_rate_limit": np.inf, "effort_limit": np.inf,
    "actuator_gain": 0.0, "torque_offset": 0.0,
}  # fmt: skip
TOLD = ("stiffness_scale", "damping_scale", "command_delay", "command_cutoff")


@dataclass(frozen=True)
class Export:
    """What was written for one simulator."""

    target: str
    folder: Path
    files: tuple[Path, ...]
    statements: tuple[Statement, ...]
    resimulated: dict[str, Any] | None  # before, after, shrink; None where nothing was re-simulated
    why_not: str = ""  # nothing was


def write_export(
    correction: Correction, target: str, folder: Path, randomise: bool = False, resimulate: bool = True
) -> Export:
    """Write everything for one target into a new folder.

    Args:
        correction: of a report.
        target: one of `TARGETS`.
        folder: to make.
        randomise: also write posterior ranges.
        resimulate: run the held-out recordings there, where the target is one that runs here.

    Raises:
        InputError: unknown target, a folder that exists, or a model that does not fit.
    """
    if target not in TARGETS:
        raise InputError(f"unknown export {target!r}; {known_are(target, TARGETS)}")
    if is_there(folder):
        raise InputError(f"{folder} exists already; move it away, exports are not replaced")
    c, models = correction, _change_model(correction, target)
    suffix, statements = models.suffix, models.statements
    texts = {f"original.{suffix}": models.original, f"changed.{suffix}": models.changed, **models.beside}
    texts["changes.diff"] = "".join(
        difflib.unified_diff(
            models.original.splitlines(keepends=True), models.changed.splitlines(keepends=True),
            f"original.{suffix}", f"changed.{suffix}",
        )
    )  # fmt: skip
    if randomise:
        texts["randomise.json"], texts["randomise.py"] = as_text(ranges_of(c, target)), SCRIPT
    folder.mkdir(parents=True)
    for name, text in texts.items():
        write_whole(folder / name, text)
    found, why_not = None, ""
    if target in RESIMULATED:
        why_not = "" if resimulate else "it was not asked for"
        if c.law is None or not c.held_out:
            why_not = "the recordings describe no controller, or one that is more than stiffness and damping"
        if not why_not:
            _write_law(c, target, folder, statements, models.assets)
            found = _run(target, folder)
    else:
        why_not = f"{target} does not run here"
    names = list(texts)
    if found is not None:
        picture = picture_of(c, folder / "resimulated.npz", target)
        write_whole(folder / "resimulated.png", picture)
        names += ["resimulate.py", COMPARISON, "resimulated.json", "resimulated.npz", "resimulated.png"]
    page = page_of(c, target, statements, texts["changes.diff"], found, why_not, folder)
    write_whole(folder / "export.html", page)
    about = {
        "schema": 1, "target": target, "effects": c.effects, "statements": [asdict(s) for s in statements],
        "promise": c.promise, "resimulated": found, "not_resimulated": why_not or None,
    }  # fmt: skip
    write_whole(folder / "export.json", json.dumps(about, indent=1, allow_nan=False) + "\n")
    names += ["export.html", "export.json"]
    return Export(target, folder, tuple(folder / n for n in names), tuple(statements), found, why_not)


@dataclass(frozen=True)
class _Models:
    """A user's model and the corrected one, as texts."""

    suffix: str  # of their files
    original: str
    changed: str
    statements: list[Statement]
    assets: str | None = None  # folder that paths in them count from
    beside: dict[str, str] = field(default_factory=dict)  # file name -> text of what belongs to them


def _change_model(c: Correction, target: str) -> _Models:
    """The model that a target reads: an MJCF for MuJoCo, a URDF for all others."""
    form = c.model.get("form")
    if target == "mujoco":
        own = form == "mjcf"
        path = Path(c.model["path"]) if own and c.model.get("path") else None
        original = c.model["source"] if own else generated_mjcf(c)
        changed, statements = to_mjcf(c, original, path)
        return _Models("xml", original, changed, statements, str(path.parent.resolve()) if path else None)
    original = c.model["source"] if form in ("urdf", "xacro") else c.urdf
    if target == "isaaclab":
        changed, actuators, statements = to_isaaclab(c, original)
        return _Models("urdf", original, changed, statements, beside={"actuators.py": actuators})
    return _Models("urdf", original, *to_urdf(c, original, target))


def _write_law(
    c: Correction, target: str, folder: Path, statements: list[Statement], assets: str | None
) -> None:
    """law.json and held_out.npz for the script, and the script itself."""
    assert c.law is not None
    own = target == "mujoco" and in_model(c, (folder / "original.xml").read_text(), assets)
    neutral = {name: [None if np.isinf(v) else v] * len(c.joints) for name, v in IN_CODE.items()}
    changed: dict[str, list[float | None]] = {name: list(values) for name, values in neutral.items()}
    for s in statements:
        if s.how == CONTROLLER and s.what in IN_CODE and s.place.startswith("joint:"):
            j = c.joints.index(s.place.removeprefix("joint:"))
            changed[s.what][j] = c.at(s.what, j)
    # A link that carries its rotor's inertia must not show it behind the gear.
    neutral["rotor"] = [0.0] * len(c.joints)
    changed["rotor"] = [float(c.armature[j]) + c.at("rotor_inertia", j) for j in range(len(c.joints))]
    if own:  # what the controller says of itself
        for name in TOLD:
            changed[name] = [None if np.isinf(c.at(name, j)) else c.at(name, j) for j in range(len(c.joints))]
    about = {
        "joints": c.joints,
        "effort_limit": [None if np.isinf(x) else x for x in c.law.effort_limit], "period_s": c.law.period_s,
        "gravity_compensation": c.law.gravity_compensation, "gravity": c.law.gravity, "in_model": own,
        "recordings": len(c.held_out), "assets": assets, "original": neutral, "changed": changed,
    }  # fmt: skip
    write_whole(folder / "law.json", json.dumps(about, indent=1, allow_nan=False) + "\n")
    arrays = {f"{k}.{name}": value for k, run in enumerate(c.held_out) for name, value in run.items()}
    write_arrays(folder / "held_out.npz", arrays)
    write_whole(folder / "resimulate.py", (SCRIPTS / RESIMULATED[target]).read_text())
    write_whole(folder / COMPARISON, (SCRIPTS / COMPARISON).read_text())


def _run(target: str, folder: Path) -> dict[str, Any]:
    """Run the script as a user would.

    Raises:
        InputError: it failed; its last line is told.
    """
    command = [sys.executable, str(folder / "resimulate.py"), str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=MOST_SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"{folder / 'resimulate.py'} takes longer than {MOST_SECONDS:g} s; run it yourself"
        ) from error
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise InputError(
            f"{target} cannot re-simulate {folder}: {last}; run {folder / 'resimulate.py'} to see more"
        )
    result = json.loads((folder / "resimulated.json").read_text())
    assert isinstance(result, dict)
    return result
