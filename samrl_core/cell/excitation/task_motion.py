"""Set C: point-to-point motion as in a task, for recordings that are held out."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.excitation.signal import (
    closing_rest,
    from_velocity,
    minimum_jerk_length,
    minimum_jerk_velocity,
    sample_times,
)
from samrl_core.cell.excitation.workspace import WorkBox
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_recording import JointSignal

_VELOCITY_SHARE = 0.45
_ACCELERATION_SHARE = 0.45
_FINE = 0.08  # of an approach, per joint [rad]
_FINE_SPEED = 0.15  # [rad/s]
_REST_S = 0.2  # before the motion [s]


def task_motion(
    spec: RobotSpec,
    box: WorkBox,
    rng: np.random.Generator,
    duration_s: float,
    period_s: float,
    joints: np.ndarray | None = None,
    vigour: float = 1.0,
) -> JointSignal:
    """Minimum-jerk transfers to the outer parts of the box, each followed by a short slow approach."""
    time = sample_times(duration_s, period_s)
    move = np.ones(len(spec.joint_names), bool) if joints is None else joints
    speed = vigour * _VELOCITY_SHARE * spec.limits.velocity
    acceleration = vigour * _ACCELERATION_SHARE * spec.limits.acceleration
    start = box.sample(rng, 1, share=0.5)[0]
    position, now = start.copy(), _REST_S
    velocity = np.zeros((len(time), len(start)))
    transfer = True
    end = duration_s - closing_rest(duration_s)
    while (left := end - now) > 0.3:
        if transfer:
            signs = rng.choice([-1.0, 1.0], len(start))
            goal = box.center + signs * rng.uniform(0.3, 1.0, len(start)) * 0.95 * box.half_width
            way = np.where(move, goal - position, 0.0)
            needed = minimum_jerk_length(way, speed, acceleration) * rng.uniform(1.0, 1.6)
        else:
            inward = np.sign(box.center - position)
            way = np.where(move, inward * rng.uniform(0.3, 1.0, len(start)) * _FINE, 0.0)
            slow = np.full(len(start), _FINE_SPEED)
            needed = minimum_jerk_length(way, slow, acceleration)
        needed = max(needed, 0.2)
        if needed > left:  # the last one: as far as time allows
            way, needed = way * (left / needed) ** 2, left
        velocity += minimum_jerk_velocity(time, now, needed, way)
        position = position + way
        now += needed + rng.uniform(0.1, 0.4)
        transfer = not transfer
    return from_velocity(time, velocity, start)
