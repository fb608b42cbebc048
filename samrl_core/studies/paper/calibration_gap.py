"""How far the calibration must be off until the nominal actions fail: there a residual can show its worth.

The world that differs is one that Algorithm 1 without a residual may well succeed in, for it is closed over
the images. So the camera arm's base is moved off from where the calibration has it, step by step along one
way, with nobody told; all that the camera shows is then off by as much, from every view alike. What is taken
is the smallest error at which the zero residual succeeds in at most a share of episodes; where none of those
tried is large enough, the largest. It is chosen before anything is trained, on scenes of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from samrl_core.common.statistics import Share
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Play, Played
from samrl_core.studies.experiment import Case, CaseLog, Tell

LADDER = (0.0, 0.002, 0.004, 0.005, 0.006, 0.008, 0.012, 0.016)  # lengths of the error [m]
# ASSUMPTION: mostly level, as hole, eye and pancake are found level, and downwards for the spatula's height.
DIRECTION = (0.48, 0.64, -0.6)
EPISODES = 12  # per length
AT_MOST = 0.75  # success of the zero residual: some is needed, its reward is what is learnt from
_GAP = 3  # first of what these scenes' seeds are made of; 1 and 2 are a run's


def gaps(
    log: CaseLog, places: Sequence[EpisodeSite], play: Play, tell: Tell, processes: int = 1
) -> dict[str, dict[str, Any]]:
    """For each place's task the error that is taken, and what it was chosen by.

    Args:
        log: keeps each episode as a case; known ones are not played again.
        places: one per task, without an error.
        play: plays episodes.
        tell: hears what was taken.
        processes: that it plays in; where they can play several lengths at once they do, and some may turn
            out not to have been needed. What is taken is the same.

    Returns:
        By task: "length" [m], "offset" (3,) in world [m], and the "success" per length that was tried.
    """
    found: dict[str, dict[str, Any]] = {place.task: {"success": {}} for place in places}
    lengths = list(LADDER)
    while lengths and (open_ := [place for place in places if "length" not in found[place.task]]):
        at_once = max(1, processes // (len(open_) * EPISODES))
        tried, lengths = lengths[:at_once], lengths[at_once:]
        wanted = [(place, length, k) for length in tried for place in open_ for k in range(EPISODES)]
        left = [one for one in wanted if _key(*one) not in log.cases]
        for one, played in zip(left, play([_order(*one) for one in left]), strict=True):
            log.keep(_case(*one, played))
        for place, length in product(open_, tried):
            if "length" not in found[place.task]:
                _judge(found[place.task], log, place, length, tell)
    return found


def _judge(entry: dict[str, Any], log: CaseLog, place: EpisodeSite, length: float, tell: Tell) -> None:
    share = Share.of([log.cases[_key(place, length, k)]["success"] for k in range(EPISODES)])
    entry["success"][f"{1e3 * length:g} mm"] = share.as_dict()
    if (share.value or 0.0) <= AT_MOST or length == LADDER[-1]:
        entry |= {"length": length, "offset": list(offset_of(length))}
        tell(f"{place.task}: calibration off by {1e3 * length:g} mm, zero residual {share.value}")


def offset_of(length: float) -> tuple[float, float, float]:
    """The error (3,) in world [m]."""
    x, y, z = (length * part for part in DIRECTION)
    return x, y, z


def _key(place: EpisodeSite, length: float, number: int) -> str:
    return f"gap/{place.task}/{1e3 * length:g}mm/{number}"


def _order(place: EpisodeSite, length: float, number: int) -> Order:
    seed = int(np.random.SeedSequence([_GAP, number]).generate_state(1)[0] >> 1)
    return Order(replace(place, offset=offset_of(length)), seed, place.max_actions, {}, 0.003)


def _case(place: EpisodeSite, length: float, number: int, played: Played) -> Case:
    return {
        "key": _key(place, length, number),
        "task": place.task,
        "length": length,
        "success": played.success,
        "detected": played.ended == "done",
        "actions": len(played.steps),
        "final_error": played.final_error,
        "why": played.why,
    }
