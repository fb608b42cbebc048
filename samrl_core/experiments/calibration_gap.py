"""How far the calibration must be off until the nominal actions fail: there a residual can show its worth.

The world that differs is one that Algorithm 1 without a residual may well succeed in, for it is closed over
the images. So the camera arm's base is moved off from where the calibration has it, step by step along one
way, with nobody told; all that the camera shows is then off by as much, from every view alike. What is taken
is the smallest error at which the zero residual succeeds in at most a share of episodes. It is chosen before
anything is trained, on scenes of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from samrl_core.experiments.experiment import Case, CaseLog, Tell, run_cases
from samrl_core.experiments.residual_episodes import Order, Place, play
from samrl_core.types.share import Share

LADDER = (0.0, 0.002, 0.003, 0.004, 0.005, 0.006, 0.008)  # lengths of the error [m]
# ASSUMPTION: mostly level, as hole, eye and pancake are found level, and downwards for the spatula's height.
DIRECTION = (0.48, 0.64, -0.6)
EPISODES = 12  # per length
AT_MOST = 0.6  # success of the zero residual
_GAP = 3  # first of what these scenes' seeds are made of; 1 and 2 are a run's


@dataclass(frozen=True)
class _Job:
    place: Place
    length: float
    key: str
    seed: int


def gaps(log: CaseLog, places: Sequence[Place], workers: int, tell: Tell) -> dict[str, dict[str, Any]]:
    """For each place's task the error that is taken, and what it was chosen by.

    Returns:
        By task: "length" [m], "offset" (3,) in world [m], and per length of the ladder the "success".
    """
    jobs = [
        _Job(
            replace(place, offset=offset_of(length)),
            length,
            f"gap/{place.task}/{1e3 * length:g}mm/{k}",
            int(np.random.SeedSequence([_GAP, k]).generate_state(1)[0] >> 1),
        )
        for place in places
        for length in LADDER
        for k in range(EPISODES)
    ]
    cases = run_cases(log, _episode, [((job.key,), job) for job in jobs], workers, tell)
    found: dict[str, dict[str, Any]] = {}
    for place in places:
        mine = [c for c in cases if c["task"] == place.task]
        success = {n: Share.of([c["success"] for c in mine if c["length"] == n]) for n in LADDER}
        length = chosen({n: share.value or 0.0 for n, share in success.items()})
        found[place.task] = {
            "length": length,
            "offset": list(offset_of(length)),
            "success": {f"{1e3 * n:g} mm": share.as_dict() for n, share in success.items()},
        }
        tell(f"{place.task}: calibration off by {1e3 * length:g} mm, zero residual {success[length].value}")
    return found


def chosen(success: dict[float, float]) -> float:
    """The smallest length with a success of at most `AT_MOST`; where there is none, the largest."""
    return min((n for n, rate in success.items() if rate <= AT_MOST), default=max(success))


def offset_of(length: float) -> tuple[float, float, float]:
    """The error (3,) in world [m]."""
    x, y, z = (length * part for part in DIRECTION)
    return x, y, z


def _episode(job: _Job) -> list[Case]:
    played = play(Order(job.place, job.seed, 0, {}, 0.003))
    return [
        {
            "key": job.key,
            "task": job.place.task,
            "length": job.length,
            "success": played.success,
            "detected": played.ended == "done",
            "actions": len(played.steps),
            "final_error": played.final_error,
            "why": played.why,
        }
    ]
