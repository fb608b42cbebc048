"""Gradients of a rollout against central differences, all differences in one batch of the float64 model."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import PhysicsScene
from samrl_core.model.physics.state import PhysicsAction, PhysicsParameters, PhysicsState

# Step of the difference: of the value itself, and at least that much.
STEPS = {
    "q": (0.0, 1e-7),
    "v": (0.0, 1e-6),
    "velocity": (0.0, 1e-6),
    "wrench": (0.0, 1e-8),
    "mass": (1e-5, 0.0),
    "com": (0.0, 1e-7),
    "inertia": (1e-4, 0.0),
    "joint_stiffness": (1e-4, 1e-7),
    "joint_damping": (1e-4, 1e-7),
    "joint_rest": (0.0, 1e-6),
    "friction": (1e-4, 0.0),
    "contact_stiffness": (1e-4, 0.0),
    "contact_dissipation": (1e-4, 0.0),
}


@dataclass(frozen=True, eq=False)
class Case:
    """A start and actions of one environment; tensors float64 without the axis of environments."""

    scene: PhysicsScene
    q: torch.Tensor  # (Q,)
    v: torch.Tensor  # (D,)
    velocity: torch.Tensor  # (T, A)
    wrench: torch.Tensor  # (T, N, 6)


def inputs(case: Case, model: PhysicsModel) -> dict[str, torch.Tensor]:
    """Every differentiable input by name, one environment."""
    parameters = model.parameters(1)
    values = {
        "q": case.q[None],
        "v": case.v[None],
        "velocity": case.velocity[:, None],
        "wrench": case.wrench[:, None],
    }
    values = {name: value.to(model.dtype) for name, value in values.items()}
    some = {  # so that a difference does not make them negative
        "joint_stiffness": parameters.joint_stiffness + 1e-4,
        "joint_damping": parameters.joint_damping + 1e-4,
    }
    return values | vars(parameters) | some


def loss(model: PhysicsModel, values: dict[str, torch.Tensor]) -> torch.Tensor:
    """(B,): fixed weights on the last and the middle state."""
    state = PhysicsState(values["q"], values["v"])
    action = PhysicsAction(values["velocity"], values["wrench"])
    names = list(STEPS)[4:]
    states = model.rollout(state, action, PhysicsParameters(**{n: values[n] for n in names}))
    generator = torch.Generator().manual_seed(1)
    total = torch.zeros(state.q.shape[0], dtype=model.dtype)
    for k in (states.q.shape[0] - 1, states.q.shape[0] // 2):
        wq = torch.randn(states.q.shape[2], generator=generator, dtype=torch.float64).to(model.dtype)
        wv = torch.randn(states.v.shape[2], generator=generator, dtype=torch.float64).to(model.dtype)
        total = total + states.q[k] @ wq + 0.05 * (states.v[k] @ wv)
    return total


def gradients(case: Case, dtype: torch.dtype) -> dict[str, torch.Tensor]:
    """By the model's backward pass."""
    model = PhysicsModel(case.scene, dtype)
    values = {name: value.clone().requires_grad_() for name, value in inputs(case, model).items()}
    loss(model, values).sum().backward()
    return {name: value.grad.to(torch.float64) for name, value in values.items() if value.grad is not None}


def directions(case: Case, count: int = 3) -> list[tuple[str, torch.Tensor]]:
    """Random directions in every input, scaled by its step; an inertia's is symmetric."""
    model = PhysicsModel(case.scene, torch.float64)
    generator = torch.Generator().manual_seed(7)
    result = []
    for name, value in inputs(case, model).items():
        relative, absolute = STEPS[name]
        for _ in range(count if value.numel() else 0):
            draw = torch.randn(value.shape, generator=generator, dtype=torch.float64)
            size = value.abs()
            if name == "inertia":  # products, too: in a principal frame they are 0, their gradients are not
                draw = 0.5 * (draw + draw.mT)
                moments = value.diagonal(dim1=-2, dim2=-1)
                size = (moments[..., :, None] * moments[..., None, :]).sqrt()
            if name == "q":
                draw = on_sphere(model, value, draw)
            result.append((name, draw * (relative * size + absolute)))
    return result


