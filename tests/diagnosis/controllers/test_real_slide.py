"""EMPS, a real positioning axis, described as the velocity drive that it is, with efforts known and absent.

Janot, Gautier and Brunot 2019 published 203.5 N s/m and 20.39 N for its slide.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import read_mapping

ROOT = Path(__file__).parents[3]
DATA = ROOT.parent / "shared" / "data"
if not DATA.is_dir():
    DATA = ROOT.parents[1] / "shared" / "data"

pytestmark = pytest.mark.skipif(not (DATA / "emps").is_dir(), reason="recordings of real machines absent")
DRIVE = {
    "type": "velocity_drive",
    "velocity_gain": ["kv * gtau"],
    "position_gain": ["kp"],
    "velocity_feedforward": [0],
    "period_s": 0.001,
    "effort_limit": ["10 * gtau"],
}


def diagnosed(tmp_path: Path, effort: str) -> Diagnosis:
    """The pulses held out; `effort` is how the drive's force is known: volts, or not at all."""
    about: dict[str, Any] = yaml.safe_load((ROOT / "bags" / "mappings" / "emps.yaml").read_text())
    about["controller"] = DRIVE
    for channels in (about["channels"], about["recordings"][1]["channels"]):
        if effort == "none":
            channels.pop("commanded_effort")
    mapping = tmp_path / "emps.yaml"
    mapping.write_text(yaml.safe_dump(about))
    read = read_mapping(mapping)
    fit, held_out = (import_recording(spec, read, DATA / "emps").recording for spec in read.recordings)
    return diagnose([fit], [held_out], DiagnosisSettings())[0]


def test_a_velocity_drive_has_the_published_friction(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, "volts")
    named = {e.family: {k: p.value for k, p in e.parameters.items()} for e in found.effects}
    assert found.verdict == "effect"
    assert {"viscous_friction", "coulomb_friction"} == set(named)
    assert named["viscous_friction"]["Fv"] == pytest.approx(203.5, rel=0.2)
    assert named["coulomb_friction"]["Fc"] == pytest.approx(20.39, rel=0.2)
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.7


def test_its_law_alone_shows_the_dry_friction(tmp_path: Path) -> None:
    """Without a recorded force the viscous part and the offset stay in doubt, so nothing is certain."""
    found = diagnosed(tmp_path, "none")
    (nearest,) = found.effects or (found.nearest,)
    assert nearest is not None and nearest.family in ("coulomb_friction", "friction_asymmetry")
    sizes = nearest.parameters
    level = sizes["Fc"] if "Fc" in sizes else sizes["mean"]
    assert level.value == pytest.approx(20.39, rel=0.2)
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.4
