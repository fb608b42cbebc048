"""Nimble's chain, the paper's simulator. It needs numpy < 2, so it runs in an environment of its own:

    python nimble_chain.py '{"links": 10, ...}'   (called by `samrl_core.studies.speed.physics_peers`)

The argument is JSON: links, length and mass of each [m], [kg], its inertia (3, 3) [kg m^2], damping
[N m s/rad], step_s [s], the start q and v [rad], [rad/s], and how many steps and rounds.

Imports nothing of this project. Prints seconds of forward, and of forward and backward, per step, as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from statistics import median

import nimblephysics as nimble
import numpy as np
import torch


def build(n: dict) -> nimble.simulation.World:
    """The chain of `n`: links, length, mass, inertia, damping, step."""
    world = nimble.simulation.World()
    world.setGravity(np.array([0.0, 0.0, -9.81]))
    world.setTimeStep(n["step_s"])
    skeleton = nimble.dynamics.Skeleton()
    parent = None
    for i in range(n["links"]):
        for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
            joint, body = skeleton.createRevoluteJointAndBodyNodePair(parent)
            joint.setAxis(np.array(axis))
            joint.setDampingCoefficient(0, n["damping"])
            if axis[0] and i:
                shift = nimble.math.Isometry3()
                shift.set_translation(np.array([0.0, 0.0, -n["length"]]))
                joint.setTransformFromParentBodyNode(shift)
            if axis[0]:
                inertia = (1e-6, np.zeros(3), 1e-9 * np.eye(3))
            else:
                inertia = (n["mass"], np.array([0.0, 0.0, -n["length"] / 2]), np.array(n["inertia"]))
            body.setInertia(nimble.dynamics.Inertia(*inertia))
            parent = body
    world.addSkeleton(skeleton)
    return world


def main() -> None:
    """Time it."""
    n = json.loads(sys.argv[1])
    torch.set_num_threads(1)
    world = build(n)
    start = torch.tensor(np.concatenate([n["q"], n["v"]]))
    nothing = torch.zeros(world.getActionSize(), dtype=torch.float64)

    def forward() -> torch.Tensor:
        world.setState(start.numpy())
        for _ in range(n["steps"]):
            world.step()
        return torch.tensor(world.getState())

    def both() -> None:
        state = start.clone().requires_grad_(True)
        now = state
        for _ in range(n["steps"]):
            now = nimble.timestep(world, now, nothing)
        now.sum().backward()

    result = {}
    for name, work in (("forward", forward), ("both", both)):
        work()
        taken = []
        for _ in range(n["rounds"]):
            begin = time.perf_counter()
            work()
            taken.append((time.perf_counter() - begin) / n["steps"])
        result[name] = median(taken)
    result["last"] = forward().tolist()
    print(json.dumps(result))


if __name__ == "__main__":
    main()
