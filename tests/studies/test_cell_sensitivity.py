"""The experiment over the size of one group of differences: which cells, which episodes, and its picture."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.cell.instance.cell_instance import GROUPS
from samrl_core.studies.cell_sensitivity import (
    DEFAULT,
    EXPERIMENT,
    FIRST_CELL,
    POINTS,
    TYPICAL,
    WHAT,
    draw_sensitivity,
    job_of,
)
from samrl_core.studies.experiment import Options
from samrl_core.studies.registry import experiment_named

OPTIONS = Options(Path("out"))


def test_it_is_registered_and_has_every_group_at_every_scale() -> None:
    assert experiment_named("cell_sensitivity") is EXPERIMENT
    assert set(WHAT) == set(GROUPS), "every group is told what it holds"
    for group in GROUPS:
        assert sorted(scale for one, scale in POINTS.values() if one == group) == [0.5, 2.0, 4.0]


def test_points_differ_by_the_scale_of_one_group_alone() -> None:
    jobs = [job_of(OPTIONS, DEFAULT, point, 3) for point in POINTS]
    assert len({job.seed for job in jobs}) == 1 and len({job.condition for job in jobs}) == 1
    assert len({job.key for job in jobs}) == len(POINTS)
    assert {job.instance.split()[0] for job in jobs} == {f"typical:{FIRST_CELL + 3}"}
    assert job_of(OPTIONS, DEFAULT, "grip_x4", 3).instance.endswith(" grip=4")
    assert job_of(OPTIONS, DEFAULT, TYPICAL, 3).instance == f"typical:{FIRST_CELL + 3}"


@pytest.mark.parametrize(
    ("task", "touch", "policy"),
    [(DEFAULT, True, "optimised"), ("peg_insertion", False, "learned")],
)
def test_who_acts_is_who_a_run_has(task: str, touch: bool, policy: str) -> None:
    condition = job_of(OPTIONS, task, TYPICAL, 0).condition
    assert (condition.touch, condition.policy) == (touch, policy)


def test_a_picture_is_drawn_of_what_there_is(tmp_path: Path) -> None:
    row = {"value": 0.75, "ci95": (0.3, 0.95), "trials": 4}
    some = {name: row for name in POINTS if not name.endswith("_x0.5")}
    draw_sensitivity(DEFAULT, some, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
