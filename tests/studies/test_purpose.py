"""A folder of results keeps its purpose, and a final table its code."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_core.common.statistics import Share
from samrl_core.common.streams import DEVELOPMENT, TEST
from samrl_core.studies import cell_instances, purpose
from samrl_core.studies.cell_instances import EXPERIMENT
from samrl_core.studies.experiment import RUNS, Options
from samrl_core.studies.purpose import PURPOSE, code_digest, keep_purpose, one_purpose


def test_a_final_table_is_not_gone_on_with_by_other_code(tmp_path: Path, monkeypatch) -> None:
    keep_purpose(tmp_path, TEST)
    keep_purpose(tmp_path, TEST)
    assert json.loads((tmp_path / PURPOSE).read_text())["code"] == code_digest()
    monkeypatch.setattr(purpose, "code_digest", lambda: "other")
    with pytest.raises(InputError, match="code .*asked for: 'other'"):
        keep_purpose(tmp_path, TEST)


def test_development_goes_on_with_any_code_but_never_becomes_a_test(tmp_path: Path, monkeypatch) -> None:
    keep_purpose(tmp_path, DEVELOPMENT)
    monkeypatch.setattr(purpose, "code_digest", lambda: "other")
    keep_purpose(tmp_path, DEVELOPMENT)
    with pytest.raises(InputError, match="holds another evaluation"):
        keep_purpose(tmp_path, TEST)


def test_two_purposes_do_not_run_together(tmp_path: Path) -> None:
    assert one_purpose([TEST, TEST]) == TEST
    options = Options(tmp_path, conditions=("typical", "typical_test"))
    with pytest.raises(InputError, match="development and test; run those for a final table"):
        EXPERIMENT.result(options, print)
    assert not (tmp_path / PURPOSE).exists()


def test_a_run_says_when_it_ran_and_beside_what(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(cell_instances, "run_episodes", lambda log, jobs, workers, tell: [])
    monkeypatch.setattr(cell_instances, "rates", lambda cases: Share.of([True]).as_dict())
    for _ in range(2):
        EXPERIMENT.result(Options(tmp_path, conditions=("typical_script",), count=1), print)
    runs = [json.loads(line) for line in (tmp_path / RUNS).read_text().splitlines()]
    assert len(runs) == 2 and runs[0]["conditions"] == ["typical_script"]
    assert runs[0]["began"].endswith("+00:00") and runs[1]["wall_s"] >= 0.0 and runs[0]["load_before"] >= 0.0
