"""Gradients to every input against central differences, smooth and through contact."""

from __future__ import annotations

import contact_cases
import numpy as np
import pytest
import torch
from gradient_check import Case, difference_errors, precision_errors

from samrl_core.studies.speed import physics_scenes as common

SMOOTH = 5e-4
CONTACT = 1e-2


def chain_case(steps: int) -> Case:
    rng = np.random.default_rng(0)
    made = contact_cases.case(
        common.free_chain(), 0.4 * rng.normal(size=20), rng.normal(size=20), steps, None
    )
    made.wrench[:] = torch.as_tensor(0.02 * rng.normal(size=(steps, 10, 6)))
    return made


@pytest.mark.parametrize("steps", [1, 10, 30])
def test_smooth_gradients(steps: int) -> None:
    case = chain_case(steps)
    by_difference, by_precision = difference_errors(case), precision_errors(case)
    assert {"q", "v", "wrench", "mass", "com", "inertia", "joint_stiffness"} <= set(by_difference)
    assert max(by_difference.values()) < 2e-5, by_difference
    assert max(by_precision.values()) < SMOOTH, by_precision


@pytest.mark.parametrize("name", contact_cases.CASES)
def test_contact_gradients(name: str) -> None:
    case = contact_cases.CASES[name]()
    by_difference, by_precision = difference_errors(case), precision_errors(case)
    assert {"friction", "contact_stiffness", "contact_dissipation"} <= set(by_difference)
    assert max(by_difference.values()) < 1e-3, by_difference
    assert max(by_precision.values()) < CONTACT, by_precision


def test_gradient_of_driven_motion_and_of_the_hole() -> None:
    """The peg case counts: commanded velocity and the hole's pose, which is part of the state, matter."""
    case = contact_cases.CASES["peg against the wall"]()
    from gradient_check import gradients

    found = gradients(case, torch.float64)
    assert float(found["velocity"][:, 0, 0].abs().sum()) > 0
    hole_x = float(found["q"][0, 12])
    assert abs(hole_x) > 1e-3  # the wall moves the peg
