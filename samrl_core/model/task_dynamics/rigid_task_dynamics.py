"""Eq. 3 by the physics: the tip is driven, the thread swings, the pancake is pushed, lifted and turned."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.chain import holding_torque
from samrl_core.cell.tasks.start import DOWN, checked_tip
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, SolveError
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.state import PhysicsAction, PhysicsParameters, PhysicsState
from samrl_core.model.task_dynamics.assemble import assemble
from samrl_core.model.task_dynamics.settings import TaskPhysicsSettings
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState

FINER = 8  # an action that cannot be solved is tried again with its steps cut into so many


class TaskPhysics(TaskDynamics):
    """The physics of one task in one cell.

    A chain's springs are taken to hold it in the estimated shape: their rest angles follow from that, not
    from the start of the episode, so an error of the estimate moves nothing.

    Args:
        task: its scene is built.
        cell: the arms; the tool arm's base is the world's origin.
        settings: time and contact.

    Raises:
        InputError: the scene has parts that the physics has no solid for.
    """

    def __init__(self, task: Task, cell: CellSpec, settings: TaskPhysicsSettings | None = None) -> None:
        self._task = task
        self.settings = s = settings or TaskPhysicsSettings()
        self._assembly = assemble(task, cell, s.contact)
        self.physics = PhysicsModel(self._assembly.scene, torch.float64)
        scene = replace(self._assembly.scene, step_s=s.contact.step_s / FINER)
        self._finer = PhysicsModel(scene, torch.float64)
        self._parameters = self.physics.parameters(1)
        self._speeds = _speeds(round(s.action_s / s.contact.step_s), round(s.rest_s / s.contact.step_s))
        self._speeds /= s.contact.step_s
        first = 8 if self._assembly.sprung else 3
        self._chain = slice(first, first + 2 * len(self._assembly.chain))
        self._gravity = np.array(self._assembly.scene.gravity)

    @property
    def parameters(self) -> PhysicsParameters:
        """Masses, frictions and stiffnesses (1, ...): the scene's own, or those of `with_parameters`."""
        return self._parameters

    @property
    def movable_bodies(self) -> tuple[int, ...]:
        """Which of the scene's bodies move freely."""
        names = [body.name for body in self._assembly.scene.bodies]
        return tuple(names.index(name) for name in self._assembly.movable)

    @property
    def chain_joints(self) -> tuple[int, ...]:
        """Which velocities are those of the chain's joints."""
        return tuple(range(self._chain.start, self._chain.stop))

    def with_parameters(self, parameters: PhysicsParameters) -> TaskPhysics:
        """The same scene with fitted parameters (1, ...); compiled kernels are shared."""
        parameters.check()
        other = copy.copy(self)
        other._parameters = parameters
        return other

    def prepare(self) -> None:
        """See `TaskDynamics`."""
        nominal = np.array([p.nominal for p in self._task.parameters()])
        # High above all: kernels are compiled whether there is contact or not. The second time records them.
        start = self.start(nominal, np.array([0.5, 0.0, 0.5]))
        for _ in range(2):
            action = torch.zeros((1, 3), dtype=torch.float64, requires_grad=True)
            torch.autograd.grad(self.forward(start, action).q.sum(), action)

    def start(self, values: np.ndarray, tip_position: np.ndarray) -> TaskState:
        """See `TaskDynamics`."""
        tip = checked_tip(tip_position)
        rows, slack = [], []
        for one in np.atleast_2d(np.asarray(values, dtype=np.float64)):
            angles = self._task.chain_angles(one)
            poses = self._task.body_poses(one)
            free = [self._coordinates(poses[name]) for name in self._assembly.movable]
            shifted = [poses[body.name].position for body in self._assembly.shifted]
            rows.append(np.concatenate([tip, np.zeros(self._chain.start - 3), angles, *free, *shifted]))
            slack.append(self._slack_angles(tip, angles))
        q = torch.from_numpy(np.array(rows))
        v = torch.zeros((len(rows), len(self.physics.layout.link_of_v)), dtype=torch.float64)
        return TaskState(q, v, torch.from_numpy(np.array(slack)))

    def forward(self, state: TaskState, action: torch.Tensor) -> TaskState:
        """See `TaskDynamics`."""
        path = self.path(state, action)
        return TaskState(path.q[-1], path.v[-1], state.rest)

    def path(self, state: TaskState, action: torch.Tensor) -> PhysicsState:
        """All states of one action (T + 1, B, ...), the start included; raises as `forward`."""
        batch = state.q.shape[0]
        if tuple(action.shape) != (batch, 3):
            raise InputError(f"action has shape {tuple(action.shape)}, must be ({batch}, 3): one per state")
        return self._rollout(state, self._speeds[:, None, None] * action)

    def track(self, state: TaskState, tips: torch.Tensor) -> PhysicsState:
        """All states while the tip follows given positions.

        Args:
            state: B states, their tips at the first position.
            tips: (T + 1, B, 3) in the tool arm's base frame, one per step of the physics [m].
        """
        return self._rollout(state, (tips[1:] - tips[:-1]) / self.settings.contact.step_s)

    def _rollout(self, state: TaskState, velocity: torch.Tensor) -> PhysicsState:
        steps, batch, _ = velocity.shape
        held = velocity.new_zeros((steps, batch, self.physics.layout.actions - 3))  # what the task shifts
        velocity = torch.cat([velocity, held], dim=2)
        start, parameters = PhysicsState(state.q, state.v), self._repeated(batch, state.rest)
        wrench = self.physics.no_action(batch, steps).wrench
        try:
            return self.physics.rollout(start, PhysicsAction(velocity, wrench), parameters)
        except SolveError:
            return self._finely(start, PhysicsAction(velocity, wrench), parameters)

    def _finely(
        self, start: PhysicsState, actions: PhysicsAction, parameters: PhysicsParameters
    ) -> PhysicsState:
        """The states (T + 1, B, ...) by shorter steps, which are nearer to linear; raises as `forward`.

        As many steps at a time as an ordinary rollout has: arrays of all of them at once take eight times the
        memory, 29 MB for what Real2Sim predicts of a pancake, which nothing needs again for minutes.
        """
        steps, at_once = len(actions.velocity), math.ceil(len(actions.velocity) / FINER)
        state, q, v = start, [start.q[None]], [start.v[None]]
        for first in range(0, steps, at_once):
            part = slice(first, first + at_once)
            finer = PhysicsAction(
                actions.velocity[part].repeat_interleave(FINER, dim=0),
                actions.wrench[part].repeat_interleave(FINER, dim=0),
            )
            path = self._finer.rollout(state, finer, parameters)
            state = path.at(len(finer.velocity))
            q.append(path.q[FINER::FINER])
            v.append(path.v[FINER::FINER])
        return PhysicsState(torch.cat(q), torch.cat(v))

    def read(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `TaskDynamics`."""
        poses = {}
        first = self._chain.stop
        for name in self._assembly.movable:
            quat = q[first + 3 : first + 7]
            poses[name] = Pose(q[first : first + 3], quat / np.linalg.norm(quat))
            first += 7
        for body in self._assembly.shifted:
            poses[body.name] = Pose(q[first : first + 3], body.body_in_world.quat_xyzw)
            first += 3
        tip = q[:3] + q[3:6] if self._assembly.sprung else q[:3]
        return self._task.values_at(poses, q[self._chain]), tip

    def _repeated(self, batch: int, rest: torch.Tensor) -> PhysicsParameters:
        fields = {
            name: value.expand(batch, *value.shape[1:])
            for name, value in vars(self._parameters).items()
            if name != "joint_rest"
        }
        before = rest.new_zeros((batch, self._chain.start))
        after = rest.new_zeros((batch, len(self.physics.layout.link_of_v) - self._chain.stop))
        slack = torch.cat([before, rest, after], dim=1)
        return replace(self._parameters, **fields, joint_rest=slack)

    def _slack_angles(self, tip: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Angles (2 K,) at which the springs are slack, so that they hold the chain at `angles`."""
        if not len(angles):
            return np.zeros(0)
        chain = self._assembly.chain
        torque = holding_torque(chain, Pose.from_rotation(tip, DOWN), angles, self._gravity)
        stiffness = self._parameters.joint_stiffness[0, self._chain].detach().numpy()
        return angles + torque / stiffness

    def _coordinates(self, pose: Pose) -> np.ndarray:
        """Of a body that rests on the balls of its rim, turned about its own axis: its lowest point lies
        between two balls. On one it would roll off; where a rim's balls are does not show.
        """
        down = pose.rotation[2, :2]  # how fast its x and y axes rise
        spin = np.arctan2(-down[1], -down[0]) - np.pi / self.settings.contact.rim_balls
        turned = pose @ Pose.from_rpy(np.zeros(3), (0.0, 0.0, float(spin)))
        return np.concatenate([turned.position, turned.quat_xyzw])


def _speeds(steps: int, rest: int) -> torch.Tensor:
    """Share of the displacement in each step: the quintic of minimal jerk, then rest."""
    s = torch.linspace(0.0, 1.0, steps + 1, dtype=torch.float64)
    progress = 10 * s**3 - 15 * s**4 + 6 * s**5
    return torch.cat([progress[1:] - progress[:-1], torch.zeros(rest, dtype=torch.float64)])
