"""The whole loop without ROS: images and joints in, actions out, judged by truth at the end.

`python -m tests.policy.planning.from_images spatula_flipping 0 1 2` prints a line per seed. The camera stays
where an episode starts; nothing but sensors is read before the end.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.evaluation import ending_now
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.tool_motion import move_joints
from samrl_core.model.model import Model
from samrl_core.model.real2sim.prediction import likeliest, predictions
from samrl_core.model.real2sim.real2sim import Real2Sim, initial_estimate
from samrl_core.policy.planning.trajectory import TrajectorySettings, optimise
from samrl_core.studies.episodes.cell_driver import CellDriver
from tests.cell.world.scripted_expert import DOWN

PAUSE_S = 0.3  # between an action and the next image, as the model's own `rest_s`
LEASH = 0.01  # the commanded tip stays this near to the measured one, as the manipulator's [m]


@dataclass(frozen=True)
class Outcome:
    """What became of one episode."""

    success: bool  # by truth
    detected: bool  # by the estimate
    actions: int
    error: float  # [m]
    peak_force: float  # [N]
    update_s: float  # processor time of an update, mean [s]
    plan_s: float  # processor time of a plan, mean [s]


def solve(name: str, seed: int) -> Outcome:
    """One episode."""
    task, cell = task_named(name), cell_named()
    tool = task.scene(cell).tool
    world = PyBulletWorld(task, cell)
    driver = CellDriver(world, cell, tool)
    arm = ArmModel(
        cell.tool_arm, cell.tool_base_in_world, Payload(tool.mass, tool.center_of_mass, tool.inertia)
    )
    model = Model(task, cell)
    model.dynamics.prepare()
    real2sim, dynamics, limits = Real2Sim(model), model.dynamics, TrajectorySettings(max_sub_goals=3)
    world.reset(seed)
    estimate, before = initial_estimate(model), None
    commanded = world.read_arm("tool_arm").position
    spent = {"update": 0.0, "plan": 0.0}
    detected, actions = False, 0
    while True:
        for _ in range(round(PAUSE_S * 1e3)):
            world.advance()
        observation = driver.observe()
        tip = model.tip_in_base(observation.tool_arm.position).position
        start = time.process_time()
        priors = (estimate,)
        if before is not None:
            priors = predictions(dynamics, task.parameters(), estimate, before, tip)
        estimate, before = likeliest([real2sim.update(prior, observation) for prior in priors]), tip
        spent["update"] += time.process_time() - start
        detected = task.is_done(estimate.values, tip)
        if detected or actions == task.max_actions:
            break
        start = time.process_time()
        plan = optimise(dynamics, task, dynamics.start(estimate.values, tip), limits)
        spent["plan"] += time.process_time() - start
        step = plan.actions[0] if len(plan.actions) else np.zeros(3)
        lead = (arm.flange_in_base(commanded) @ tool.tip_in_flange).position - tip
        lead *= min(1.0, LEASH / max(float(np.linalg.norm(lead)), 1e-9))
        flange = Pose.from_rotation(tip + lead + step, DOWN) @ tool.tip_in_flange.inverse()
        end = solve_ik(arm, flange, commanded)
        move_joints(world, arm, commanded, end, 100)
        commanded, actions = end, actions + 1
    for _ in range(500):
        world.advance()
    truth = world.truth()
    ending = ending_now(truth)
    world.close()
    count = max(1, actions)
    return Outcome(
        task.succeeded(ending),
        detected,
        actions,
        task.final_error(ending),
        truth.peak_contact_force,
        spent["update"] / (actions + 1),
        spent["plan"] / count,
    )


if __name__ == "__main__":
    torch.set_num_threads(1)
    for number in sys.argv[2:]:
        print(number, solve(sys.argv[1], int(number)), flush=True)
