"""`samrl diagnose --apply` for an arm by the command line: bags in, a corrected URDF out."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from samrl_ros.cli.main import run
from samrl_ros.recordings.write import write_recording
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT

FAMILIES = "families: [viscous_friction, coulomb_friction, payload]\n"


def damping(urdf: Path) -> dict[str, float]:
    """Of each joint of a URDF that states one."""
    found = {}
    for joint in ElementTree.parse(urdf).getroot().findall("joint"):
        dynamics = joint.find("dynamics")
        if dynamics is not None:
            found[str(joint.get("name"))] = float(dynamics.get("damping", "0"))
    return found


@pytest.mark.thorough
def test_a_corrected_urdf_lies_beside_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bags = []
    for recording in worlds.world(5, viscous={LIFT: 1.0}):
        bags.append(tmp_path / f"{recording.name}.mcap")
        write_recording(recording, bags[-1])
    (tmp_path / "library.yaml").write_text(FAMILIES)
    how = ["--library", str(tmp_path / "library.yaml"), "--apply"]
    fitted, held_out = [str(bag) for bag in bags[:2]], ["--held-out", str(bags[2])]
    assert run(["diagnose", *fitted, *held_out, *how, "--out", str(tmp_path / "report")]) == 0
    printed = capsys.readouterr().out
    folder = tmp_path / "report" / "apply"
    assert "applied: joint:lift" in printed and str(folder / "arm.urdf") in printed
    (value,) = json.loads((folder / "arm.json").read_text())["values"]
    assert (value["field"], value["joint"]) == ("viscous", "lift")
    assert damping(folder / "arm.urdf")["lift"] == pytest.approx(value["value"])
    assert value["value"] == pytest.approx(1.0, rel=0.1)

    # With the corrected arm in place of its own the same recordings have no gap: nothing is left to apply.
    how += ["--urdf", str(folder / "arm.urdf")]
    assert run(["diagnose", *fitted, *held_out, *how, "--out", str(tmp_path / "again")]) == 0
    assert "nothing was applied: nothing differs from the description" in capsys.readouterr().out
    assert not (tmp_path / "again" / "apply").exists()
