"""What contact must do in the three tasks: let in, hold out, push along and lift."""

from __future__ import annotations

import contact_cases
import torch
from gradient_check import Case, inputs

from samrl_core.model.physics.body_poses import body_poses
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.state import PhysicsAction, PhysicsState

TOP = 0.04  # of the block [m]


def end(case: Case) -> tuple[torch.Tensor, torch.Tensor]:
    """Rotations (N, 3, 3) and positions (N, 3) of the bodies after the rollout."""
    model = PhysicsModel(case.scene, torch.float64)
    values = inputs(case, model)
    action = PhysicsAction(values["velocity"], values["wrench"])
    states = model.rollout(PhysicsState(values["q"], values["v"]), action, model.parameters(1))
    turn, place = body_poses(model.layout, states.q[-1, 0])
    return turn, place


def peg_tip(case: Case) -> torch.Tensor:
    turn, place = end(case)
    return place[1] + turn[1] @ torch.tensor([0, 0, -0.06], dtype=torch.float64)


def test_chamfer_lets_the_peg_in_and_the_top_does_not() -> None:
    """3.3 mm beside the axis the tip meets the chamfer (up to 4 mm) and slides in; at 6 mm it rests."""
    inside = peg_tip(contact_cases.peg(60, 0.0033, 0.005))
    assert float(inside[2]) < TOP - 0.012
    assert abs(float(inside[0])) < 0.0033 - 0.0005  # pushed towards the axis
    outside = peg_tip(contact_cases.peg(60, 0.006, 0.005))
    assert float(outside[2]) > TOP - 0.004  # the wrist presses with 60 N on points of 5 kN/m


def test_tilted_peg_jams_and_straight_peg_does_not() -> None:
    """Held by its tip in the hole and its side at the rim, a tilted peg stays behind its hand."""
    straight = float(peg_tip(contact_cases.peg(60, 0.0, 0.003))[2])
    tilted = float(peg_tip(contact_cases.peg(60, 0.0, 0.003, 0.12))[2])
    assert straight < TOP - 0.033
    assert tilted > straight + 0.01


def test_thread_touches_the_eye_and_passes() -> None:
    """The tip starts 6 mm beside the axis and ends below the eye, inside of it."""
    turn, place = end(contact_cases.thread(60))
    tip = place[-1] + turn[-1] @ torch.tensor([0, 0, -0.01], dtype=torch.float64)
    assert float(tip[2]) < -0.01
    assert float(tip[:2].norm()) < 0.007


def test_spatula_pushes_and_lifts_the_pancake() -> None:
    _, pushed = end(contact_cases.push(48))
    assert float(pushed[1, 0]) > 0.012
    assert abs(float(pushed[1, 2]) - 0.006) < 1e-3
    turn, lifted = end(contact_cases.lift(48))
    assert float(lifted[1, 2]) > 0.02
    assert abs(float(turn[1, 2, 2]) - float(turn[0, 2, 2])) < 0.01  # it lies on the tilted blade
