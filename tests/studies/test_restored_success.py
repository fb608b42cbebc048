"""Success that comes back: what a correction told by truth does, and the figures of a small made-up run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection, as_data
from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.instance.dominant import DOMINANT
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Frame
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.true_cell import true_cell
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.images.expected import still_recording
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.studies import restored_success
from samrl_core.studies.episodes.world_episodes import Condition, EpisodeJob
from samrl_core.studies.experiment import CaseLog, Options
from samrl_core.studies.restored_success import (
    DESCRIBED,
    DIAGNOSED,
    DOUBTING,
    FITTED,
    ROWS,
    TOLD,
    UNHARMED,
    CellJob,
    bench_of,
    correct_by_truth,
    draw_restored,
    restored,
    run,
)

CELL, TASK = cell_named(), task_named("peg_insertion")


@pytest.mark.parametrize("error", sorted(DOMINANT))
def test_what_truth_tells_brings_the_images_back(error: str) -> None:
    """Poses, or colour and depth: with the error and corrected, against those without it."""
    harmed = instance_named(f"typical:9 {error}=2", CELL)
    correction = correct_by_truth(error, harmed, CELL)
    assert isinstance(correction, CellCorrection) and not correction.is_empty
    corrected, true = correction.cell(CELL), true_cell(CELL, harmed)
    if error == "hand_eye":
        np.testing.assert_allclose(corrected.camera_in_flange.matrix(), true.camera_in_flange.matrix())
        return
    if error == "base_to_base":
        assert corrected.camera_base_in_world.angle_to(true.camera_base_in_world) < 1e-9
        np.testing.assert_allclose(
            corrected.camera_base_in_world.position, true.camera_base_in_world.position
        )
        return
    one = DOMINANT[error]
    group = getattr(harmed, one.group)
    without = {name: 0.0 * getattr(group, name) for name in one.sizes}
    unharmed = replace(harmed, **{one.group: replace(group, **without)})
    frames = []
    for instance in (harmed, unharmed):
        world = PyBulletWorld(TASK, CELL, instance=instance)
        try:
            world.reset(3)
            frames += [world.read_camera(), world.read_camera()]  # of one instant, each with its noise
        finally:
            world.close()
    seen, _, plain, again = frames
    mended = correction.frame(seen, CELL.intrinsics)
    before, after, noise = (_difference(f, plain) for f in (seen, mended, again))
    assert after - noise < 0.5 * (before - noise), (before, after, noise)


def _difference(frame: Frame, plain: Frame) -> float:
    """Mean of the differences of colour (levels), and of depth (tenths of a mm), where both lenses look."""
    inner = (slice(20, -20), slice(20, -20))
    color = np.abs(frame.color[inner].astype(float) - plain.color[inner]).mean()
    return float(color + 1e4 * np.nanmedian(np.abs(frame.depth - plain.depth)[inner]))


def _case(success: bool) -> dict[str, object]:
    return {"success": success}


def test_shares_of_a_loss(tmp_path: Path) -> None:
    """Two cells of two episodes: unharmed 4 of 4, described 0, fitted 1, diagnosed 2, told 3."""
    wins = {
        UNHARMED: (2, 2),
        DESCRIBED: (0, 0),
        DOUBTING: (0, 0),
        FITTED: (0, 1),
        DIAGNOSED: (2, 0),
        TOLD: (2, 1),
    }
    cells = [CellJob(f"k{n}", TASK.name, CELL.name, f"typical:{n} hand_eye=2", "hand_eye") for n in (1, 2)]
    found = [
        {
            "key": c.key,
            "verdict": v,
            "named": "hand_eye@sensor:camera",
        }
        for c, v in zip(cells, ("effect", "none_of_mine"), strict=True)
    ]
    jobs, cases = [], []
    for n, cell in enumerate(cells):
        for row, won in wins.items():
            instance = cell.instance.split()[0] if row == UNHARMED else cell.instance
            for k in range(2):
                jobs.append(EpisodeJob(f"{n}{row}{k}", TASK.name, row, Condition(), k, instance=instance))
                cases.append(_case(k < won[n]))
    out = restored(cells, found, jobs, cases)
    assert out["restored_diagnosed"]["value"] == pytest.approx(0.5)
    assert out["restored_told"]["value"] == pytest.approx(0.75)
    assert out["restored_fitted"]["value"] == pytest.approx(0.25)
    assert out["restored_doubting"]["value"] == 0.0
    assert out["rows"][UNHARMED]["successes"] == 4 and list(out["rows"]) == list(ROWS)
    assert [a[DIAGNOSED] for a in out["answers"]] == [2, 0]
    draw_restored(out, TASK.name, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    nothing_lost = restored(cells, found, jobs, [_case(True)] * len(jobs))
    assert nothing_lost["restored_told"]["value"] is None


def test_rows_for_development_and_for_a_final_table_are_kept_apart(tmp_path: Path) -> None:
    options = Options(tmp_path, tasks=("peg_insertion_hard",), conditions=(DESCRIBED, f"{TOLD}_test"))
    with pytest.raises(InputError, match="development and test"):
        run(options, lambda _: None)
    assert not (tmp_path / "cases.jsonl").exists()


@pytest.mark.parametrize(
    ("task", "bench"),
    [
        ("peg_insertion_hard", "peg_insertion"),
        ("spatula_flipping_hard", "spatula_flipping"),
        ("needle_threading_hard", "peg_insertion"),
    ],
)
def test_a_cell_is_diagnosed_on_a_bench_that_images_can_be_compared_of(task: str, bench: str) -> None:
    of = bench_of(task, CELL)
    assert of.name == bench
    still = still_recording(of.name, CELL.name, of.start_joints(CELL))
    ImageScene(still, CELL.intrinsics)  # refuses what it cannot compare


def test_a_run_that_time_ends_has_whole_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Diagnosis and rows of one cell come before the next cell's; first episodes before any second one."""
    came: list[str] = []

    def keep(log: CaseLog, cases: list[dict[str, object]]) -> list[dict[str, object]]:
        for case in cases:
            if case["key"] not in log.cases:
                came.append(str(case["key"]))
                log.keep(case)
        return cases

    def examine(log: CaseLog, _: object, work: list[tuple[tuple[str], CellJob]], *__: object) -> object:
        said = {"verdict": "no_gap", DIAGNOSED: as_data(NO_CORRECTION)}
        told = as_data(CellCorrection(numbers={"depth_scale": 0.01}))
        return keep(log, [{"key": key, TOLD: told, **said} for (key,), _ in work])

    def drive(log: CaseLog, jobs: list[EpisodeJob], *_: object) -> object:
        return keep(log, [{"key": job.key, **_case(DESCRIBED not in job.key)} for job in jobs])

    monkeypatch.setattr(restored_success, "run_cases", examine)
    monkeypatch.setattr(restored_success, "run_episodes", drive)
    options = Options(tmp_path, tasks=("peg_insertion_hard",), count=2, workers=1)
    rows = (UNHARMED, DESCRIBED, DIAGNOSED, TOLD)
    summary = run(replace(options, conditions=rows), lambda _: None)["tasks"]["peg_insertion_hard"]
    ways = [f"typical:{cell}/{k}" for k in (0, 1) for cell in (400, 401)]
    places = [next(n for n, key in enumerate(came) if way in key) for way in ways]
    assert places == sorted(places) and came[0].endswith("cell/400") and came[4].endswith("cell/401")
    assert {row: share["successes"] for row, share in summary["rows"].items()} == {
        UNHARMED: 4, DESCRIBED: 0, DIAGNOSED: 0, TOLD: 4,
    }  # fmt: skip
