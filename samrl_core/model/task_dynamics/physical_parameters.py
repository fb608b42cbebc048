"""Physical parameters that a task's model can have that differ from its scene's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import torch

from samrl_core.common.errors import InputError
from samrl_core.model.task_dynamics.rigid_task_dynamics import TaskPhysics
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics

FRICTION, MASS, STIFFNESS = "friction", "mass", "stiffness"


def parameters_of(dynamics: TaskDynamics) -> tuple[str, ...]:
    """Their names: friction of all contacts, mass of what can be moved, stiffness of the tool's chain.

    Closed forms have none.
    """
    if not isinstance(dynamics, TaskPhysics):
        return ()
    there = {FRICTION: dynamics.parameters.friction.numel(), MASS: len(dynamics.movable_bodies)}
    there[STIFFNESS] = len(dynamics.chain_joints)
    return tuple(name for name, count in there.items() if count)


def with_factors(dynamics: TaskDynamics, factors: Mapping[str, float]) -> TaskDynamics:
    """The same task with parameters multiplied; compiled kernels are shared.

    Args:
        dynamics: with the scene's own parameters.
        factors: above 0, by name; 1 for those that are left out.

    Raises:
        InputError: a parameter that the task's model does not have, or a factor that is none.
    """
    if not factors:
        return dynamics
    unknown = sorted(set(factors) - set(parameters_of(dynamics)))
    if unknown or not isinstance(dynamics, TaskPhysics):
        there = ", ".join(parameters_of(dynamics)) or "none"
        raise InputError(f"the model cannot vary {', '.join(unknown)}; it has: {there}")
    for name, factor in factors.items():
        if not (math.isfinite(factor) and factor > 0.0):
            raise InputError(f"factor on {name} is {factor}, must be above 0")
    own = dynamics.parameters
    bodies = torch.ones_like(own.mass)
    bodies[:, list(dynamics.movable_bodies)] = factors.get(MASS, 1.0)
    joints = torch.ones_like(own.joint_stiffness)
    joints[:, list(dynamics.chain_joints)] = factors.get(STIFFNESS, 1.0)
    return dynamics.with_parameters(
        replace(
            own,
            mass=own.mass * bodies,
            inertia=own.inertia * bodies[..., None, None],
            joint_stiffness=own.joint_stiffness * joints,
            friction=own.friction * factors.get(FRICTION, 1.0),
        )
    )
