"""The border between torch and the physics kernels (paper eq. 3: the next state from state and action)."""

from __future__ import annotations

from typing import Any

import torch

from samrl_core.common.devices import numbered_device
from samrl_core.common.errors import InputError, SolveError
from samrl_core.common.warp_runtime import start
from samrl_core.model.physics.layout import lay_out
from samrl_core.model.physics.scene import PhysicsScene
from samrl_core.model.physics.state import PhysicsAction, PhysicsParameters, PhysicsState, nominal_parameters
from samrl_core.model.physics.workspace import MOTION, PARAMETERS, SceneConstants, Workspace

RESIDUAL_LIMIT = 1.0e-3  # of all impulses added without sign; above it a step is not solved
CACHED_WORKSPACES = 4  # lengths and batches whose arrays are kept


class PhysicsModel:
    """One scene in one precision on one device; differentiable in everything but the scene's shapes.

    A step solves one nonlinear system by Newton's method, and its gradient is that of the solution
    (implicit function theorem), not of the iterations.

    Args:
        scene: bodies, joints, contacts.
        dtype: torch.float32, or torch.float64 as the reference of gradients.
        device: torch's name of the device.
    """

    def __init__(self, scene: PhysicsScene, dtype: torch.dtype = torch.float32, device: str = "cpu") -> None:
        if dtype not in (torch.float32, torch.float64):
            raise InputError(f"dtype {dtype} is not float32 or float64")
        start()
        self.scene, self.dtype, self.device = scene, dtype, device
        self.layout = lay_out(scene)
        where = str(numbered_device(device))
        self._constants = SceneConstants(scene, self.layout, dtype == torch.float64, where)
        self._workspaces: dict[tuple[int, int], Workspace] = {}
        self._checked: dict[str, tuple[torch.Tensor, int]] = {}  # parameters found good, and their versions

    def parameters(self, batch: int) -> PhysicsParameters:
        """The scene's own values."""
        return nominal_parameters(self.scene, self.layout, batch, self.dtype, self.device)

    def start_state(self, batch: int) -> PhysicsState:
        """Joints at zero, free bodies at the origin, everything at rest."""
        q = torch.as_tensor(self.layout.start_q, dtype=self.dtype, device=self.device).repeat(batch, 1)
        return PhysicsState(q, q.new_zeros((batch, len(self.layout.link_of_v))))

    def no_action(self, batch: int, steps: int) -> PhysicsAction:
        """Driven joints held, no wrenches, for a rollout."""
        options: dict[str, Any] = {"dtype": self.dtype, "device": self.device}
        return PhysicsAction(
            torch.zeros((steps, batch, self.layout.actions), **options),
            torch.zeros((steps, batch, len(self.scene.bodies), 6), **options),
        )

    def step(self, state: PhysicsState, action: PhysicsAction, parameters: PhysicsParameters) -> PhysicsState:
        """State after one step of `scene.step_s`; raises as `rollout` does."""
        actions = PhysicsAction(action.velocity[None], action.wrench[None])
        return self.rollout(state, actions, parameters).at(1)

    def rollout(
        self, state: PhysicsState, actions: PhysicsAction, parameters: PhysicsParameters
    ) -> PhysicsState:
        """T steps.

        Args:
            state: (B, ...) at the start.
            actions: (T, B, ...).
            parameters: (B, ...), the same in all steps.

        Returns:
            q (T + 1, B, Q) and v (T + 1, B, D), the start included.

        Raises:
            InputError: a shape, a type, or a value that no body can have.
            SolveError: Newton's method failed, or a value is not finite.
        """
        self._check(state, actions, parameters)
        q, v = _Rollout.apply(self, state.q, state.v, actions.velocity, actions.wrench, *parameters.tensors())
        return PhysicsState(q, v)

    def workspace(self, batch: int, steps: int) -> Workspace:
        """Arrays of rollouts of this size; the oldest are dropped when there are many sizes."""
        key = (batch, steps)
        if key not in self._workspaces:
            while len(self._workspaces) >= CACHED_WORKSPACES:
                self._workspaces.pop(next(iter(self._workspaces)))
            self._workspaces[key] = Workspace(self._constants, batch, steps)
        return self._workspaces[key]

    def _check(self, state: PhysicsState, actions: PhysicsAction, parameters: PhysicsParameters) -> None:
        if state.q.ndim != 2 or actions.velocity.ndim != 3:
            raise InputError("a rollout needs a state (B, ...) and actions (T, B, ...)")
        batch, steps = state.q.shape[0], actions.velocity.shape[0]
        if batch == 0 or steps == 0:
            raise InputError(f"a rollout of {batch} environments and {steps} steps is empty")
        dofs, bodies, pairs = len(self.layout.link_of_v), len(self.scene.bodies), len(self.scene.contacts)
        sizes = (bodies, dofs, pairs)
        expected = [
            ("state.q", state.q, (batch, len(self.layout.start_q))),
            ("state.v", state.v, (batch, dofs)),
            ("actions.velocity", actions.velocity, (steps, batch, self.layout.actions)),
            ("actions.wrench", actions.wrench, (steps, batch, bodies, 6)),
        ]
        for i, (name, value) in enumerate(zip(PARAMETERS, parameters.tensors(), strict=True)):
            tail = {"com": (3,), "inertia": (3, 3)}.get(name, ())
            expected.append((f"parameters.{name}", value, (batch, sizes[i // 3], *tail)))
        for name, value, shape in expected:
            if tuple(value.shape) != shape or value.dtype != self.dtype:
                raise InputError(
                    f"{name} is {tuple(value.shape)} {value.dtype}, must be {shape} {self.dtype}"
                )
        for name, value, _ in expected[:4]:
            if not bool(torch.isfinite(value).all()):
                raise InputError(f"{name} has a value that is not finite")
        for first in self.layout.free_quaternion:
            length = state.q.detach()[:, first : first + 4].norm(dim=1)
            if bool(((length - 1.0).abs() > 1e-3).any()):
                raise InputError(f"quaternion lengths {length.tolist()} must be 1; normalise them")
        # Checking costs as much as some steps: once for the same unchanged numbers, which a caller may expand
        # anew for every rollout.
        now = {name: (value, value._version) for name, value in vars(parameters).items()}
        known = self._checked
        changed = [
            name
            for name, (value, version) in now.items()
            if name not in known or known[name][1] != version or not _same_memory(value, known[name][0])
        ]
        parameters.check(changed)
        self._checked = now


def _same_memory(a: torch.Tensor, b: torch.Tensor) -> bool:
    """Whether two tensors are the same view of the same memory, which neither lets go."""
    return a.data_ptr() == b.data_ptr() and a.shape == b.shape and a.stride() == b.stride()


class _Rollout(torch.autograd.Function):
    """The only bridge from the physics kernels to torch's gradients."""

    @staticmethod
    def forward(ctx: Any, model: PhysicsModel, *inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        ctx.model = model
        ctx.save_for_backward(*inputs)
        work, ctx.generation = _run_forward(model, inputs)
        q, v = work.tensors["q"].clone(), work.tensors["v"].clone()
        error = work.error
        if not (bool(torch.isfinite(q).all()) and bool(torch.isfinite(v).all())):
            step = int((~torch.isfinite(v)).flatten(1).any(dim=1).nonzero()[0])
            raise SolveError(f"step {step} gave values that are not finite; check forces and inertias")
        worst = float(error.max())
        if worst > RESIDUAL_LIMIT:
            step = int((error > RESIDUAL_LIMIT).any(dim=1).nonzero()[0])
            raise SolveError(
                f"Newton's method left {worst:.1e} of the residual (limit {RESIDUAL_LIMIT}), first in step "
                f"{step}; use a shorter step, softer contacts or more iterations"
            )
        return q, v

    @staticmethod
    def backward(ctx: Any, *grads: torch.Tensor) -> Any:
        inputs = ctx.saved_tensors
        work = ctx.model.workspace(inputs[0].shape[0], inputs[2].shape[0])
        if work.generation != ctx.generation or ctx.generation == 0:
            work, _ = _run_forward(ctx.model, inputs)  # another rollout has used the arrays since
        for gradient in work.gradients.values():
            gradient.zero_()
        for name, gradient in zip(("q", "v"), grads, strict=True):
            work.gradients[name].copy_(gradient)
        work.backward()
        result = [work.gradients["q"][0], work.gradients["v"][0]]
        for name, value in zip((*MOTION[2:], *PARAMETERS), inputs[2:], strict=True):
            result.append(_matching(work.gradients[name], value))
        return None, *(value.clone() for value in result)


def _matching(array: torch.Tensor, value: torch.Tensor) -> torch.Tensor:
    """The array as the tensor is shaped: a pair of vectors is a wrench, padding is cut off."""
    if value.ndim == 4 and value.shape[-1] == 6:
        return array.reshape(*array.shape[:2], -1, 6)
    return array[..., : value.shape[-1]] if value.ndim == array.ndim and array.ndim < 4 else array


def _run_forward(model: PhysicsModel, inputs: tuple[torch.Tensor, ...]) -> tuple[Workspace, int]:
    """Writes the inputs into the arrays and runs."""
    work = model.workspace(inputs[0].shape[0], inputs[2].shape[0])
    work.tensors["q"][0].copy_(inputs[0].detach())
    work.tensors["v"][0].copy_(inputs[1].detach())
    for name, value in zip((*MOTION[2:], *PARAMETERS), inputs[2:], strict=True):
        _matching(work.tensors[name], value).copy_(value.detach())
    work.forward()
    return work, work.generation
