"""A log without names and units beside a URDF: what limits and torques settle, and what stays a question."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_ros.cli.main import run
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping

COUNT = 7
HOME = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.7, 0.7])


def moved(seed: int = 3, rate_hz: float = 50.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (N,) [s], positions (N, 7) [rad] and torques (N, 7) [N m], with friction."""
    rng = np.random.default_rng(seed)
    model = pinocchio.buildModelFromXML(PANDA.urdf.read_text())
    data = model.createData()
    time = np.arange(0.0, 40.0, 1.0 / rate_hz)
    speed, phase = 2 * np.pi * rng.uniform(0.05, 0.35, (COUNT, 3)), rng.uniform(0, 2 * np.pi, (COUNT, 3))
    angle = time[:, None, None] * speed + phase
    q = HOME + 0.15 * np.sin(angle).sum(axis=2)
    dq, ddq = 0.15 * (speed * np.cos(angle)).sum(axis=2), -0.15 * (speed**2 * np.sin(angle)).sum(axis=2)
    tau = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])
    tau += 1.5 * np.tanh(dq / 0.01) + 0.1 * rng.standard_normal(tau.shape)
    return time, q + 2e-5 * rng.standard_normal(q.shape), tau


TIME, POSITION, TORQUE = moved()


def draft_of(path: Path, position: np.ndarray, torque: np.ndarray) -> Draft:
    names = ["time", *(f"q{k}" for k in range(COUNT)), *(f"tau{k}" for k in range(COUNT))]
    rows = np.column_stack([TIME, position, torque])
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    return draft_mapping([path], PANDA.urdf.read_text(), str(PANDA.urdf), Effort.drive)


@pytest.mark.parametrize(("unit", "factor"), [("rad", 1.0), ("deg", 180 / np.pi)])
def test_a_log_that_follows_its_model_needs_no_answers(tmp_path: Path, unit: str, factor: float) -> None:
    draft = draft_of(tmp_path / "a.csv", factor * POSITION, TORQUE)
    assert not draft.questions
    assert draft.channels["states"]["position"]["unit"] == unit
    (order,) = draft.of("joints")
    assert "do not with any two joints exchanged" in order.reason


@pytest.mark.parametrize("pair", [(1, 3), (5, 6), (2, 4)])
def test_exchanged_joints_are_asked_for(tmp_path: Path, pair: tuple[int, int]) -> None:
    order = list(range(COUNT))
    a, b = pair
    order[a], order[b] = order[b], order[a]
    draft = draft_of(tmp_path / "a.csv", POSITION[:, order], TORQUE[:, order])
    assert any(q.startswith("joints:") for q in draft.questions)


def test_other_units_of_torque_are_asked_for(tmp_path: Path) -> None:
    draft = draft_of(tmp_path / "a.csv", POSITION, TORQUE / 12.0)
    assert any("in N m?" in q for q in draft.questions)
    (order,) = draft.of("joints")
    assert "do not follow the URDF's" in order.reason


def test_without_torques_limits_settle_degrees_and_nothing_else(tmp_path: Path) -> None:
    rows = np.column_stack([TIME, np.degrees(POSITION)])
    path = tmp_path / "a.csv"
    names = ",".join(["time", *(f"q{k}" for k in range(COUNT))])
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.6f")
    draft = draft_mapping([path], PANDA.urdf.read_text(), str(PANDA.urdf), Effort.none)
    (question,) = draft.questions
    assert question.startswith("joints:")


def test_a_refusal_names_the_draft_with_its_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    draft_of(tmp_path / "a.csv", POSITION, TORQUE / 12.0)
    arguments = [str(tmp_path / "a.csv"), "--urdf", str(PANDA.urdf), "--effort", "drive"]
    assert run(["diagnose", *arguments, "--out", str(tmp_path / "report")]) == 3
    told = " ".join(capsys.readouterr().err.split())
    assert f"samrl bag draft {' '.join(arguments)} --out mapping.yaml" in told
    assert "samrl diagnose --mapping mapping.yaml" in told
