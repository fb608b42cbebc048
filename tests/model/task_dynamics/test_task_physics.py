"""The tasks' physics by itself: states of values and back, rest, contact, gradients, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.types.scene import Box, Cylinder
from samrl_core.common.errors import InputError, SolveError
from samrl_core.model.physics.state import PhysicsAction, PhysicsState
from samrl_core.model.task_dynamics.choose import dynamics_of
from samrl_core.model.task_dynamics.peg_dynamics import PegDynamics
from samrl_core.model.task_dynamics.rigid_task_dynamics import FINER, TaskPhysics
from samrl_core.model.task_dynamics.settings import ContactSettings, TaskPhysicsSettings
from samrl_core.model.task_dynamics.solids import part_at, ring_of, solids_of
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState
from tests.model.physics.signed_distance import signed_distance

torch.set_num_threads(1)
CELL = cell_named()
TIP = np.array([0.5, 0.01, 0.3])
SHORT = TaskPhysicsSettings(rest_s=0.0)


@pytest.fixture(scope="module")
def physics() -> dict[str, TaskPhysics]:
    """One per task, without the pause after an action."""
    return {name: TaskPhysics(task, CELL, SHORT) for name, task in TASKS.items()}


def values_near(name: str, count: int) -> np.ndarray:
    """Random values (count, P) of a task."""
    specs = TASKS[name].parameters()
    draws = np.random.default_rng(3).uniform(-1.0, 1.0, (count, len(specs)))
    return np.array([p.nominal for p in specs]) + draws * [p.scale for p in specs]


def moved(dynamics: TaskDynamics, state: TaskState, *actions: tuple[float, float, float]) -> TaskState:
    """After actions [m]."""
    with torch.no_grad():
        for action in actions:
            state = dynamics.forward(state, torch.tensor([action], dtype=torch.float64))
    return state


@pytest.mark.parametrize("name", sorted(TASKS))
def test_states_say_what_they_were_made_of(physics: dict[str, TaskPhysics], name: str) -> None:
    """Values and tip of every state of a batch, in the physics and in what the task plans with."""
    values = values_near(name, 3)
    for dynamics in (physics[name], dynamics_of(TASKS[name], CELL)):
        state = dynamics.start(values, TIP)
        for row, given in zip(state.q.numpy(), values, strict=True):
            read, tip = dynamics.read(row)
            np.testing.assert_allclose(read, given, atol=1e-12)
            np.testing.assert_allclose(tip, TIP, atol=1e-12)


def test_the_peg_has_a_closed_form_the_others_the_physics() -> None:
    """What nothing moves needs no time steps."""
    kinds = {name: type(dynamics_of(task, CELL)) for name, task in TASKS.items()}
    assert kinds.pop("peg_insertion") is PegDynamics
    assert set(kinds.values()) == {TaskPhysics}


def test_what_rests_stays(physics: dict[str, TaskPhysics]) -> None:
    """A bent thread hangs as it was seen, a pancake lies, for 0.5 s."""
    still = [(0.0, 0.0, 0.0)] * 5
    for name, values in (
        ("needle_threading", values_near("needle_threading", 1)),
        ("spatula_flipping", np.array([[0.51, 0.0, 0.006, 0.0, 0.0]])),
    ):
        dynamics = physics[name]
        start = dynamics.start(values, TIP)
        end = moved(dynamics, start, *still)
        np.testing.assert_allclose(dynamics.read(end.q[0].numpy())[0], values[0], atol=1e-4)
        assert float(end.v.abs().max()) < 1e-3


def test_the_eye_stops_the_thread(physics: dict[str, TaskPhysics]) -> None:
    """Threaded and pulled aside by 20 mm, it bends at the eye's wall instead of passing through."""
    task, dynamics = NeedleThreading(), physics["needle_threading"]
    tip = task.eye + [0.0, 0.0, 0.07]  # 30 mm hang below the eye
    end = moved(dynamics, dynamics.start(np.zeros(20), tip), *[(0.004, 0.0, 0.0)] * 5)
    values, tip = dynamics.read(end.q[0].numpy())
    points = task.thread_points(values, tip)
    level = np.array([np.interp(-task.eye_z, -points[:, 2], points[:, i]) for i in range(2)])
    reach = float(np.hypot(*(level - task.eye[:2])))
    room = task.eye_radius - task.thread_radius
    assert 0.9 * room < reach < room + 0.001
    assert tip[0] - task.eye_x == pytest.approx(0.02, abs=1e-9)


