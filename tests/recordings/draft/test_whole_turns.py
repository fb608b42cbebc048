"""Angles that wrap around: a jump by a turn is no motion, in a draft and in a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings.turns import find_wraps
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping

TIME = np.arange(0.0, 12.0, 0.02)
ANGLE = 40.0 * np.sin(3.0 * TIME) * np.exp(-0.1 * TIME) + 3.0 * TIME  # [deg] about 0, as encoders of 360 show


def _draft(path: Path, columns: dict[str, np.ndarray]) -> Draft:
    lines = [
        ",".join(columns),
        *(",".join(f"{x:.4f}" for x in row) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(lines) + "\n")
    return draft_mapping([path], None, None, Effort.passive)


def _imported(draft: Draft, folder: Path) -> ArmRecording:
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    mapping = parse_mapping(yaml.safe_dump(content), folder / "mapping.yaml")
    return import_recording(mapping.recordings[0], mapping, folder).recording


def test_an_angle_of_0_to_360_is_drafted_without_its_jumps(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.csv"
    draft = _draft(path, {"time_s": TIME, "angle_deg": ANGLE % 360.0})
    assert draft.channels["states"]["position"]["formula"] == ["unwrap(angle_deg_1, 360)"]
    position = _imported(draft, tmp_path).states.position
    assert position is not None
    np.testing.assert_allclose(position[:, 0], np.radians(ANGLE), atol=1e-5)


def test_counts_wrap_at_the_encoders_turn(tmp_path: Path) -> None:
    counts = np.round(ANGLE / 360.0 * 4096) % 4096
    draft = _draft(tmp_path / "arm.csv", {"time_s": TIME, "encoder": counts})
    assert draft.channels["states"]["position"]["formula"] == ["unwrap(encoder_1, 4096)"]


def test_a_command_that_begins_a_turn_away_is_no_error_of_a_turn(tmp_path: Path) -> None:
    path = tmp_path / "servo.csv"
    target = (ANGLE + 2.0) % 360.0  # begins at 2, the position at 359
    draft = _draft(path, {"time_s": TIME, "target_deg": target, "actual_deg": (ANGLE - 1.0) % 360.0})
    recording = _imported(draft, tmp_path)
    assert recording.command is not None and recording.states.position is not None
    assert recording.command.position is not None
    away = recording.command.position - recording.states.position
    np.testing.assert_allclose(away, np.radians(3.0), atol=1e-5)


@pytest.mark.parametrize(
    "angles",
    [
        np.where(np.sin(TIME) > 0.0, 135.0, -135.0),  # steps to and fro
        ANGLE,
        (3000.0 * TIME) % 360.0,  # a sixth of a turn per sample: it wraps too often to be followed
        np.where(TIME < 6.0, 0.0, 200.0),
    ],
)
def test_what_does_not_wrap_is_left_alone(angles: np.ndarray) -> None:
    assert not len(find_wraps(angles, 360.0))


def test_a_recording_that_wraps_is_refused_with_the_remedy(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.csv"
    draft = _draft(path, {"time_s": TIME, "angle_deg": ANGLE % 360.0})
    draft.channels["states"]["position"]["formula"] = ["angle_deg_1"]  # as written by hand
    with pytest.raises(InputError, match=r"joint_1 goes from .* wraps around.*unwrap\(x, 360\) of degrees"):
        _imported(draft, tmp_path)


@pytest.mark.parametrize(("turn", "unit"), [(360.0, "deg"), (2 * np.pi, "rad")])
def test_steps_of_an_encoder_tell_degrees_however_small_the_swing(
    tmp_path: Path, turn: float, unit: str
) -> None:
    swing = 10.0 * np.exp(-0.2 * TIME) * np.sin(11.0 * TIME) - 1.0  # counts of 2048 a turn, under 2 degrees
    path = tmp_path / "free.csv"
    rows = [f"{t:.3f},{round(x) * turn / 2048:.6g}" for t, x in zip(TIME, swing, strict=True)]
    path.write_text("\n".join(['"Time","angle"', *rows]) + "\n")
    draft = draft_mapping([path], None, None, Effort.passive)
    assert draft.channels["states"]["position"]["unit"] == unit
    (question,) = draft.questions  # it is asked all the same
    assert "is the unit" in question


LINK = """<link name="{0}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 1 0"/>{4}</joint>'
LIMIT = '<limit lower="-1.5" upper="1.5" effort="9" velocity="9"/>'
ARM = "".join([
    '<robot name="arm">', *(LINK.format(name) for name in ("base", "a", "b", "c")),
    JOINT.format("bends", "revolute", "base", "a", LIMIT), JOINT.format("rests", "revolute", "a", "b", LIMIT),
    JOINT.format("turns", "continuous", "b", "c", '<limit effort="9" velocity="9"/>'), "</robot>",
])  # fmt: skip


