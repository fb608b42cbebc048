"""Arrays and launches of rollouts of one length and batch: forward, backward, and both as graphs."""

from __future__ import annotations

from typing import Any

import torch
import warp as wp

from samrl_core.model.physics.kernel_types import types
from samrl_core.model.physics.layout import Layout
from samrl_core.model.physics.power_kernels import power_kernels
from samrl_core.model.physics.scene import PhysicsScene
from samrl_core.model.physics.step_kernels import step_kernels

PARAMETERS = (
    "mass",
    "com",
    "inertia",
    "stiffness",
    "damping",
    "rest",
    "friction",
    "contact_stiffness",
    "dissipation",
)
MOTION = ("q", "v", "action", "wrench")
VECTORS = ("place", "spin", "spin_rate", "rate", "try_turn", "try_move", "new_turn", "new_move")
LINK_MOTION = ("turn", *VECTORS, "multiplier", "after", "total")
LINK_STEP = 20  # place of the step's number among the arguments of `link_power`


def _gradients(struct: Any, names: tuple[str, ...]) -> Any:
    """A struct of the same kind that holds the gradients of the named arrays."""
    mirror = type(struct)() if not hasattr(struct, "_cls") else struct._cls()
    for name in names:
        setattr(mirror, name, getattr(struct, name).grad)
    return mirror


def _nothing(value: Any) -> Any:
    """Adjoint of a constant that is no array."""
    return None if not isinstance(value, (int, float)) else type(value)(0)


class SceneConstants:
    """A scene's structs on one device in one precision."""

    def __init__(self, scene: PhysicsScene, layout: Layout, double: bool, device: str) -> None:
        t = types(double)
        self.kinds = t
        self.double, self.device = double, device
        self.layout, self.iterations = layout, scene.iterations
        self.bodies, self.pairs = len(scene.bodies), len(scene.contacts)

        def put(values: Any, dtype: Any) -> Any:
            return wp.array(values, dtype=dtype, device=device)

        tree = t.Tree()
        tree.links, tree.dofs, tree.unknowns = len(layout.parent), len(layout.link_of_v), layout.unknowns
        for name in (
            "parent",
            "kind",
            "first_q",
            "first_v",
            "body",
            "link_of_v",
            "q_of_v",
            "before",
            "solved",
            "action",
        ):
            setattr(tree, name, put(getattr(layout, name), wp.int32))
        tree.offset, tree.axis = put(layout.offset, t.vec3), put(layout.axis, t.vec3)
        tree.turn = put(layout.turn, t.mat33)
        tree.gravity, tree.step = t.vec3(*scene.gravity), scene.step_s
        touch = t.Touch()
        touch.count = len(layout.pair)
        for name in ("pair", "point_link", "solid_link", "solid", "solid_kind"):
            setattr(touch, name, put(getattr(layout, name), wp.int32))
        touch.point, touch.solid_offset = put(layout.point, t.vec3), put(layout.solid_offset, t.vec3)
        touch.solid_turn = put(layout.solid_turn, t.mat33)
        touch.radius = put(layout.radius, t.real)
        touch.solid_numbers = put(layout.solid_numbers, t.real)
        touch.slip_speed, touch.softness = scene.slip_speed, scene.touch_softness
        touch.margin = scene.contact_margin
        self.tree, self.touch = tree, touch


