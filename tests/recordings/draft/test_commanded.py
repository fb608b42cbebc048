"""A command beside its position: its own unit, its velocity, and the zero of a servo's counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft

TIME = np.arange(0.0, 8.0, 0.002)
TARGET = 0.4 + 0.2 * np.sin(2.0 * TIME)  # [m] or [rad]
RATE = 0.4 * np.cos(2.0 * TIME)
POSITION = 0.4 + 0.2 * np.sin(2.0 * (TIME - 0.01))


def drafted(folder: Path, columns: dict[str, np.ndarray]) -> Draft:
    path, values = folder / "axis.csv", np.column_stack(list(columns.values()))
    np.savetxt(path, values, "%.9g", ",", header=",".join(columns), comments="")
    return draft_any([path], None, None)


def test_a_command_in_mm_is_none_in_counts(tmp_path: Path) -> None:
    """It had the unit of the measured counts, and no question said so."""
    columns = {
        "time_ms": 1e3 * TIME, "cmd_mm": 1e3 * TARGET, "cmd_mm_s": 1e3 * RATE,
        "enc_counts": np.round(250e3 * POSITION),
    }  # fmt: skip
    draft = drafted(tmp_path, columns)
    command = draft.channels["command"]
    assert command["position"] == {"formula": ["cmd_mm_1"], "unit": "mm"}
    assert command["velocity"] == {"formula": ["cmd_mm_s_1"], "unit": "mm/s"}
    assert any("which one is zero" in question.lower() for question in draft.questions)


@pytest.mark.parametrize(
    ("position", "command", "rate", "factor", "unit"),
    [
        ("actual_q_0", "target_q_0", "target_qd_0", 1.0, "rad/s"),
        ("q", "q_ref", "dq_ref", 1.0, "rad/s"),
        ("angle", "cmd", "cmd_rate", 1.0, "rad/s"),
        ("pos_deg", "cmd_deg", "cmd_vel_deg_s", 180.0 / np.pi, "deg/s"),
    ],
)
def test_a_commanded_velocity_that_integrates_to_its_position_is_used(
    tmp_path: Path, position: str, command: str, rate: str, factor: float, unit: str
) -> None:
    columns = {"time": TIME, position: factor * POSITION, command: factor * TARGET, rate: factor * RATE}
    draft = drafted(tmp_path, columns)
    assert draft.channels["command"]["velocity"]["unit"] == unit
    assert list(draft.sources["states"]["columns"].values())[-1] == rate


def test_a_rate_of_another_motion_is_no_velocity_of_the_command(tmp_path: Path) -> None:
    columns = {"time": TIME, "q": POSITION, "q_ref": TARGET, "dq_ref": np.cos(5.0 * TIME)}
    draft = drafted(tmp_path, columns)
    assert "velocity" not in draft.channels["command"]
    assert any(line.endswith("dq_ref") for line in draft.unused)


def test_a_measured_rate_is_the_velocity(tmp_path: Path) -> None:
    """A draft said that none was recorded."""
    rate = 0.4 * np.cos(2.0 * (TIME - 0.01))
    draft = drafted(tmp_path, {"time": TIME, "angle": POSITION, "rate": rate, "cmd": TARGET})
    assert draft.channels["states"]["velocity"] == {"formula": ["rate_1"], "unit": "rad/s"}


def test_a_command_that_moves_much_farther_is_asked_for(tmp_path: Path) -> None:
    draft = drafted(tmp_path, {"time": TIME, "q_rad": POSITION, "q_ref": np.degrees(TARGET)})
    assert any("moves 57.3 times as far" in question.lower() for question in draft.questions)
    right = drafted(tmp_path, {"time": TIME, "q_rad": POSITION, "q_ref": TARGET})
    assert not any("times as far" in question for question in right.questions)


def test_a_servos_counts_are_asked_for_their_zero(tmp_path: Path) -> None:
    """2048 is the middle of most servos: a joint 180 degrees away was drafted without a word."""
    goal, present = (2048 + np.round(1000 * (x - 0.4)) for x in (TARGET, POSITION))
    draft = drafted(tmp_path, {"t": TIME, "goal_position": goal, "present_position": present})
    assert any("Is zero at 0" in question for question in draft.questions)
