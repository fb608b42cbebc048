"""Starts and actions in which contact is made, slides, stops, is broken, wedges and threads."""

from __future__ import annotations

import numpy as np
import physics_scenes as scenes
import torch
from gradient_check import Case

from samrl_core.model.physics.layout import lay_out
from samrl_core.model.physics.scene import PhysicsScene
from samrl_core.studies.speed import physics_scenes as common

SAG = 0.1 * 9.81 / (8 * 5e3)  # how far the disc of 0.1 kg sinks in on eight points [m]


def case(scene: PhysicsScene, q: np.ndarray, v: np.ndarray, steps: int, velocity: np.ndarray | None) -> Case:
    """A case with constant action and no wrench."""
    actions = torch.zeros((steps, lay_out(scene).actions), dtype=torch.float64)
    if velocity is not None:
        actions[:] = torch.as_tensor(velocity)
    wrench = torch.zeros((steps, len(scene.bodies), 6), dtype=torch.float64)
    return Case(scene, torch.as_tensor(q), torch.as_tensor(v), actions, wrench)


def disc(steps: int, height: float, speed: float, lift: float = 0.0) -> Case:
    q = np.array([0.0, 0.0, 0.01 - SAG + height, 0.0, 0.0, 0.0, 1.0])
    made = case(common.disc_on_plane(), q, np.array([speed, 0, 0, 0, 0, 0.3]), steps, None)
    if lift:
        made.wrench[steps // 2 :, 0, 2] = lift
    return made


def peg(steps: int, offset: float, height: float, tilt: float = 0.0) -> Case:
    """Tip `height` above the block's top, moved down at 0.15 m/s, `offset` beside the axis."""
    down = np.array([0.0, 0.0, -0.15, 0, 0, 0])
    q = np.zeros(19)
    q[:7] = [offset, 0, 0.04 + height + 0.06, 0, np.sin(tilt / 2), 0, np.cos(tilt / 2)]
    q[12:] = [0, 0, 0.02, 0, 0, 0, 1]
    v = np.concatenate([down, np.zeros(11)])
    return case(scenes.peg_in_hole(), q, v, steps, np.concatenate([down, np.zeros(6)]))


def thread(steps: int) -> Case:
    """A bent thread lowered into the eye, touching its rim."""
    q = np.zeros(27)
    q[:7] = [0.006, 0, 0.108, 0, 0, 0, 1]
    q[7:] = np.radians(np.random.default_rng(1).uniform(-5, 5, 20))
    move = np.array([-0.01, 0, -0.12, 0, 0, 0])
    return case(scenes.thread_in_eye(), q, np.concatenate([move, np.zeros(20)]), steps, move)


def push(steps: int) -> Case:
    """The blade's edge meets the resting pancake's side and pushes it along."""
    q = np.array([-0.099, 0, 0.003, 0, 0, 0, 1, 0, 0, 0.006, 0, 0, 0, 1])
    move = np.array([0.1, 0, 0, 0, 0, 0.0])
    return case(scenes.spatula_and_pancake(), q, np.concatenate([move, np.zeros(6)]), steps, move)


def lift(steps: int) -> Case:
    """The blade lifts the pancake off the table and tilts, so that it begins to slide."""
    q = np.array([0, 0, -0.0011, 0, 0, 0, 1, 0, 0, 0.006, 0, 0, 0, 1])
    move = np.array([0, 0, 0.1, 0, -0.5, 0.0])
    return case(scenes.spatula_and_pancake(), q, np.concatenate([move, np.zeros(6)]), steps, move)


CASES = {
    "sliding": lambda: disc(24, 0.0, 0.5),
    "stopping": lambda: disc(72, 0.0, 0.5),
    "making": lambda: disc(24, 0.004, 0.5),
    "breaking": lambda: disc(24, 0.0, 0.5, 3.0),
    "peg against the wall": lambda: peg(40, 0.0025, 0.005),
    "peg on the chamfer": lambda: peg(40, 0.0033, 0.005),
    "peg on the top": lambda: peg(24, 0.006, 0.001),
    "peg jammed": lambda: peg(60, 0.0, 0.003, 0.12),
    "thread in eye": lambda: thread(60),
    "spatula pushes": lambda: push(48),
    "spatula lifts": lambda: lift(48),
}