class Workspace:
    """Rollouts of T steps of B environments; its arrays are written anew by every forward pass.

    `tensors` and `gradients` are torch views of the arrays, by name: q, v, action, wrench and the
    parameters; `error` (T, B) is what Newton's method left of the residual, relative.
    """

    def __init__(self, constants: SceneConstants, batch: int, steps: int) -> None:
        c, t = constants, constants.kinds
        self.constants, self.batch, self.steps = c, batch, steps
        self.generation = 0
        layout = c.layout
        links, dofs, unknowns = len(layout.parent), len(layout.link_of_v), layout.unknowns
        points, actions = len(layout.pair), max(1, layout.actions)

        def zeros(shape: tuple[int, ...], dtype: Any, grad: bool = False, of_batch: int = 0) -> Any:
            # At least one of everything: an array of no size has no pointer to capture.
            shape = tuple(max(1, n) for n in shape)
            if c.device == "cpu" or len(shape) == 1:
                return wp.zeros(shape, dtype=dtype, device=c.device, requires_grad=grad)
            # Threads of a GPU are environments and read the same place of each: neighbours in memory.
            rest = [k for k in range(len(shape)) if k != of_batch]
            order = [*rest, of_batch]
            array = wp.zeros([shape[k] for k in order], dtype=dtype, device=c.device, requires_grad=grad)
            return array.transpose([order.index(k) for k in range(len(shape))])

        motion = t.Motion()
        motion.q = zeros((steps + 1, batch, len(layout.start_q)), t.real, True, 1)
        motion.v = zeros((steps + 1, batch, dofs), t.real, True, 1)
        motion.action = zeros((steps, batch, actions), t.real, True, 1)
        motion.wrench = zeros((steps, batch, 2 * c.bodies), t.vec3, True, 1)
        values = t.Values()
        shapes: dict[str, tuple[int, Any]] = {
            "mass": (c.bodies, t.real),
            "com": (c.bodies, t.vec3),
            "inertia": (c.bodies, t.mat33),
            "stiffness": (dofs, t.real),
            "damping": (dofs, t.real),
            "rest": (dofs, t.real),
            "friction": (c.pairs, t.real),
            "contact_stiffness": (c.pairs, t.real),
            "dissipation": (c.pairs, t.real),
        }
        for name, (count, dtype) in shapes.items():
            setattr(values, name, zeros((batch, count), dtype, True))
        scratch = t.Links()
        for name in ("place", "spin", "spin_rate", "rate", "force", "torque", "first"):
            setattr(scratch, name, zeros((batch, links), t.vec3))
        scratch.turn, scratch.inertia = zeros((batch, links), t.mat33), zeros((batch, links), t.mat33)
        scratch.mass = zeros((batch, links), t.real)
        scratch.s_turn, scratch.s_move = zeros((batch, dofs), t.vec3), zeros((batch, dofs), t.vec3)
        solve = t.Solve()
        for name in ("right", "linear", "residual", "change", "pushed", "size"):
            setattr(solve, name, zeros((batch, unknowns), t.real))
        solve.matrix = zeros((batch, unknowns, dofs), t.real)
        solve.jacobian = zeros((batch, points, dofs), t.vec3)
        for name in ("normal", "slip", "slip_change"):
            setattr(solve, name, zeros((batch, points), t.vec3))
        solve.gap = zeros((batch, points), t.real)
        solve.factor = zeros((steps, batch, unknowns, unknowns), t.real, of_batch=1)
        solve.pivot = zeros((steps, batch, unknowns), wp.int32, of_batch=1)
        solve.active = zeros((steps, batch, points), wp.int32, of_batch=1)
        solve.active_count = zeros((steps, batch), wp.int32, of_batch=1)
        solve.error = zeros((steps, batch), t.real, of_batch=1)
        power = t.Power()
        for name in VECTORS:
            setattr(power, name, zeros((batch, links + 1), t.vec3, True))
        power.turn = zeros((batch, links + 1), t.mat33, True)
        power.multiplier, power.after = (
            zeros((batch, dofs), t.real, True),
            zeros((batch, dofs), t.real, True),
        )
        power.total = zeros((batch,), t.real, True)
        power.total.grad.fill_(1.0)
        # Link 0 is the world: at rest, but falling upwards, which stands for gravity.
        wp.to_torch(power.turn)[:, 0] = torch.eye(3, dtype=wp.to_torch(power.turn).dtype)
        gravity = [float(x) for x in c.tree.gravity]
        wp.to_torch(power.rate)[:, 0] = -torch.tensor(gravity, dtype=wp.to_torch(power.rate).dtype)
        self.motion, self.values, self.links, self.solve, self.power = motion, values, scratch, solve, power
        self._motion_grad = _gradients(motion, MOTION)
        self._values_grad = _gradients(values, PARAMETERS)
        self._power_grad = _gradients(power, LINK_MOTION)
        owners = [(motion, name) for name in MOTION] + [(values, name) for name in PARAMETERS]
        self.tensors = {
            name: wp.to_torch(getattr(owner, name), requires_grad=False) for owner, name in owners
        }
        self.gradients = {
            name: wp.to_torch(getattr(owner, name).grad, requires_grad=False) for owner, name in owners
        }
        self.error = wp.to_torch(solve.error)
        self.active_count = wp.to_torch(solve.active_count)
        tree = c.tree
        constant = [tree.links, tree.step, tree.gravity, tree.parent, tree.kind, tree.offset, tree.turn]
        constant += [tree.axis, tree.first_q, tree.first_v, tree.body]
        self._link_inputs = [
            *constant,
            *(getattr(values, name) for name in PARAMETERS[:6]),
            *(motion.q, motion.v, motion.wrench),
            *(getattr(power, name) for name in LINK_MOTION),
        ]
        self._graphs: dict[str, Any] = {}
        self._runs: dict[str, int] = {"forward": 0, "backward": 0}

    def forward(self) -> None:
        """Fills q and v after the first step from the first, the actions and the parameters."""
        self.generation += 1
        self._run("forward")

    def backward(self) -> None:
        """From the gradients of q and v to all others; everything but those must be zero before."""
        self._run("backward")

    def _run(self, which: str) -> None:
        """The first time eagerly, which loads the kernels; then recorded and replayed."""
        self._runs[which] += 1
        record = self._forward if which == "forward" else self._backward
        if self._runs[which] == 1:
            record()
            return
        if which not in self._graphs:
            with wp.ScopedCapture(device=self.constants.device) as capture:
                record()
            self._graphs[which] = capture.graph
        wp.capture_launch(self._graphs[which])

    def _forward(self) -> None:
        c = self.constants
        kernel = step_kernels(c.double).step
        for k in range(self.steps):
            inputs = [c.tree, c.touch, self.values, self.motion, self.links, self.solve, k, c.iterations]
            wp.launch(kernel, dim=self.batch, inputs=inputs, device=c.device, record_tape=False)

    def _backward(self) -> None:
        c, t = self.constants, self.constants.kinds
        integrate = step_kernels(c.double).integrate
        kernels = power_kernels(c.double)
        no_tree, no_touch, no_solve = t.Tree(), t.Touch(), t.Solve()
        v_grad, action_grad = self._motion_grad.v, self._motion_grad.action
        for k in reversed(range(self.steps)):
            wp.launch(
                integrate,
                dim=(c.tree.links, self.batch),
                inputs=[c.tree, self.motion, k],
                adj_inputs=[no_tree, self._motion_grad, 0],
                adj_outputs=[],
                adjoint=True,
                device=c.device,
                record_tape=False,
            )
            inputs = [c.tree, self.motion, v_grad, self.solve, self.power, k]
            wp.launch(kernels.multiply, dim=self.batch, inputs=inputs, device=c.device, record_tape=False)
            links = [*self._link_inputs[:LINK_STEP], k, *self._link_inputs[LINK_STEP:]]
            wp.launch(kernels.link_power, dim=self.batch, inputs=links, device=c.device, record_tape=False)
            if c.touch.count:  # the motion that this reads is there: only gradients are to be added
                wp.launch(
                    kernels.touch_power,
                    dim=self.batch,
                    inputs=[c.tree, c.touch, self.values, self.solve, self.power, k],
                    adj_inputs=[no_tree, no_touch, self._values_grad, no_solve, self._power_grad, 0],
                    adj_outputs=[],
                    adjoint=True,
                    device=c.device,
                    record_tape=False,
                )
            wp.launch(
                kernels.link_power,
                dim=self.batch,
                inputs=links,
                adj_inputs=[x.grad if isinstance(x, wp.array) else _nothing(x) for x in links],
                adj_outputs=[],
                adjoint=True,
                device=c.device,
                record_tape=False,
            )
            inputs = [c.tree, v_grad, action_grad, self.power, self._power_grad, k]
            wp.launch(kernels.collect, dim=self.batch, inputs=inputs, device=c.device, record_tape=False)
