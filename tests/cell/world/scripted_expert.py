"""An expert that is told the hole's true place: what the world allows, not what a learner can do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.control.cartesian import LEASH
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.hand import HAND_TCP_Z
from samrl_core.cell.tasks.peg_insertion.task import BODY, PegInsertion
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.evaluation import ending_now
from samrl_core.cell.world.tool_motion import move_joints
from samrl_core.cell.world.world import SimulatedWorld

DOWN = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Episode:
    """What became of one episode."""

    success: bool
    done: bool
    actions: int
    peak_force: float  # [N]
    error: float  # [m]


def tool_model(task: PegInsertion, cell: CellSpec) -> ArmModel:
    """The tool arm with the task's tool."""
    tool = task.scene(cell).tool
    return ArmModel(
        cell.tool_arm, cell.tool_base_in_world, Payload(tool.mass, tool.center_of_mass, tool.inertia)
    )


def insert(
    world: SimulatedWorld,
    task: PegInsertion,
    model: ArmModel,
    seed: int,
    *,
    noise: float = 0.0,
    period_s: float = 0.2,
    misled: np.ndarray | None = None,
) -> Episode:
    """One episode, an action each `period_s`.

    `noise` is relative to the action's length; `misled` (2,) [m] is added to what the expert is told.
    """
    world.reset(seed)
    rng = np.random.default_rng(1000 + seed)
    reach = HAND_TCP_Z + task.peg_length
    hole = world.truth().body_position[BODY][:2] + (np.zeros(2) if misled is None else misled)
    offset = np.array([0.0, 0.0, -reach])  # flange to tip, pointing down
    commanded = world.read_arm("tool_arm").position
    target = model.flange_in_base(commanded).position + offset
    done, actions = False, 0
    while actions < task.max_actions:
        flange = model.flange_in_base(world.read_arm("tool_arm").position)
        tip = flange.apply(np.array([0.0, 0.0, reach]))
        goals = task.sub_goals(hole, tip)
        if not goals:
            done = True
            break
        actions += 1
        step = goals[0].tip_position - tip
        length = float(np.linalg.norm(step))
        step = step * min(1.0, goals[0].max_step / max(length, 1e-9))
        step = step + noise * np.linalg.norm(step) * rng.standard_normal(3)
        target = target + step
        target = tip + np.clip(target - tip, -LEASH, LEASH)
        end = solve_ik(model, Pose.from_rotation(target - offset, DOWN), commanded)
        move_joints(world, model, commanded, end, round(period_s * 1e3))
        commanded = end
    truth = world.truth()
    ending = ending_now(truth)
    return Episode(
        task.succeeded(ending),
        done,
        actions,
        truth.peak_contact_force,
        task.final_error(ending),
    )
