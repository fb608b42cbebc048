"""The torch border: batches, replays, kept arrays, and refusal of bad input."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import contact_cases
import numpy as np
import pytest
import torch
from gradient_check import Case, inputs

from samrl_core.common.errors import InputError, SolveError
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import WORLD, ContactPair, Joint, JointKind, PhysicsBody, PhysicsScene
from samrl_core.model.physics.shapes import plane
from samrl_core.model.physics.state import PhysicsAction, PhysicsParameters, PhysicsState


def prepare(case: Case, dtype: torch.dtype) -> tuple[PhysicsModel, PhysicsState, PhysicsAction]:
    model = PhysicsModel(case.scene, dtype)
    values = inputs(case, model)
    return model, PhysicsState(values["q"], values["v"]), PhysicsAction(values["velocity"], values["wrench"])


def test_replays_and_batches_repeat_the_first_run() -> None:
    """The first run is eager, later ones replay a graph; an environment does not see its neighbours."""
    model, state, action = prepare(contact_cases.lift(24), torch.float32)
    first = model.rollout(state, action, model.parameters(1))
    again = model.rollout(state, action, model.parameters(1))
    assert torch.equal(first.q, again.q) and torch.equal(first.v, again.v)
    many = PhysicsState(state.q.repeat(3, 1), state.v.repeat(3, 1))
    moved = PhysicsAction(action.velocity.repeat(1, 3, 1), action.wrench.repeat(1, 3, 1, 1))
    moved.velocity[:, 1] *= 0.5
    batch = model.rollout(many, moved, model.parameters(3))
    assert torch.equal(batch.q[:, 0], first.q[:, 0]) and torch.equal(batch.q[:, 2], first.q[:, 0])
    assert not torch.equal(batch.q[:, 1], first.q[:, 0])


def test_steps_chain_to_the_rollout_with_its_gradient() -> None:
    """Four single steps share arrays: the backward pass must not read those of a later step."""
    model, state, action = prepare(contact_cases.disc(4, 0.0, 0.5), torch.float64)
    parameters = model.parameters(1)
    v0 = state.v.clone().requires_grad_()
    walking = PhysicsState(state.q, v0)
    for k in range(4):
        walking = model.step(walking, PhysicsAction(action.velocity[k], action.wrench[k]), parameters)
    walking.q[0, 0].backward()
    v1 = state.v.clone().requires_grad_()
    whole = model.rollout(PhysicsState(state.q, v1), action, parameters)
    whole.q[-1, 0, 0].backward()
    assert torch.equal(whole.q[-1], walking.q)
    assert v0.grad is not None and v1.grad is not None
    torch.testing.assert_close(v0.grad, v1.grad, rtol=1e-12, atol=1e-15)


def test_backward_twice_gives_the_same() -> None:
    model, state, action = prepare(contact_cases.peg(24, 0.0025, 0.002), torch.float32)
    grads = []
    for _ in range(3):  # eager, recorded, replayed
        velocity = action.velocity.clone().requires_grad_()
        end = model.rollout(state, PhysicsAction(velocity, action.wrench), model.parameters(1))
        end.q[-1].sum().backward()
        assert velocity.grad is not None
        grads.append(velocity.grad.clone())
    assert torch.equal(grads[0], grads[1]) and torch.equal(grads[0], grads[2])
    assert float(grads[0].abs().max()) > 0


def body(**changes: object) -> PhysicsBody:
    return replace(PhysicsBody("b", 0.1, 1e-4 * np.eye(3), (Joint(JointKind.FREE),)), **changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"mass": 0.0},
        {"mass": -1.0},
        {"mass": float("nan")},
        {"inertia": np.zeros((3, 3))},
        {"inertia": np.diag([1.0, 1.0, 0.0])},
        {"inertia": np.diag([1.0, 1.0, 3.0])},
        {"inertia": np.array([[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1]])},
        {"joints": ()},
        {"parent": 0},
        {"joints": (Joint(JointKind.FREE), Joint(JointKind.REVOLUTE))},
        {"joints": (Joint(JointKind.FREE, driven=True),)},
    ],
)
def test_impossible_bodies_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError):
        PhysicsModel(PhysicsScene((body(**changes),)))


@pytest.mark.parametrize(
    "pair",
    [
        ContactPair(1, np.zeros((1, 3)), WORLD, 0),
        ContactPair(0, np.zeros((1, 3)), 0, 0),
        ContactPair(0, np.zeros((1, 3)), WORLD, 1),
        ContactPair(0, np.zeros((0, 3)), WORLD, 0),
        ContactPair(0, np.zeros((1, 3)), WORLD, 0, friction=-0.1),
        ContactPair(0, np.zeros((1, 3)), WORLD, 0, stiffness=0.0),
    ],
)
def test_impossible_contacts_are_refused(pair: ContactPair) -> None:
    with pytest.raises(InputError):
        PhysicsScene((body(),), (plane(),), (pair,))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("mass", 0.0, "mass"),
        ("mass", -0.1, "mass"),
        ("mass", float("nan"), "finite"),
        ("inertia", 0.0, "singular"),
        ("friction", -0.1, "friction"),
        ("joint_damping", -1.0, "joint_damping"),
        ("contact_stiffness", 0.0, "contact_stiffness"),
    ],
)
def test_impossible_parameters_are_refused(field: str, value: float, message: str) -> None:
    model, state, action = prepare(contact_cases.disc(2, 0.0, 0.1), torch.float32)
    parameters = model.parameters(1)
    bad = replace(parameters, **{field: torch.full_like(getattr(parameters, field), value)})
    with pytest.raises(InputError, match=message):
        model.rollout(state, action, bad)


def test_parameters_are_looked_at_again_where_they_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expanded anew they are the same numbers; written over, or in other memory, they are not."""
    model = PhysicsModel(contact_cases.disc(1, 0.0, 0.5).scene, torch.float64)
    own, state, action = model.parameters(1), model.start_state(2), model.no_action(2, 1)
    state.q[:, 2] = 0.1
    looked: list[set[str]] = []
    check = PhysicsParameters.check

    def watched(self: PhysicsParameters, names: Collection[str] | None = None) -> None:
        looked.append(set(vars(self) if names is None else names))
        check(self, names)

    monkeypatch.setattr(PhysicsParameters, "check", watched)

    def run(rest: torch.Tensor) -> set[str]:
        fields = {n: v.expand(2, *v.shape[1:]) for n, v in vars(own).items()}
        model.rollout(state, action, PhysicsParameters(**fields | {"joint_rest": rest.expand(2, -1)}))
        return looked.pop()

    assert run(own.joint_rest) == set(vars(own))
    assert run(own.joint_rest) == set()
    assert run(own.joint_rest.clone()) == {"joint_rest"}
    own.inertia.mul_(1.1)
    assert run(own.joint_rest) == {"joint_rest", "inertia"}
    own.mass.neg_()
    for _ in range(2):  # what was refused once is not taken for good
        with pytest.raises(InputError, match="mass"):
            run(own.joint_rest)
        assert looked.pop() == {"mass"}


