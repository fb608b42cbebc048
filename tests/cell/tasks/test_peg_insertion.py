"""Peg insertion: geometry of its bodies, and its rules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.cell.tasks.peg_insertion.board import PAINT
from samrl_core.cell.tasks.peg_insertion.task import BODY, PegInsertion
from samrl_core.cell.tasks.shapes import SIDES, ring_boxes, ring_mesh
from samrl_core.cell.tasks.task import Ending
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

TASK = PegInsertion()
HOLE = np.array([0.52, -0.03])


def at(depth: float, lateral: float = 0.0) -> np.ndarray:
    """Tip so far below the block's top and beside the hole's axis."""
    return np.array([HOLE[0] + lateral, HOLE[1], TASK.height - depth])


def ended(tip: np.ndarray) -> Ending:
    """The episode ended with the tip there."""
    return Ending(TASK.body_poses(HOLE), {BODY: 0.0}, {BODY: 0.0}, tip, np.zeros((0, 3)))


def test_mesh_is_closed_and_wound_outwards() -> None:
    """Its volume by the divergence theorem is that of the ring; every edge has two faces."""
    inner, outer, height = 0.012, 0.06, 0.04
    mesh = ring_mesh(inner, outer, height, PAINT)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(height * SIDES * np.tan(np.pi / SIDES) * (outer**2 - inner**2), rel=1e-9)
    edges = {(int(f[i]), int(f[(i + 1) % 3])) for f in mesh.faces for i in range(3)}
    assert len(edges) == 3 * len(mesh.faces)
    assert all((j, i) in edges for i, j in edges)


def test_boxes_leave_the_hole_free_and_nothing_else() -> None:
    """Points inside the circle are in no box; points between hole and outside are in one."""
    inner, outer, height = 0.012, 0.06, 0.04
    boxes = ring_boxes(inner, outer, height)
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, 400)

    def covered(radius: float) -> np.ndarray:
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(400, 0.02)], axis=1)
        inside = [
            (np.abs(box.part_in_body.inverse().apply(points)) < np.array(box.half_extents)).all(axis=1)
            for box in boxes
        ]
        return np.any(inside, axis=0)

    assert not covered(inner * 0.999).any()
    assert covered(inner / np.cos(np.pi / SIDES) * 1.001).all()
    assert covered(outer * 0.999).all()


def test_draws_stay_in_the_range_and_fill_it() -> None:
    """10 cm x 10 cm, as the paper."""
    rng = np.random.default_rng(0)
    places = np.array([TASK.sample_start(rng).body_in_world[BODY].position for _ in range(500)])
    lower, upper = (np.array([getattr(p, n) for p in TASK.parameters()]) for n in ("lower", "upper"))
    assert (places[:, :2] >= lower).all() and (places[:, :2] <= upper).all()
    np.testing.assert_allclose(places[:, :2].min(0), lower, atol=0.002)
    np.testing.assert_allclose(places[:, :2].max(0), upper, atol=0.002)
    assert (places[:, 2] == 0).all()


def test_tool_hangs_together() -> None:
    """Tip where the cell's geometry says, mass of hand and peg, a physical inertia."""
    tool = TASK.scene(cell_named()).tool
    np.testing.assert_allclose(tool.tip_in_flange.position, [0, 0, 0.1634], atol=1e-12)
    assert tool.mass == pytest.approx(0.78)
    moments = np.linalg.eigvalsh(tool.inertia)
    assert moments[0] > 0 and moments[0] + moments[1] > moments[2]
    peg = tool.parts[0]
    assert peg.part_in_body.position[2] + 0.04 == pytest.approx(tool.tip_in_flange.position[2])


def test_sub_goals_come_in_order_and_end() -> None:
    """Far, aligned, inside, done."""
    names = [
        [goal.name for goal in TASK.sub_goals(HOLE, tip)]
        for tip in (at(-0.1, 0.05), at(-0.015, 0.0005), at(0.005, 0.002), at(0.022))
    ]
    assert names == [["above", "inserted"], ["inserted"], ["inserted"], []]


def test_small_errors_on_the_way_down_do_not_turn_it_back() -> None:
    """1.4 mm of 2 mm clearance: too much to begin the descent, not too much to go on with it."""
    assert TASK.sub_goals(HOLE, at(-0.015, 0.0014))[0].name == "above"
    assert TASK.sub_goals(HOLE, at(-0.008, 0.0014))[0].name == "inserted"
    assert TASK.sub_goals(HOLE, at(-0.008, 0.0018))[0].name == "above"


def test_pressing_on_the_block_goes_back_above() -> None:
    """A tip on the top, beside the hole, must not push on."""
    assert TASK.sub_goals(HOLE, at(0.0, 0.006))[0].name == "above"


def test_steps_shrink_near_the_hole() -> None:
    """10 mm free, 5 mm near and inside."""
    assert TASK.sub_goals(HOLE, at(-0.1, 0.05))[0].max_step == 0.010
    assert TASK.sub_goals(HOLE, at(-0.02, 0.004))[0].max_step == 0.005
    assert TASK.sub_goals(HOLE, at(0.01))[0].max_step == 0.005


@pytest.mark.parametrize(
    ("depth", "lateral", "done", "success"),
    [
        (0.0215, 0.0, True, True),
        (0.0205, 0.0, False, True),
        (0.019, 0.0, False, False),
        (0.022, 0.0028, True, True),
        (0.022, 0.0045, True, False),
        (0.022, 0.0060, False, False),
    ],
)
def test_done_and_succeeded(depth: float, lateral: float, done: bool, success: bool) -> None:
    """Depth and lateral thresholds of both judgements."""
    tip = at(depth, lateral)
    assert TASK.is_done(HOLE, tip) is done
    assert TASK.succeeded(ended(tip)) is success


def test_final_error_falls_to_the_lateral_error() -> None:
    """Above the hole the missing depth counts, inside only the offset."""
    assert TASK.final_error(ended(at(-0.01))) == pytest.approx(0.03)
    assert TASK.final_error(ended(at(0.024, 0.001))) == pytest.approx(0.001)


@pytest.mark.parametrize("values", [np.zeros(3), np.array([np.nan, 0.0])])
def test_bad_estimates_are_refused(values: np.ndarray) -> None:
    """Wrong length or not finite."""
    with pytest.raises(InputError, match="hole_x"):
        TASK.body_poses(values)


def test_bad_tip_is_refused() -> None:
    """A tip that is not finite is no progress report."""
    with pytest.raises(InputError, match="tip"):
        TASK.is_done(HOLE, np.array([np.inf, 0.0, 0.0]))


def test_impossible_settings_are_refused() -> None:
    """No clearance, or a hole wider than its block."""
    with pytest.raises(InputError, match="clearance"):
        PegInsertion(clearance=0.0)
    with pytest.raises(InputError, match="does not fit"):
        PegInsertion(peg_radius=0.07)


def test_a_moved_base_is_refused() -> None:
    """hole_x would mean two things."""
    cell = replace(cell_named(), tool_base_in_world=Pose.from_rpy(np.array([0.1, 0, 0]), (0, 0, 0)))
    with pytest.raises(InputError, match="world's origin"):
        TASK.scene(cell)


def test_unknown_task_lists_what_exists() -> None:
    """The message helps."""
    with pytest.raises(InputError, match="peg_insertion"):
        task_named("juggling")
    assert task_named("peg_insertion") is TASKS["peg_insertion"]
