"""The recipe for an effect, followed to the letter: its toy is forged, diagnosed and explained."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from samrl_core.blind_test.disturbances.registry import CATALOGUE
from samrl_core.diagnosis.effects import EFFECTS, FAMILIES
from tests.guide.pages import GUIDE, blocks

ROOT = Path(__file__).parents[2]

# One small world with the toy; the diagnosis may also blame what the toy is confounded with.
DIAGNOSE = """
import json, sys
from pathlib import Path
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect
from samrl_core.blind_test.worlds.world import make_world
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.effects import EFFECTS
from samrl_core.diagnosis.report.terminal import summary
from samrl_core.diagnosis.report.write_report import write_report
from samrl_ros.cli.diagnosis.effects import EffectsOptions, show_effects

planned = PlannedEffect("fan_drag", "joint:panda_joint2", "T0", 0.95, None)
worlds, label, _ = make_world(PlanItem("w", "single", "pybullet", "tool_arm", 0, (planned,), 1.0, 3, 4.0))
library = {"fan_drag", "viscous_friction", "coulomb_friction"}
settings = DiagnosisSettings(library=library, simulate=False)
diagnosis, _ = diagnose([worlds["A"], worlds["B"]], [worlds["C"]], settings)
write_report(diagnosis, Path(sys.argv[1]))
Path(sys.argv[1], "label.json").write_text(json.dumps(label))
print("\\n".join(summary(diagnosis)))
show_effects(EffectsOptions("fan_drag"))
"""


def follow(copy: Path) -> list[str]:
    """Make the page's files and insert its lines below the lines that they follow; the files touched."""
    touched = []
    for kind, name, text in blocks("add_an_effect.md", "python", "diff"):
        file = copy / name
        if kind == "python":
            assert not file.exists(), f"{name} exists: the recipe must make new files"
            file.write_text(text)
        else:
            before, after = text.splitlines()
            assert before[0] == " " and after[0] == "+"
            old = file.read_text()
            assert old.count(before[1:] + "\n") == 1
            file.write_text(old.replace(before[1:] + "\n", f"{before[1:]}\n{after[1:]}\n"))
        touched.append(name)
    return touched


def next_number() -> int:
    """The first number in the catalogue that no family has."""
    return max(family.number for family in FAMILIES.values()) + 1


def test_the_recipe_takes_the_next_number_and_the_last_lines() -> None:
    """The page's number was taken by a later effect, and its lines stood above the last ones."""
    following = next_number()
    files = {name: text for kind, name, text in blocks("add_an_effect.md", "python", "diff")}
    effect, disturbance = (text for name, text in files.items() if name.endswith("fan_drag.py"))
    assert f'"fan_drag", {following}, "Fan drag"' in effect and effect.startswith(f'"""{following}: ')
    assert disturbance.startswith(f'"""{following}. ')
    assert f"1 to {following - 1} are taken" in (GUIDE / "add_an_effect.md").read_text()
    assert f'{EFFECTS[-1].family}",' in files["samrl_core/diagnosis/effects/__init__.py"].split("+")[0]
    assert f'{CATALOGUE[-1]}",' in files["samrl_core/blind_test/disturbances/registry.py"].split("+")[0]


@pytest.mark.thorough
def test_the_recipe_adds_an_effect_that_is_named_and_explained(tmp_path: Path) -> None:
    copy, out = tmp_path / "copy", tmp_path / "out"
    for package in ("samrl_core", "samrl_ros"):
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    out.mkdir()
    assert len(follow(copy)) == 4, "two files and two lines"
    done = subprocess.run(
        [sys.executable, "-c", DIAGNOSE, str(out)],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    report = json.loads((out / "report.json").read_text())
    assert report["verdict"] == "effect", done.stdout
    (named,) = report["effects"]
    assert (named["family"], named["place"]) == ("fan_drag", "joint:panda_joint2")
    true = json.loads((out / "label.json").read_text())["effects"][0]["parameters"]["c"]
    low, high = named["parameters"]["c"]["ci95"]
    assert low < true["value"] < high and named["parameters"]["c"]["unit"] == true["unit"]
    page = (out / "report.html").read_text()
    assert "Fan drag at joint panda_joint2 causes the gap" in page
    assert "take the fan off" in page
    assert done.stdout.startswith("CAUSE FOUND: Fan drag at joint panda_joint2 causes the gap.")
    assert f"{next_number()} fan_drag: Fan drag" in done.stdout