def test_wrong_states_and_shapes_are_refused() -> None:
    model, state, action = prepare(contact_cases.disc(2, 0.0, 0.1), torch.float32)
    parameters = model.parameters(1)
    with pytest.raises(InputError, match="finite"):
        model.rollout(PhysicsState(state.q, state.v * float("inf")), action, parameters)
    with pytest.raises(InputError, match="quaternion"):
        model.rollout(PhysicsState(2.0 * state.q, state.v), action, parameters)
    with pytest.raises(InputError, match="must be"):
        model.rollout(PhysicsState(state.q[:, :6], state.v), action, parameters)
    with pytest.raises(InputError, match="float32"):
        model.rollout(PhysicsState(state.q.double(), state.v), action, parameters)
    with pytest.raises(InputError, match="must be"):
        model.rollout(state, action, model.parameters(2))


def test_a_step_that_is_not_solved_is_an_error() -> None:
    """One iteration cannot find the impact; and a spin whose square is beyond float32 ends in no number."""
    case = contact_cases.disc(24, 0.004, 0.5)
    model, state, action = prepare(replace(case, scene=replace(case.scene, iterations=1)), torch.float64)
    with pytest.raises(SolveError, match="Newton"):
        model.rollout(state, action, model.parameters(1))
    model, state, action = prepare(case, torch.float32)
    with pytest.raises(SolveError, match="finite"):
        model.rollout(PhysicsState(state.q, state.v + 1e30), action, model.parameters(1))