def on_sphere(model: PhysicsModel, q: torch.Tensor, draw: torch.Tensor) -> torch.Tensor:
    """Quaternions move along their sphere only."""
    draw = draw.clone()
    for i in model.layout.free_quaternion:
        unit = q[:, i : i + 4]
        draw[:, i : i + 4] -= (draw[:, i : i + 4] * unit).sum(dim=1, keepdim=True) * unit
    return draw


def differences(case: Case) -> list[tuple[str, torch.Tensor, float]]:
    """Name, direction and central difference along it, float64."""
    model = PhysicsModel(case.scene, torch.float64)
    base = inputs(case, model)
    moves = directions(case)
    batch = {}
    for name, value in base.items():
        axis = 1 if name in ("velocity", "wrench") else 0
        repeats = [1] * value.ndim
        repeats[axis] = 2 * len(moves)
        batch[name] = value.repeat(*repeats)
    for row, (name, move) in enumerate(moves):
        if name in ("velocity", "wrench"):
            batch[name][:, 2 * row] += move[:, 0]
            batch[name][:, 2 * row + 1] -= move[:, 0]
        else:
            batch[name][2 * row] += move[0]
            batch[name][2 * row + 1] -= move[0]
    value = loss(model, batch)
    return [(name, move, float(value[2 * i] - value[2 * i + 1]) / 2) for i, (name, move) in enumerate(moves)]


# What a change of each input by its natural size does: inputs that do less than this share of the
# strongest one's effect are measured against that share, for their own gradient is rounding.
WEAK = 1e-4
NATURAL = {"q": 1e-3, "v": 1e-2, "velocity": 1e-2, "com": 1e-3, "joint_rest": 1e-2}


def natural_size(name: str, values: dict[str, torch.Tensor]) -> torch.Tensor:
    """Scale of an input: its own value, or a typical length, angle or speed; a weight for a wrench."""
    if name == "wrench":
        return 0.1 * 9.81 * values["mass"].to(torch.float64).max()
    if name in NATURAL:
        return torch.tensor(NATURAL[name], dtype=torch.float64)
    return values[name].to(torch.float64).abs()


def difference_errors(case: Case) -> dict[str, float]:
    """Relative error by input of the float64 gradient along random directions, against the differences."""
    found = gradients(case, torch.float64)
    by_name: dict[str, list[tuple[float, float]]] = {}
    for name, move, expected in differences(case):
        relative, absolute = STEPS[name]
        size = relative if relative else absolute / NATURAL.get(name, 1e-2)
        by_name.setdefault(name, []).append((float((found[name] * move).sum()) / size, expected / size))
    tables = {name: torch.tensor(pairs, dtype=torch.float64) for name, pairs in by_name.items()}
    floor = WEAK * max(float(table[:, 1].norm()) for table in tables.values())
    return {
        name: float((table[:, 0] - table[:, 1]).norm()) / max(float(table[:, 1].norm()), floor)
        for name, table in tables.items()
    }


def precision_errors(case: Case) -> dict[str, float]:
    """Relative error by input of the float32 gradient, as a vector, against the float64 one."""
    single, double = gradients(case, torch.float32), gradients(case, torch.float64)
    values = inputs(case, PhysicsModel(case.scene, torch.float64))
    scaled = {name: value * natural_size(name, values) for name, value in double.items()}
    floor = WEAK * max(float(value.norm()) for value in scaled.values() if value.numel())
    return {
        name: float((single[name] * natural_size(name, values) - value).norm())
        / max(float(value.norm()), floor)
        for name, value in scaled.items()
        if value.numel()
    }
