"""Sealed worlds of a camera: the plan, and labels that say in the effect's parameters what the cell is."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.blind_test.camera_worlds.forge_plan import CameraForgeSettings, CameraItem, plan_cameras
from samrl_core.blind_test.camera_worlds.label import label_of
from samrl_core.blind_test.camera_worlds.plan import CAUSES, ON_REQUEST, OUTSIDE, CameraWorld, instance_of
from samrl_core.blind_test.scores.outcome import SealedTruth
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.true_cell import true_cell
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import IMAGE_EFFECTS


def test_a_plan_follows_from_its_seed_and_holds_every_cause_once() -> None:
    settings = CameraForgeSettings(seed=7)
    plan = plan_cameras(settings)
    assert plan == plan_cameras(settings) != plan_cameras(replace(settings, seed=8))
    causes = [i.world.cause for i in plan if i.set != "none"]
    assert sorted(causes) == sorted(set(CAUSES) - set(ON_REQUEST)) and len(plan) == 21
    assert {i.world.cause for i in plan if i.set == "outside"} == set(OUTSIDE)
    assert len({i.world.seed for i in plan}) == len(plan)
    # Cells that nobody developed on.
    cell = cell_named(DEFAULT_CELL)
    assert all(instance_of(i.world, cell)[0].name.purpose == "test" for i in plan[:3])


def test_a_plan_goes_round_the_causes_that_are_asked_for() -> None:
    plan = plan_cameras(CameraForgeSettings(seed=3, single=5, none=2, outside=0, causes=("lamp", "exposure")))
    counts = [sum(i.world.cause == c for i in plan) for c in ("lamp", "exposure", "")]
    assert sorted(counts[:2]) == [2, 3] and counts[2] == 2 and len(plan) == 7


@pytest.mark.parametrize(
    "wrong",
    [
        {"causes": ("gremlin",)},
        {"causes": ("grip",)},
        {"single": -1},
        {"single": 0, "none": 0, "outside": 0},
        {"duration_s": 2.0},
    ],
)
def test_impossible_plans_are_refused(wrong: dict) -> None:
    with pytest.raises(InputError):
        CameraForgeSettings(**wrong)


@pytest.mark.parametrize("cause", list(CAUSES))
def test_a_label_has_the_parameters_that_a_report_would_have(cause: str) -> None:
    cell = cell_named(DEFAULT_CELL)
    kind = "outside" if cause in OUTSIDE else "single"
    item = CameraItem("c000", kind, CameraWorld("c000", 3, "typical:test", cause, 1.0), 6.0)
    label = json.loads(json.dumps(label_of(item, cell)))
    truth = SealedTruth.from_label(label)
    assert truth.set == kind and truth.series == "camera worlds" and truth.severity == 1.0
    (effect,) = label["effects"]
    known = {e.family: {p.name: p.unit for p in e.parameters} for e in IMAGE_EFFECTS}
    if kind == "outside":
        assert truth.form == "T2" and effect["family"] not in known
        return
    units = known[effect["family"]]
    assert {n: q["unit"] for n, q in effect["parameters"].items()}.items() <= units.items()


@pytest.mark.parametrize(("cause", "name"), [("hand_eye", "camera_in_flange"), ("base", "bases")])
def test_a_transform_in_a_label_turns_what_is_stated_into_what_is_true(cause: str, name: str) -> None:
    cell = cell_named(DEFAULT_CELL)
    item = CameraItem("c000", "single", CameraWorld("c000", 5, "typical:test", cause, 1.0), 6.0)
    (effect,) = label_of(item, cell)["effects"]
    values = np.array([q["value"] for q in effect["parameters"].values()])
    cells = (cell, true_cell(cell, instance_of(item.world, cell)[0]))
    stated, true = (
        c.camera_in_flange if name == "camera_in_flange" else bases for c, bases in map(_with_bases, cells)
    )
    made = stated @ Pose(values[:3], Rotation.from_rotvec(values[3:]).as_quat())
    np.testing.assert_allclose(made.position, true.position, atol=1e-9)
    assert made.angle_to(true) < 1e-9 < stated.angle_to(true)


def _with_bases(cell: CellSpec) -> tuple[CellSpec, Pose]:
    return cell, cell.camera_base_in_world.inverse() @ cell.tool_base_in_world
