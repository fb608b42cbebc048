"""Positions whose unit no name says: what rests on the answer is asked with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping

TIME = np.arange(0.0, 6.0, 0.005)
POSITION = np.column_stack([0.1 * np.sin(2.0 * TIME + k) for k in range(2)])  # [rev]
RATE = np.column_stack([0.2 * np.cos(2.0 * TIME + k) for k in range(2)])  # [rev/s]
RESTING = ("channels.states.velocity", "channels.command.position", "channels.command.velocity")


def moteus(path: Path, speeds_in_one: float = 1.0, of: str = "position") -> Path:
    """A log of two moteus, whose numbers are in revolutions and no name says so."""
    columns = {"timestamp": TIME}
    for k in range(2):
        columns |= {
            f"id{k + 1} {of.upper()}": POSITION[:, k],
            f"id{k + 1} VELOCITY": RATE[:, k] / speeds_in_one,
            f"id{k + 1} CONTROL_{of.upper()}": 1.01 * POSITION[:, k],
            f"id{k + 1} CONTROL_VELOCITY": 1.01 * RATE[:, k] / speeds_in_one,
        }
    table, head = np.column_stack(list(columns.values())), ",".join(columns)
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.7f")
    return path


def not_sure(draft: Draft) -> set[str]:
    return {guess.key for guess in draft.guesses if not guess.sure}


def test_what_rests_on_a_units_question_is_not_sure(tmp_path: Path) -> None:
    draft = draft_any([moteus(tmp_path / "a.csv")], None, None)
    assert set(RESTING) < not_sure(draft)
    (question,) = [each for each in draft.questions if each.startswith("channels.states.position")]
    assert "rev" in question and "Answer for all four" in question
    assert all(key in question for key in RESTING)
    text = as_yaml(draft)
    assert text.count("ASKED with channels.states.position") == 3 and "rev/s if in rev" in text
    assert not any(f"sure: a.csv: id{{}} {name}" in text for name in ("VELOCITY", "CONTROL_VELOCITY"))


def test_a_unit_in_the_name_leaves_nothing_to_ask(tmp_path: Path) -> None:
    draft = draft_any([moteus(tmp_path / "a.csv", of="position_rad")], None, None)
    assert not not_sure(draft) & set(RESTING) and "channels.states.position" not in not_sure(draft)


def test_a_rate_of_another_units_position_is_told(tmp_path: Path) -> None:
    """Numbers of degrees beside rad/s were `derivative of the position`, for sure."""
    draft = draft_any([moteus(tmp_path / "a.csv", 180.0 / np.pi)], None, None)
    (guess,) = draft.of("channels.states.velocity")
    assert not guess.sure and "rad/s if the position is in deg" in guess.reason


def test_a_speed_alone_is_asked_with_its_position(tmp_path: Path) -> None:
    table = np.column_stack([TIME, RATE[:, 0]])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time,speed", comments="", fmt="%.7f")
    draft = draft_any([tmp_path / "a.csv"], None, None)
    assert "channels.states.velocity" in not_sure(draft)


def test_units_of_rates() -> None:
    fit = evidence.RateFit(1.0, 1.0)
    assert evidence.velocity_unit("rev", fit) == "rev/s"
    assert evidence.in_other_units("rad", fit).startswith("deg/s if the position is in deg, rev/s if in rev")
    assert evidence.in_other_units("rad", evidence.RateFit(0.1, 1.0)) == ""


def imported(folder: Path, command: str) -> tuple[ArmRecording, str]:
    moteus(folder / "a.csv")
    (folder / "m.yaml").write_text(f"""
joints: [a, b]
sources:
  log:
    file: a.csv
    time: {{column: timestamp, unit: s}}
    columns: {{a: id1 POSITION, b: id2 POSITION, c: id1 CONTROL_POSITION, d: id2 CONTROL_POSITION}}
channels:
  states:
    position: {{formula: [a, b], unit: rev}}
    velocity: derivative
  command:
    position: {{formula: [c, d], unit: {command}}}
recordings: [{{name: a}}]
""")
    mapping = parse_mapping((folder / "m.yaml").read_text(), folder / "m.yaml")
    made = import_recording(mapping.recordings[0], mapping, folder)
    return made.recording, "\n".join(made.notes)


@pytest.mark.parametrize(
    ("unit", "told"), [("rev", ""), ("rad", "command were in revolutions"), ("deg", "another unit")]
)
def test_a_command_in_another_unit_is_told(unit: str, told: str, tmp_path: Path) -> None:
    """A command in rev/s taken for rad/s passed without a word."""
    _, notes = imported(tmp_path, unit)
    assert ("the command of a is" in notes) == bool(told) and told in notes
