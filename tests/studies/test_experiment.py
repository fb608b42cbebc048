"""What every experiment shares: cases that are kept, folders that are checked."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from samrl_core.cell.robots.cells import DEFAULT_CELL
from samrl_core.common.errors import InputError
from samrl_core.studies.experiment import CASES, CONFIG, Case, CaseLog, Experiment, Options, run_cases
from samrl_core.studies.registry import MODULES, experiment_named

RUN: list[int] = []


def double(number: int) -> list[Case]:
    RUN.append(number)
    return [{"key": f"n{number}", "twice": 2 * number}]


def doubles(options: Options, tell: Any) -> dict[str, Any]:
    jobs = [((f"n{k}",), k) for k in range(options.count or 3)]
    cases = run_cases(CaseLog(options.out), double, jobs, 1, tell)
    return {"sum": sum(case["twice"] for case in cases)}


EXPERIMENT = Experiment("doubles", "twice a number", ("peg_insertion",), doubles)


def test_a_run_goes_on_with_the_cases_that_are_missing(tmp_path: Path) -> None:
    RUN.clear()
    first = EXPERIMENT.result(Options(tmp_path), print)
    lines = (tmp_path / CASES).read_text().splitlines(keepends=True)
    (tmp_path / CASES).write_text(lines[0] + lines[1][:7])  # cut off while it was written
    again = EXPERIMENT.result(Options(tmp_path), print)
    assert first == again and first["sum"] == 6
    assert RUN == [0, 1, 2, 1, 2]
    assert (tmp_path / CASES).read_text() == "".join(lines)


def test_a_damaged_line_is_refused(tmp_path: Path) -> None:
    EXPERIMENT.result(Options(tmp_path), print)
    (tmp_path / CASES).write_text("no case\n")
    with pytest.raises(InputError, match="line 1"):
        CaseLog(tmp_path)


def test_a_folder_of_other_options_is_refused(tmp_path: Path) -> None:
    EXPERIMENT.result(Options(tmp_path), print)
    with pytest.raises(InputError, match="count 0 .asked for: 2."):
        EXPERIMENT.result(Options(tmp_path, count=2), print)
    EXPERIMENT.result(Options(tmp_path, workers=2), print)  # where it runs may differ
    written = json.loads((tmp_path / CONFIG).read_text())
    assert written.pop("cell") == DEFAULT_CELL
    (tmp_path / CONFIG).write_text(json.dumps(written))  # as folders were before cells had names
    EXPERIMENT.result(Options(tmp_path), print)
    replace(EXPERIMENT, conditions=("a",)).result(Options(tmp_path, conditions=("a",)), print)  # and how much


def test_what_is_not_there_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cuda:99"):
        Options(tmp_path, device="cuda:99")
    with pytest.raises(InputError, match="no cell is named 'kitchen'"):
        Options(tmp_path, cell="kitchen")
    with pytest.raises(InputError, match="no folder of networks"):
        Options(tmp_path, weights=tmp_path / "none")
    assert not list(tmp_path.iterdir())


def test_unknown_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="knows no task 'juggling'; there are: peg_insertion"):
        EXPERIMENT.result(Options(tmp_path, tasks=("juggling",)), print)
    with pytest.raises(InputError, match="knows no condition 'active'; there are: none to choose from"):
        EXPERIMENT.result(Options(tmp_path, conditions=("active",)), print)
    two = replace(EXPERIMENT, conditions=("a", "b"))
    with pytest.raises(InputError, match="knows no condition 'c'; there are: a, b"):
        two.result(Options(tmp_path, conditions=("a", "c")), print)
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="no experiment is named 'table9'"):
        experiment_named("table9")


@pytest.mark.parametrize("name", sorted(MODULES))
def test_every_name_leads_to_its_experiment(name: str) -> None:
    assert experiment_named(name).name == name