def test_the_blade_pushes_wedges_and_lifts(physics: dict[str, TaskPhysics]) -> None:
    """A pancake before the lip is pushed to it and then rises on the blade."""
    task, dynamics = SpatulaFlipping(), physics["spatula_flipping"]
    behind = np.array([0.455, 0.0, task.low])
    state = dynamics.start(np.array([0.512, 0.0, 0.006, 0.0, 0.0]), behind)
    pushed = moved(dynamics, state, *[(0.005, 0.0, 0.0)] * 6)
    values, _ = dynamics.read(pushed.q[0].numpy())
    assert values[0] == pytest.approx(task.lip_x - task.pancake_radius, abs=2e-4)
    lifted = moved(dynamics, pushed, *[(0.005, 0.0, 0.0)] * 3)
    values, _ = dynamics.read(lifted.q[0].numpy())
    assert values[4] > 0.05 and values[2] > 0.008 and abs(values[3]) < 1e-3


def test_peg_in_hole_on_top_and_aside() -> None:
    """Over the hole it goes in; beside it the block's top stops it; in it the wall holds it.

    The arm gives way: against what it meets, the tip is pressed as springs are, and comes to rest.
    """
    task = PegInsertion()
    dynamics = TaskPhysics(task, CELL)
    hole = np.array([0.51, -0.02])

    def end(offset: float, height: float, *actions: tuple[float, float, float]) -> np.ndarray:
        start = dynamics.start(hole, np.array([hole[0] + offset, hole[1], height]))
        return dynamics.read(moved(dynamics, start, *actions).q[0].numpy())[1]

    down = (0.0, 0.0, -0.005)
    np.testing.assert_allclose(end(0.0, 0.045, *[down] * 5), [*hole, 0.02], atol=1e-4)
    on_top = end(0.006, 0.045, *[down] * 3)
    assert on_top[2] == pytest.approx(task.height, abs=5e-4)
    aside = end(0.0, 0.020, *[(0.003, 0.0, 0.0)] * 2)
    assert aside[0] - hole[0] == pytest.approx(task.clearance, abs=5e-4)


def test_closed_form_and_physics_of_the_peg_agree() -> None:
    """Into the hole from 1.5 mm aside, and onto the top from 6 mm: within half a millimetre."""
    fast = PegDynamics(PegInsertion(), CELL)
    hole = np.array([0.51, -0.02])
    for offset in (0.0015, 0.006):
        tip = np.array([hole[0] + offset, hole[1], 0.045])
        ends = []
        for dynamics in (fast, TaskPhysics(PegInsertion(), CELL)):
            state = moved(dynamics, dynamics.start(hole, tip), *[(0.0, 0.0, -0.004)] * 3)
            ends.append(dynamics.read(state.q[0].numpy())[1])
        np.testing.assert_allclose(ends[0], ends[1], atol=5e-4)


