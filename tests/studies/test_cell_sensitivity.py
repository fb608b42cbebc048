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
    points_of,
    ranked,
)
from samrl_core.studies.episodes.stopwatch import GROUPS as CPU
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
    for number, points in enumerate((some, {"grip_x4": row})):  # eight groups of the second have no point
        draw_sensitivity(DEFAULT, points, tmp_path / f"{number}.png")
        assert (tmp_path / f"{number}.png").read_bytes().startswith(b"\x89PNG")


def _against(lost: float, p: float) -> dict[str, object]:
    row = {"value": 0.9 - lost, "ci95": (0.0, 1.0), "trials": 20}
    return {**row, "against_typical": {"gain": -lost, "p_less_often": p}}


def test_the_costliest_group_comes_first_and_chance_is_shared_among_the_groups() -> None:
    points = {
        TYPICAL: {"value": 0.9, "ci95": (0.7, 1.0), "trials": 20},
        "depth_x4": _against(0.05, 0.5),
        "grip_x4": _against(0.6, 0.001),
        "grip_x2": _against(0.1, 0.2),
        "optics_x4": _against(0.2, 0.03),  # below 0.05, but one of three groups
    }
    order = ranked(points)
    assert [group for group, *_ in order[:3]] == ["grip", "optics", "depth"]
    assert [matters for _, _, matters in order[:3]] == [True, False, False]
    assert order[0][1] == pytest.approx(0.6)
    assert {group for group, *_ in order} == set(GROUPS)


def test_a_size_below_typical_is_no_loss() -> None:
    assert not any(matters for _, _, matters in ranked({"grip_x0.5": _against(0.9, 1e-6)}))


def test_points_are_compared_with_the_typical_one_in_pairs() -> None:
    case = {
        "believed": True, "why": "", "actions": 20, "camera_moves": 0, "simulated_s": 2.0,
        "final_error": 0.001, "cpu_s": dict.fromkeys(CPU, 0.1), "wall_s": dict.fromkeys(CPU, 0.1),
    }  # fmt: skip
    cases = [
        {**case, "condition": name, "seed": seed, "success": name == TYPICAL or seed > 6}
        for name in (TYPICAL, "grip_x4")
        for seed in range(10)
    ]
    points = points_of(cases, (TYPICAL, "grip_x4"))
    assert points["grip_x4"]["against_typical"]["gain"] == pytest.approx(-0.7)
    assert ranked(points)[0] == ("grip", pytest.approx(0.7), True)  # seven of seven pairs, p = 0.008
    assert "against_typical" not in points[TYPICAL]
