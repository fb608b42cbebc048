"""Data of inverse dynamics are published as one matrix, such as SARCOS' of 28 columns: no names, no clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft

TIME = np.arange(800) / 200.0
RATES, PHASES = np.array([1.1, 1.9, 2.7]), np.array([0.2, 1.1, 2.3])
Q = np.sin(TIME[:, None] * RATES + PHASES)
DQ, DDQ = RATES * np.cos(TIME[:, None] * RATES + PHASES), -(RATES**2) * Q
TAU = np.cos(TIME[:, None] * np.array([0.7, 3.1, 1.5])) + 0.4 * DDQ[:, [1, 2, 0]]
LINK = (
    '<link name="l{0}"/><joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/>'
    '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
)
URDF = f'<robot name="r"><link name="l0"/>{"".join(LINK.format(k + 1, k) for k in range(3))}</robot>'


def draft_of(path: Path, urdf: str | None = URDF) -> Draft:
    return draft_any([path], urdf, None if urdf is None else "arm.urdf")


def columns(name: str, first: int) -> list[str]:
    return [f"{name}[{first + k}]" for k in range(3)]


def test_a_matrix_is_cut_by_what_is_whose_derivative(tmp_path: Path) -> None:
    """It was refused, as one column with nothing beside it."""
    savemat(tmp_path / "arm.mat", {"sarcos": np.column_stack([Q, DQ, DDQ, TAU])})
    draft = draft_of(tmp_path / "arm.mat")
    states = draft.channels["states"]
    assert states["position"]["formula"] == columns("sarcos", 0)
    assert states["velocity"] == {"formula": columns("sarcos", 3), "unit": "rad/s"}
    assert draft.channels["commanded_effort"]["effort"]["formula"] == columns("sarcos", 9)
    assert draft.sources["states"]["columns"] == {"sarcos": "sarcos"}
    assert draft.sources["states"]["time"] == {"rate_hz": 200.0}
    asked = "\n".join(draft.questions)
    assert "sarcos[6:9]: acceleration, sarcos[9:12]: effort" in asked and "is the rate 200 Hz?" in asked


def test_a_table_without_names_begins_with_its_clock(tmp_path: Path) -> None:
    table = np.column_stack([TIME, TAU, Q, Q + 1e-3 * DQ, DQ])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", fmt="%.6f")
    draft = draft_of(tmp_path / "log.csv")
    source = draft.sources["states"]
    assert source["time"]["column"] == "0"
    position = draft.channels["states"]["position"]["formula"]
    assert [source["columns"][key] for key in position] == ["4", "5", "6"]
    effort = draft.channels["commanded_effort"]["effort"]["formula"]
    assert [source["columns"][key] for key in effort] == ["1", "2", "3"]
    assert any("columns[7:10]: left out" in question for question in draft.questions)


def test_two_groups_that_may_be_torques_are_both_left_out(tmp_path: Path) -> None:
    savemat(tmp_path / "arm.mat", {"data": np.column_stack([Q, DQ, TAU, TAU[:, ::-1] - 0.3])})
    draft = draft_of(tmp_path / "arm.mat")
    assert draft.channels["states"]["position"]["formula"] == columns("data", 0)
    assert "commanded_effort" not in draft.channels and "effort" not in draft.channels["states"]


@pytest.mark.parametrize("groups", [(Q, TAU), (TAU, Q[::-1], np.abs(Q))])
def test_a_matrix_of_which_nothing_is_a_derivative_is_refused(tmp_path: Path, groups: tuple) -> None:
    savemat(tmp_path / "arm.mat", {"data": np.column_stack(groups)})
    with pytest.raises(InputError):
        draft_of(tmp_path / "arm.mat")


def test_without_a_description_nobody_knows_how_many_joints(tmp_path: Path) -> None:
    savemat(tmp_path / "arm.mat", {"data": np.column_stack([Q, DQ, TAU])})
    with pytest.raises(InputError):
        draft_of(tmp_path / "arm.mat", None)