def test_what_a_step_cannot_solve_shorter_ones_do(
    physics: dict[str, TaskPhysics], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An action that failed is tried again with an eighth of the step, and ends where it should."""
    dynamics = physics["spatula_flipping"]
    start = dynamics.start(np.array([0.512, 0.0, 0.006, 0.0, 0.0]), np.array([0.459, 0.0, 0.0012]))
    push = (0.005, 0.0, 0.0)
    usual = dynamics.read(moved(dynamics, start, push).q[0].numpy())[0]
    at_once = max(steps for _, steps in dynamics.physics._workspaces)

    def fails(*_: object) -> None:
        raise SolveError("as if")

    monkeypatch.setattr(dynamics.physics, "rollout", fails)
    finer = dynamics.read(moved(dynamics, start, push).q[0].numpy())[0]
    assert usual[0] > 0.513
    np.testing.assert_allclose(finer, usual, atol=2e-4)
    # All of them at once would need eight times the memory, for good.
    assert max(steps for _, steps in dynamics._finer._workspaces) <= at_once
    monkeypatch.setattr(dynamics._finer, "rollout", fails)
    with pytest.raises(SolveError, match="as if"):
        moved(dynamics, start, push)


def test_shorter_steps_in_parts_are_those_of_one_rollout(physics: dict[str, TaskPhysics]) -> None:
    """The same states, and gradients through all parts."""
    dynamics = physics["spatula_flipping"]
    start = dynamics.start(np.array([0.512, 0.0, 0.006, 0.0, 0.0]), np.array([0.459, 0.0, 0.0012]))
    actions = dynamics.physics.no_action(1, 16)
    velocity = torch.zeros_like(actions.velocity)
    velocity[:, 0, 0] = 0.05
    parameters = dynamics._repeated(1, start.rest)
    found = []
    for parts in (True, False):
        given = velocity.clone().requires_grad_(True)
        if parts:
            begin = PhysicsState(start.q, start.v)
            path = dynamics._finely(begin, replace(actions, velocity=given), parameters)
        else:
            finer = PhysicsAction(*(x.repeat_interleave(FINER, dim=0) for x in (given, actions.wrench)))
            whole = dynamics._finer.rollout(PhysicsState(start.q, start.v), finer, parameters)
            path = PhysicsState(whole.q[::FINER], whole.v[::FINER])
        found.append((path.q, path.v, torch.autograd.grad(path.q[-1].sum(), given)[0]))
    for one, other in zip(*found, strict=True):
        assert one.shape == other.shape
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-12)
    assert found[0][0][-1, 0, 0] > start.q[0, 0] + 0.001


@pytest.mark.parametrize(
    ("name", "values", "tip", "action"),
    [
        # Threaded, the wall 1 mm away: made contact bends it.
        ("needle_threading", np.zeros(20), np.array([0.504, 0.0, 0.19]), (0.003, 0.0005, -0.001)),
        # On the blade and against the lip: slides along both.
        (
            "spatula_flipping",
            np.array([0.5309, -0.0039, 0.0172, 0.0004, 0.2473]),
            np.array([0.5255, -0.0039, 0.0068]),
            (0.0008, 0.0002, 0.0054),
        ),
        # In the hole, towards its wall.
        ("peg_insertion", np.array([0.51, -0.02]), np.array([0.511, -0.02, 0.03]), (0.004, 0.001, -0.003)),
    ],
)
def test_gradient_of_the_state_by_the_action(
    physics: dict[str, TaskPhysics],
    name: str,
    values: np.ndarray,
    tip: np.ndarray,
    action: tuple[float, float, float],
) -> None:
    """Through contact: within 1 % of central differences."""
    dynamics = physics[name]
    state = dynamics.start(values, tip)
    weights = torch.from_numpy(np.random.default_rng(0).normal(size=state.q.shape))
    a = torch.tensor([action], dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad((dynamics.forward(state, a).q * weights).sum(), a)
    step = 1e-6
    with torch.no_grad():
        differences = torch.stack(
            [
                ((dynamics.forward(state, a + e).q - dynamics.forward(state, a - e).q) * weights).sum()
                / (2 * step)
                for e in step * torch.eye(3, dtype=torch.float64)[:, None]
            ]
        )
    error = float((slope[0] - differences).norm() / differences.norm())
    print(name, "relative error", error)
    assert error < 0.01


def test_parts_become_solids() -> None:
    """Rings are seen through; what the tool holds is found at its tip."""
    board = PegInsertion().scene(CELL).bodies[0]
    inner, outer, top = ring_of(board) or (0.0, 0.0, 0.0)
    assert (inner, outer, top) == pytest.approx((0.012, 0.060, 0.040))
    needle = NeedleThreading().scene(CELL).bodies[0]
    eye, post = solids_of(needle, 0.0005)
    centre, wall = np.zeros((1, 3)), np.array([[0.0, 0.0095, 0.0]])
    assert float(signed_distance(eye, centre)[0][0]) == pytest.approx(0.007, abs=1e-9)
    assert float(signed_distance(eye, wall)[0][0]) < -0.001
    assert float(signed_distance(post, np.array([[0.0, 0.015, -0.05]]))[0][0]) < -0.002
    pancake, lip = SpatulaFlipping().scene(CELL).bodies
    assert ring_of(pancake) is None and ring_of(lip) is None
    kinds = [type(part_at(t.parts, t.tip_in_flange.position)) for t in _tools()]
    assert kinds == [type(None), Cylinder, Box]


def _tools() -> list:
    return [TASKS[name].scene(CELL).tool for name in sorted(TASKS)]


def test_bad_input_is_refused(physics: dict[str, TaskPhysics]) -> None:
    """With the value and what it must be."""
    thread = physics["needle_threading"]
    with pytest.raises(InputError, match="one per state"):
        thread.forward(thread.start(np.zeros(20), TIP), torch.zeros(3, dtype=torch.float64))
    with pytest.raises(InputError, match="joint angles"):
        thread.start(np.zeros(19), TIP)
    with pytest.raises(InputError, match="finite"):
        thread.start(np.zeros(20), TIP * np.nan)
    with pytest.raises(InputError, match="rest_s"):
        TaskPhysicsSettings(rest_s=-0.1)
    with pytest.raises(InputError, match="finite and positive"):
        TaskPhysics(PegInsertion(), CELL, TaskPhysicsSettings(contact=ContactSettings(margin=0.0)))