def test_350_degrees_are_10_less_than_none_by_the_urdfs_limits(tmp_path: Path) -> None:
    rests = -10.0 + 5.0 * np.sin(TIME)  # no jump: always between 345 and 355
    columns = {"bends": ANGLE - 20.0, "rests": rests, "turns": 200.0 + rests}
    path = tmp_path / "arm.csv"
    named = {f"{name}_pos_deg": angles % 360.0 for name, angles in columns.items()}
    named |= {f"{name}_target_deg": (angles + 1.0) % 360.0 for name, angles in columns.items()}
    table = np.column_stack([TIME, *named.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(["time_s", *named]), comments="", fmt="%.4f")
    (tmp_path / "arm.urdf").write_text(ARM)
    draft = draft_mapping([path], ARM, "arm.urdf", Effort.none)
    assert not draft.questions
    recording = _imported(draft, tmp_path)
    assert recording.command is not None
    for signal, offset in ((recording.states, 0.0), (recording.command, 1.0)):
        assert signal.position is not None
        expected = np.radians(np.column_stack([angles + offset for angles in columns.values()]))
        np.testing.assert_allclose(signal.position, expected, atol=1e-4)


def test_each_recording_begins_within_its_limits(tmp_path: Path) -> None:
    """A VESC's encoder began at 359.98 degrees, then at 0.02: `- 360` of the first was `sure` for both.

    Its supply's voltage passed for the motor's.
    """
    wave = 40.0 * np.sin(2.0 * TIME)
    volts = {"input_voltage": 36.0 + 0.1 * np.sin(9.0 * TIME), "duty_cycle": 0.2 * np.cos(2.0 * TIME)}
    for name, begin in (("run1", -0.02), ("run2", 0.02)):
        table = np.column_stack([TIME, (wave + begin) % 360.0, *volts.values()])
        head = ",".join(["time_s", "encoder_position", *volts])
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=head, comments="", fmt="%.4f")
    swing = JOINT.format("bends", "revolute", "base", "a", LIMIT)
    urdf = "".join(['<robot name="p">', LINK.format("base"), LINK.format("a"), swing, "</robot>"])
    (tmp_path / "p.urdf").write_text(urdf)
    draft = draft_mapping(sorted(tmp_path.glob("*.csv")), urdf, "p.urdf", Effort.ask)
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    mapping = parse_mapping(yaml.safe_dump(content), tmp_path / "mapping.yaml")
    for about, begin in zip(mapping.recordings, (-0.02, 0.02), strict=True):
        recording = import_recording(about, mapping, tmp_path).recording
        assert recording.states.position is not None
        np.testing.assert_allclose(recording.states.position[:, 0], np.radians(wave + begin), atol=1e-4)
    assert draft.channels["commanded_effort"]["effort"]["formula"] == ["12.0 / 1 * duty_cycle_1"]
    assert any("how many volts" in question for question in draft.questions)
