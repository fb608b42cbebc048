"""The study of model updating: one short case, what is kept when it is stopped, its figures."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.studies.model import model_updating
from samrl_core.studies.model.model_updating import STUDIES, UpdateCase, main, read_cases, summary
from samrl_core.studies.model.model_updating_picture import padded

CASE = UpdateCase("thread", 0, [0.01, 0.004, 0.001], 0.0008, [], 1.0, 2, "converged", 1, 1, 0.001, 0, 2, 1, 1)


def test_one_case_is_run_written_and_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The pancake from centimetres off, few iterations; the second call only reads."""
    study = next(s for s in STUDIES if s.name == "pancake")
    monkeypatch.setattr(model_updating, "STUDIES", (replace(study, iterations=16),))
    arguments = ["--cases", "1", "--out", str(tmp_path)]
    assert main(arguments) == 0
    record = json.loads((tmp_path / "model_updating.json").read_text())
    (case,) = record["cases"]
    assert case["iterations"] <= 16 and case["distance"][-1] < 0.2 * case["distance"][0]
    assert len(case["angle"]) == len(case["distance"])
    assert record["summary"]["pancake"]["end_l1_mm"] == pytest.approx(1e3 * case["distance"][-1])
    assert (tmp_path / "model_updating.png").stat().st_size > 10_000
    capsys.readouterr()
    monkeypatch.setattr(model_updating, "UpdatingSetup", None)
    assert main(arguments) == 0
    assert "1/1" not in capsys.readouterr().out
    assert json.loads((tmp_path / "model_updating.json").read_text()) == record


def test_a_line_that_was_cut_off_is_run_again_and_a_foreign_one_refused(tmp_path: Path) -> None:
    """What a kill leaves behind, and a file of something else."""
    path = tmp_path / "cases.jsonl"
    whole = json.dumps(asdict(CASE))
    path.write_text(whole + "\n" + whole[:40])
    assert [c.seed for c in read_cases(path)] == [0]
    path.write_text('{"other": 1}\n' + whole + "\n")
    with pytest.raises(InputError, match="another --out"):
        read_cases(path)
    assert read_cases(tmp_path / "none") == []


def test_figures_and_curves() -> None:
    """Medians in millimetres; a fit that stopped stays where it is."""
    cases = [replace(CASE, seed=k, distance=[0.01, 1e-3 * (k + 1)]) for k in range(3)]
    figures = summary(cases)
    assert figures["start_l1_mm"] == pytest.approx(10.0) and figures["end_l1_mm"] == pytest.approx(2.0)
    assert figures["end_l1_mm_max"] == pytest.approx(3.0) and "end_deg" not in figures
    lines = padded([[5.0, 4.0], [9.0, 8.0, 7.0, 6.0, 5.0]], 4)
    np.testing.assert_array_equal(lines, [[5, 4, 4, 4], [9, 8, 7, 5]])


def test_refuses_no_cases(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--cases"):
        main(["--cases", "0", "--out", str(tmp_path)])
