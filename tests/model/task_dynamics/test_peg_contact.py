"""The forward model of the peg: free motion, resting on the block, going into the hole, slopes."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.tasks.peg_insertion.board import board_body
from samrl_core.cell.tasks.peg_insertion.tool import hand_with_peg
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.task_dynamics.peg_contact import PegAndHole, sizes_from, step

SIZES = PegAndHole(peg_radius=0.010, hole_radius=0.012, outer_radius=0.060, top=0.040)
ORIGIN = torch.tensor([0.5, 0.0, 0.0], dtype=torch.float64)


def vec(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def after(tip: torch.Tensor, action: torch.Tensor, count: int = 1) -> torch.Tensor:
    for _ in range(count):
        tip = step(tip, action, ORIGIN, SIZES, 0.0)
    return tip


def test_free_motion_is_exact() -> None:
    rng = np.random.default_rng(0)
    tip = torch.from_numpy(rng.uniform([0.3, -0.2, 0.06], [0.7, 0.2, 0.2], (200, 3)))
    action = torch.from_numpy(rng.uniform(-0.01, 0.01, (200, 3)))
    assert torch.equal(after(tip, action), tip + action)
    inside = after(vec(0.5005, 0.0, 0.02), vec(0.0005, 0.0005, 0.004))
    assert torch.allclose(inside, vec(0.501, 0.0005, 0.024), atol=1e-8)


def test_pressed_on_the_top_it_does_not_sink() -> None:
    pressed = after(vec(0.52, 0.0, 0.045), vec(0.0, 0.0, -0.005), count=30)
    assert float(pressed[2]) > 0.040 - 2e-4
    assert torch.allclose(pressed[:2], vec(0.52, 0.0), atol=1e-5)


def test_over_the_hole_it_goes_in_down_to_the_table() -> None:
    assert torch.allclose(after(vec(0.5, 0.0, 0.045), vec(0, 0, -0.005), 6), vec(0.5, 0.0, 0.015), atol=1e-6)
    assert abs(float(after(vec(0.5, 0.0, 0.045), vec(0, 0, -0.005), 20)[2])) < 2e-4


def test_the_clearance_decides() -> None:
    down = vec(0.0, 0.0, -0.003)
    assert float(after(vec(0.5013, 0.0, 0.045), down, 5)[2]) < 0.032
    assert float(after(vec(0.5027, 0.0, 0.045), down, 5)[2]) > 0.0398


def test_walls_hold_it_inside_and_outside() -> None:
    inside = after(vec(0.5, 0.0, 0.02), vec(0.004, 0.003, 0.0), 10)
    assert float((inside - ORIGIN)[:2].norm()) < 0.002 + 1e-4
    assert float(inside[0] - 0.5) > float(inside[1]) > 0
    outside = after(vec(0.58, 0.0, 0.02), vec(-0.005, 0.0, 0.0), 10)
    assert float(outside[0]) > 0.5 + 0.070 - 1e-4


def test_sliding_over_the_hole_it_drops_in() -> None:
    path = [vec(0.515, 0.0, 0.041)]
    for _ in range(14):
        path.append(after(path[-1], vec(-0.001, 0.0, -0.002)))
    heights = torch.stack(path)[:, 2]
    assert float(heights[1:10].min()) > 0.0398
    assert float(heights[-1]) < 0.039


@pytest.mark.parametrize(
    ("tip", "action"),
    [
        ((0.52, 0.0, 0.060), (0.001, 0.002, -0.003)),
        ((0.52, 0.0, 0.0401), (0.001, 0.002, -0.003)),
        ((0.5, 0.0, 0.045), (0.001, 0.001, -0.005)),
        ((0.5019, 0.0005, 0.042), (0.0003, 0.0001, -0.004)),
        ((0.5015, 0.0, 0.020), (0.003, 0.002, -0.004)),
        ((0.57, 0.02, 0.020), (-0.003, 0.002, -0.004)),
        ((0.5, 0.0, 0.001), (0.0, 0.0, -0.004)),
    ],
)
def test_slopes_match_differences(tip: tuple[float, ...], action: tuple[float, ...]) -> None:
    inputs = tuple(x.requires_grad_(True) for x in (vec(*tip), vec(*action), ORIGIN.clone()))
    assert torch.autograd.gradcheck(
        lambda t, a, o: step(t, a, o, SIZES, 0.0), inputs, eps=1e-8, atol=1e-4, rtol=1e-3
    )


def test_sizes_come_from_the_scene() -> None:
    tool = hand_with_peg(0.010, 0.060, 0.3, 2)
    board = board_body("hole_board", 0.012, 0.060, 0.040, Pose.identity(), 1, 0.3)
    sizes = sizes_from(tool, board)
    assert (sizes.peg_radius, sizes.hole_radius) == pytest.approx((0.010, 0.012))
    assert (sizes.outer_radius, sizes.top) == pytest.approx((0.060, 0.040))


def test_a_peg_wider_than_the_hole_is_refused() -> None:
    with pytest.raises(InputError, match="peg radius"):
        PegAndHole(0.013, 0.012, 0.06, 0.04)
