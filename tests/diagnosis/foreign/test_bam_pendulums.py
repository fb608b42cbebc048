"""Servos of another author's simulator, imported by mapping and diagnosed; skipped where it is absent."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.any_importer import import_any
from tests.diagnosis.foreign.bam_pendulums import CASES, write_case

pytestmark = pytest.mark.slow


def diagnosed(case: str, folder: Path) -> Diagnosis:
    pytest.importorskip("bam", reason="better-actuator-models is not installed")
    write_case(CASES[case], folder)
    import_any(folder / "mapping.yaml", folder, folder / "bags")
    fit, held_out, notes = load(DiagnoseOptions((folder / "bags",), out=folder / "unused"))
    return diagnose(fit, held_out, DiagnosisSettings(), notes)[0]


@pytest.mark.xfail(reason="goals that are held for 6.5 ms look like a low-pass of the command", strict=True)
def test_nothing_wrong(tmp_path: Path) -> None:
    assert diagnosed("nothing wrong", tmp_path).verdict == "no_gap"


def test_nothing_wrong_where_goals_are_told_as_held(tmp_path: Path) -> None:
    assert diagnosed("nothing wrong, goals told as held", tmp_path).verdict == "no_gap"


@pytest.mark.parametrize(
    ("case", "family", "parameter", "value"),
    [
        ("friction not modelled", "coulomb_friction", "Fc", 0.1035),  # BAM's params/mx106/m1.json
        ("friction not modelled", "viscous_friction", "Fv", 0.0352),
        ("drop at low speed", "stribeck_friction", "drop", None),
        ("gears under load", "load_dependent_friction", "Kl", None),
        ("all of M6", "load_dependent_friction", "Kl", None),
        ("11.5 V for 15", "actuator_gain", "e", 11.5 / 15.0 - 1.0),
        ("gain 12 for 16", "controller_gain", "eK", 12.0 / 16.0 - 1.0),
    ],
)
def test_what_bam_put_in_is_named(
    case: str, family: str, parameter: str, value: float | None, tmp_path: Path
) -> None:
    found = diagnosed(case, tmp_path)
    named = {e.family: e for e in found.effects}
    told = f"{found.verdict}: {list(named)}, {found.reasons}"
    assert found.verdict == "effect" and family in named, told
    if value is not None:
        low, high = named[family].parameters[parameter].ci95
        assert low <= value <= high, f"{told}: {parameter} from {low} to {high}"


def test_what_a_pendulum_cannot_tell_apart_is_ambiguous(tmp_path: Path) -> None:
    found = diagnosed("heavier by a quarter", tmp_path)
    could = {name.partition("@")[0] for group in found.ambiguity_set for name in group}
    assert found.verdict == "ambiguous", (
        f"{found.verdict}: {[e.name for e in found.effects]}, {found.reasons}"
    )
    assert could == {"link_inertia", "payload"}
