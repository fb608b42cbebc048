"""Four real machines, imported by mapping alone and diagnosed; published values where there are any."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis, NamedEffect
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.any_importer import import_any

ROOT = Path(__file__).parents[3]
DATA = ROOT.parent / "shared" / "data"
COUNTS = 4096 / (2 * np.pi)  # of the STS3215's encoder per radian

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="recordings of real machines absent"),
]
Named = Callable[[str, str | None], Diagnosis]


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Named:
    """Diagnosis of a machine, or of one of its recordings; each made once."""
    folder, done = tmp_path_factory.mktemp("real"), {}

    def run(machine: str, recording: str | None = None) -> Diagnosis:
        if (machine, recording) not in done:
            bags = folder / machine
            if not bags.exists():
                import_machine(machine, bags)
            source = bags if recording is None else bags / f"{recording}.mcap"
            options = DiagnoseOptions((source,), out=folder / "unused")
            fit, held_out, notes = load(options)
            settings = DiagnosisSettings()
            done[machine, recording] = diagnose(fit, held_out, settings, notes)[0]
        return done[machine, recording]

    return run


def import_machine(machine: str, out: Path) -> None:
    """Bags of a machine by its mapping."""
    import_any(ROOT / "bags" / "mappings" / f"{machine}.yaml", DATA / machine, out)


def effect(diagnosis: Diagnosis, family: str) -> NamedEffect:
    (found,) = [e for e in diagnosis.effects if e.family == family]
    return found


def test_a_slide_has_the_published_friction(diagnosed: Named) -> None:
    """Janot et al. 2019: 203.5 N s/m, 20.39 N; pulses that were never fitted shrink in closed loop."""
    found = diagnosed("emps", None)
    assert found.verdict == "effect"
    assert {e.family for e in found.effects} == {"viscous_friction", "coulomb_friction"}  # the mass is right
    for family, name, published in (("viscous_friction", "Fv", 203.5), ("coulomb_friction", "Fc", 20.39)):
        size = effect(found, family).parameters[name]
        assert size.value == pytest.approx(published, rel=0.1)
        assert size.ci95[0] < published < size.ci95[1]
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.7
    (position,) = [c for c in found.gap.channels if c[0] == "position"]
    assert position[2] == pytest.approx(28.3e-6, rel=0.05)  # mass alone, as published
    assert position[3] is not None and position[3] < 6e-6  # published with both: 4.2 um
    assert found.unexplained_fraction < 0.1


def test_an_industrial_arm_has_friction_everywhere_and_a_coupled_wrist(diagnosed: Named) -> None:
    found = diagnosed("tx40", None)
    assert found.verdict == "effect"
    assert {e.place for e in found.effects} == {"arm:tool_arm"}
    sizes = effect(found, "viscous_friction").parameters
    assert all(sizes[f"Fv[joint_{k}]"].value > 0.5 for k in (1, 2, 3, 4, 5))
    # Motor 6 turns with joints 5 and 6 together, as the maker's transmission says.
    assert sizes["Fv[joint_5+joint_6]"].ci95[0] > 0.3
    assert {frozenset(c[:2]) for c in found.couplings[:2]} == {frozenset({"joint_5", "joint_6"})}
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.5
    assert found.not_testable["command_delay"]


@pytest.mark.parametrize(
    ("recording", "published"), [("single", (14.78,)), ("nocomp2", (7.5, 7.5)), ("single_3250", (4.0,))]
)
def test_a_servo_with_a_dead_zone(diagnosed: Named, recording: str, published: tuple[float, ...]) -> None:
    """Loaded dead zones in encoder counts, published with the recordings."""
    found = diagnosed("sts3215_backlash", recording)
    assert found.verdict == "effect"
    assert [e.family for e in found.effects] == ["backlash"]
    widths = [2 * COUNTS * p.value for p in found.effects[0].parameters.values()]
    assert widths == pytest.approx(list(published), abs=2.5)
    assert "joint_elasticity" in found.not_testable  # a load register answers the error it would explain


@pytest.mark.parametrize("recording", ["comp2", "pgain_zero_db"])
def test_no_dead_zone_in_the_control_recordings(diagnosed: Named, recording: str) -> None:
    assert diagnosed("sts3215_backlash", recording).verdict == "no_gap"


def test_an_arm_without_model_follows_late_and_gives_way(diagnosed: Named) -> None:
    """All of it at once is more than the library says with confidence; what it says must hold."""
    found = diagnosed("so101_sage", None)
    assert found.verdict in ("effect", "none_of_mine")
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.4
    assert any("joint:" in item.place and item.channel == "tracking" for item in found.where)
    assert {"payload", "viscous_friction"} <= set(found.not_testable)


def test_roles_of_an_import_are_kept(tmp_path: Path) -> None:
    import_machine("emps", tmp_path / "emps")
    roles = json.loads((tmp_path / "emps" / "recordings.json").read_text())
    assert roles["held_out"] == ["DATA_EMPS_PULSES.mcap"]
