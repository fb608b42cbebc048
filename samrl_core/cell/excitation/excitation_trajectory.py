"""The three excitation trajectories, and with which share of the controller's gains each is played."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.excitation.clearance import ArmLine
from samrl_core.cell.excitation.limits import check_trajectory
from samrl_core.cell.excitation.multisine import multisine
from samrl_core.cell.excitation.slow_sweep import slow
from samrl_core.cell.excitation.task_motion import task_motion
from samrl_core.cell.excitation.workspace import WorkBox, work_box
from samrl_core.cell.robots.arm_model import Payload
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_description import ArmController
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError, LimitError

SETS = {"A": "slow", "B": "multisine", "C": "task"}
_TRIES = 12
_SHRINK = 0.85


@dataclass(frozen=True)
class GainScale:
    """Shares of the nominal stiffness and damping."""

    stiffness: float = 1.0
    damping: float = 1.0


def gains(kind: str) -> GainScale:
    """Gains at which a set is recorded: the held-out one is softer, near-equal in damping ratio."""
    if kind not in SETS.values():
        raise InputError(f"no set is called '{kind}'; there are {sorted(SETS.values())}")
    return GainScale(0.6, 0.8) if kind == "task" else GainScale()


def make_trajectory(
    spec: RobotSpec,
    payload: Payload | None,
    kind: str,
    seed: int | np.random.Generator,
    duration_s: float,
    period_s: float = ArmController.period_s,
) -> JointSignal:
    """An excitation trajectory for an arm: what it is commanded over time, from rest to rest.

    Args:
        spec: the arm, whose foot stands on the table's top.
        payload: what it carries.
        kind: `slow` (set A), `multisine` (set B) or `task` (set C, held out).
        seed: of all random numbers.
        duration_s: 10 to 20 s shows all that a set is for; 1 s is the least.
        period_s: of the controller.

    Returns:
        Position, velocity and acceleration (N, J); feed-forward torque zero.

    Raises:
        InputError: no such kind, or a length that is refused.
        LimitError: nothing inside the arm's limits was found.
    """
    # A stream of its own for each kind: the held-out poses are not those of set A.
    number = sum(kind.encode())
    rng = seed if isinstance(seed, np.random.Generator) else np.random.default_rng([number, seed])
    box = work_box(spec, payload)
    model = ArmLine(spec, payload).model
    makers: dict[str, Callable[[WorkBox, float], JointSignal]] = {
        "slow": lambda b, vigour: slow(spec, model, b, rng, duration_s, period_s),
        "multisine": lambda b, vigour: multisine(spec, b, rng, duration_s, period_s, vigour=vigour),
        "task": lambda b, vigour: task_motion(spec, b, rng, duration_s, period_s, vigour=vigour),
    }
    if kind not in makers:
        raise InputError(f"no excitation trajectory is called '{kind}'; there are {', '.join(makers)}")
    return within_limits(spec, payload, box, makers[kind])


def within_limits(
    spec: RobotSpec, payload: Payload | None, box: WorkBox, make: Callable[[WorkBox, float], JointSignal]
) -> JointSignal:
    """The first motion within all limits, sampled anew in an ever smaller box and with smaller amplitudes.

    Raises:
        LimitError: none may, with the reason of the last.
    """
    factor = 1.0
    for attempt in range(_TRIES):
        command = make(box.shrunk(factor), factor)
        try:
            check_trajectory(spec, payload, command)
        except LimitError:
            if attempt == _TRIES - 1:
                raise
            factor *= _SHRINK if attempt % 2 else 1.0  # once more by luck, then smaller
            continue
        return command
    raise AssertionError("unreachable")
