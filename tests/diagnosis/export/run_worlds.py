"""Diagnoses and exports worlds of `mujoco_worlds`; that file's own simulation judges the changed models.

python -m tests.diagnosis.export.run_worlds FOLDER [KIND:LAW:SEED ...]

Each world is recorded, imported by a mapping, diagnosed with its MJCF as the model, exported to MuJoCo, and
its held-out recording simulated again from original.xml and changed.xml by plain MuJoCo. A line of JSON for
each goes to FOLDER/worlds.jsonl. Without names all twenty are done.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from samrl_ros.cli.diagnosis.diagnose import diagnose_bags
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.any_importer import import_any
from tests.diagnosis.export.mujoco_worlds import KINDS, STEP, World, gap, make_world, record, simulate

ALL = tuple(
    f"{kind}:{law}:{11 + 2 * k + (law == 'motor')}"
    for k, kind in enumerate(KINDS)
    for law in ("servo", "motor")
)
QUANTITIES = ("position", "velocity", "commanded_effort")


def write_logs(world: World, folder: Path) -> Path:
    """The nominal MJCF, three logs and a mapping, as a user would have them; the mapping's path."""
    folder.mkdir(parents=True)
    (folder / "arm.xml").write_text(world.nominal)
    for programme in "ABC":
        np.savez(folder / f"{programme}.npz", **record(world, programme))
    columns = ("position", "velocity", "commanded_effort", "target", "speed")
    mapping: dict[str, Any] = {
        "joints": list(world.joints),
        "urdf": "arm.xml",
        "sources": {
            "log": {"file": "{name}.npz", "time": {"column": "time"}, "columns": {c: c for c in columns}}
        },
        "channels": {
            "states": {"position": "position", "velocity": "velocity"},
            "command": {"position": "target", "velocity": "speed"},
            "commanded_effort": {"effort": "commanded_effort"},
        },
        "recordings": [{"name": "A"}, {"name": "B"}, {"name": "C", "role": "held_out"}],
    }
    if not world.servo:  # a servo's gains are in the MJCF
        mapping["controller"] = {
            "stiffness": world.stiffness.tolist(),
            "damping": world.damping.tolist(),
            "period_s": STEP,
            "effort_limit": world.limit.tolist(),
        }
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    return folder / "mapping.yaml"


def judge(name: str, folder: Path) -> dict[str, Any]:
    """One world from its making to the shrink by plain MuJoCo; what was promised and found."""
    kind, law, seed = name.split(":")
    world = make_world(int(seed), kind, law == "servo")
    mapping = write_logs(world, folder)
    import_any(mapping, folder, folder / "bags")
    report = folder / "report"
    diagnose_bags(
        DiagnoseOptions((folder / "bags",), out=report, urdf=folder / "arm.xml", export=("mujoco",))
    )
    about = json.loads((report / "report.json").read_text())
    found: dict[str, Any] = {
        "world": name, "place": world.place, "size": world.size, "verdict": about["verdict"],
        "effects": [e["name"] for e in about["effects"]], "promise": about["gap"]["held_out"]["shrink"],
    }  # fmt: skip
    changed = report / "export" / "mujoco" / "changed.xml"
    if not changed.exists():
        return found
    held = np.load(changed.parent / "held_out.npz")
    scale = {quantity: held[f"0.scale_{quantity}"] for quantity in QUANTITIES}
    with np.load(folder / "C.npz") as file:
        log = dict(file)
    about = json.loads((changed.parent / "law.json").read_text())
    late = 0.0 if about["in_model"] else max(about["changed"]["command_delay"])  # for the controller's code
    before, after = (
        gap(log, simulate((changed.parent / f"{which}.xml").read_text(), world, "C", told), scale)
        for which, told in (("original", {}), ("changed", {"delay": late}))
    )
    best = gap(log, simulate(world.machine, world, "C", world.step), scale)
    own = json.loads((changed.parent / "export.json").read_text())["resimulated"]
    return found | {
        "before": before, "after": after, "shrink": 1 - after / before, "best": 1 - best / before,
        "script": None if own is None else own["shrink"],
    }  # fmt: skip


def main(arguments: list[str]) -> None:
    """Judge worlds and say the median."""
    folder, rows = Path(arguments[0]), []
    for name in arguments[1:] or ALL:
        row = judge(name, folder / name.replace(":", "_"))
        rows.append(row)
        with (folder / "worlds.jsonl").open("a") as stream:
            stream.write(json.dumps(row) + "\n")
    shares = [row["shrink"] / row["promise"] for row in rows if "shrink" in row]
    if shares:
        print(f"{len(shares)} of {len(rows)} exported, median {np.median(shares):.2f} of the promise")


if __name__ == "__main__":
    main(sys.argv[1:])
