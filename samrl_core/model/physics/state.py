"""What the physics takes and gives: states, actions and parameters, as tensors."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physics.layout import Layout
from samrl_core.model.physics.scene import PhysicsScene


@dataclass(frozen=True, eq=False)
class PhysicsState:
    """B environments, Q coordinates, D velocities; a rollout's states have T + 1 in front.

    The order is that of the scene's joints. Quaternions (xyzw) must be of unit length.
    """

    q: torch.Tensor  # (B, Q) [rad], [m], [1]
    v: torch.Tensor  # (B, D) [rad/s], [m/s]

    def at(self, step: int) -> PhysicsState:
        """One state of a rollout."""
        return PhysicsState(self.q[step], self.v[step])


@dataclass(frozen=True, eq=False)
class PhysicsAction:
    """What moves the scene during one step; a rollout's actions have T in front."""

    velocity: torch.Tensor  # (B, A) of the driven joints [rad/s], [m/s]
    wrench: torch.Tensor  # (B, N, 6) force [N] at each body's origin and torque [N m], world axes


@dataclass(frozen=True, eq=False)
class PhysicsParameters:
    """What Real2Sim may change; every field has gradients. P is the number of contact pairs."""

    mass: torch.Tensor  # (B, N) [kg]
    com: torch.Tensor  # (B, N, 3) [m]
    inertia: torch.Tensor  # (B, N, 3, 3) about the centre of mass, body axes [kg m^2]
    joint_stiffness: torch.Tensor  # (B, D) [N m/rad], [N/m]
    joint_damping: torch.Tensor  # (B, D) [N m s/rad], [N s/m]
    joint_rest: torch.Tensor  # (B, D) [rad], [m]
    friction: torch.Tensor  # (B, P) [-]
    contact_stiffness: torch.Tensor  # (B, P) per point [N/m]
    contact_dissipation: torch.Tensor  # (B, P) [s/m]

    def tensors(self) -> tuple[torch.Tensor, ...]:
        """The fields in order."""
        return tuple(vars(self).values())

    def check(self, names: Collection[str] | None = None) -> None:
        """Refuses values that no body, joint or contact can have.

        Args:
            names: fields to check; all without it.

        Raises:
            InputError: with the name, the value and the limit.
        """
        for name, tensor in vars(self).items():
            if names is not None and name not in names:
                continue
            value = tensor.detach()
            if not bool(torch.isfinite(value).all()):
                raise InputError(f"parameter {name} is not finite: {value}")
            if name in ("com", "inertia", "joint_rest") or not value.numel():
                continue
            smallest = float(value.min())
            if name in ("mass", "contact_stiffness"):
                if smallest <= 0:
                    raise InputError(f"{name} {smallest} must be positive; bound it in what fits it")
            elif smallest < 0:
                raise InputError(f"{name} {smallest} must be at least 0; bound it in what fits it")
        if names is None or "inertia" in names:
            self._check_inertia()

    def _check_inertia(self) -> None:
        inertia = self.inertia.detach()
        if not torch.allclose(inertia, inertia.transpose(-1, -2), rtol=1e-4, atol=0.0):
            raise InputError("an inertia is not symmetric; build it from six numbers")
        bad = ~_is_definite(inertia.to(torch.float64))
        if bool(bad.any()):
            principal = torch.linalg.eigvalsh(inertia[bad][0].cpu())
            raise InputError(f"singular inertia: principal moments {principal.tolist()} kg m^2")


def _is_definite(inertia: torch.Tensor) -> torch.Tensor:
    """(...,) whether (..., 3, 3) has a smallest principal moment above about 1e-6 of its largest.

    By the characteristic polynomial, since det / (minors trace) lies between a ninth of that ratio and the
    ratio: batched eigenvalues of CUDA fail for some thousands of matrices.
    """
    a, b, c = (inertia[..., k, k] for k in range(3))
    d, e, f = inertia[..., 0, 1], inertia[..., 0, 2], inertia[..., 1, 2]
    trace = a + b + c
    minors = a * b + a * c + b * c - d * d - e * e - f * f
    determinant = a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - b * e)
    return (trace > 0) & (minors > 0) & (determinant > 1e-6 * minors * trace)


def nominal_parameters(
    scene: PhysicsScene, layout: Layout, batch: int, dtype: torch.dtype, device: str
) -> PhysicsParameters:
    """The scene's own values, once per environment."""

    def repeat(values: object, *shape: int) -> torch.Tensor:
        one = torch.as_tensor(values, dtype=dtype, device=device).reshape(1, *shape)
        return one.repeat(batch, *([1] * len(shape)))

    bodies, pairs, dofs = scene.bodies, scene.contacts, len(layout.link_of_v)
    return PhysicsParameters(
        mass=repeat([b.mass for b in bodies], len(bodies)),
        com=repeat([list(b.com) for b in bodies], len(bodies), 3),
        inertia=repeat([b.inertia.tolist() for b in bodies], len(bodies), 3, 3),
        joint_stiffness=repeat(layout.stiffness, dofs),
        joint_damping=repeat(layout.damping, dofs),
        joint_rest=repeat(layout.rest, dofs),
        friction=repeat([p.friction for p in pairs], len(pairs)),
        contact_stiffness=repeat([p.stiffness for p in pairs], len(pairs)),
        contact_dissipation=repeat([p.dissipation for p in pairs], len(pairs)),
    )
