"""The mappings of real machines, run on their logs where these are present."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.recordings import check_held_out
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.mapping import read_mapping
from samrl_ros.recordings import read_recordings

MAPPINGS = Path(__file__).resolve().parents[2] / "bags" / "mappings"


def imported(name: str, data: Path, out: Path | None = None) -> dict[str, ArmRecording]:
    """By name; through bags where `out` is given."""
    made = import_any(MAPPINGS / f"{name}.yaml", data / name, out).made
    found = {
        each.recording.name: each.recording
        if out is None
        else read_recordings(out / f"{each.recording.name}.mcap")[0]
        for each in made
    }
    fit = [found[each.recording.name] for each in made if each.role == "fit"]
    check_held_out(fit, [found[each.recording.name] for each in made if each.role == "held_out"])
    return found


@pytest.mark.parametrize("file", sorted(MAPPINGS.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_mapping_parses(file: Path) -> None:
    assert read_mapping(file).recordings


def test_emps_obeys_the_law_that_the_mapping_describes(shared_data: Path) -> None:
    for recording in imported("emps", shared_data).values():
        controller, command = recording.arm.controller, recording.command
        states, sent = recording.states, recording.commanded_effort
        assert controller is not None and command is not None and sent is not None
        assert command.position is not None and command.velocity is not None
        assert states.position is not None and states.velocity is not None and sent.effort is not None
        law = controller.stiffness * (command.position - states.position)
        law += controller.damping * (command.velocity - states.velocity)
        if command.effort is not None:
            law += command.effort
        error = np.sqrt(np.mean((law - sent.effort)[10:] ** 2) / np.mean(sent.effort**2))
        assert error < 0.04  # 0.2 % without pulses; with them, edges fall within a sample


def test_tx40_follows_gravity_and_couples_the_wrist(shared_data: Path, tmp_path: Path) -> None:
    from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

    found = imported("tx40", shared_data, tmp_path)
    assert set(found) == {"tx40_first_half", "tx40_second_half"}
    first = found["tx40_first_half"]
    assert first.states.position is not None and first.commanded_effort is not None
    assert first.arm.urdf is not None and "mesh" not in first.arm.urdf
    assert first.commanded_effort.effort is not None
    np.testing.assert_allclose(first.states.position[0], 0.0, atol=1e-3)  # it starts at the URDF's zero
    gravity = RigidArm(first.arm).gravity(first.states.position)[:, 1]
    assert np.corrcoef(gravity, first.commanded_effort.effort[:, 1])[0, 1] > 0.3


def test_so101_tracks_its_command(shared_data: Path) -> None:
    found = imported("so101_sage", shared_data)
    assert len(found) == 6
    prbs = found["prbs_excitation"]
    assert prbs.command is not None and prbs.command.position is not None and prbs.states.position is not None
    assert prbs.arm.urdf is None and prbs.commanded_effort is None and prbs.states.effort is None
    error = prbs.command.position - prbs.states.position
    assert 0.005 < np.sqrt((error**2).mean()) < 0.1


def test_sts3215_shows_play_that_the_control_lacks(shared_data: Path, tmp_path: Path) -> None:
    found = imported("sts3215_backlash", shared_data, tmp_path)

    def play(name: str) -> float:
        """Spread of the first servo [counts] while it holds."""
        recording = found[name]
        assert recording.states.position is not None and recording.command is not None
        assert recording.command.position is not None and recording.commanded_effort is not None
        assert recording.commanded_effort.effort is not None
        assert recording.commanded_effort.effort.min() < 0 < recording.commanded_effort.effort.max()
        holds = np.abs(recording.command.position[:, 0]) < 1e-9
        counts = recording.states.position[holds, 0] * 4096 / (2 * np.pi)
        return float(np.diff(np.percentile(counts, [10, 90]))[0])

    assert play("single") > 8
    assert play("comp2") < 3
