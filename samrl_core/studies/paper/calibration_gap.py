"""How far the calibration must be off until the nominal actions fail: there a residual can show its worth.

The world that differs is one that Algorithm 1 without a residual may well succeed in, for it is closed over
the images. So the camera arm's base is moved off from where the calibration has it, step by step along one
way, unknown to the model; all that the camera shows is then off by as much, from every view alike. What is
taken is the smallest error at which the zero residual succeeds in at most a share of episodes; where none of
those tried is large enough, the largest. It is chosen before anything is trained, on scenes of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from samrl_core.common.statistics import Share
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Play, Played
from samrl_core.studies.experiment import Case, CaseLog, Progress

LADDER = (0.0, 0.002, 0.004, 0.005, 0.006, 0.008, 0.012, 0.016)  # lengths of the error [m]
# ASSUMPTION: mostly level, as hole, eye and pancake are found level, and downwards for the spatula's height.
DIRECTION = (0.48, 0.64, -0.6)
EPISODES = 12  # per length
AT_MOST = 0.75  # success of the zero residual: some is needed, its reward is what is learnt from
_GAP = 3  # first of what these scenes' seeds are made of; 1 and 2 are a run's


def gaps(
    log: CaseLog, sites: Sequence[EpisodeSite], play: Play, progress: Progress, processes: int = 1
) -> dict[str, dict[str, Any]]:
    """For each site's task the error that is taken, and what it was chosen by.

    Args:
        log: keeps each episode as a case; known ones are not played again.
        sites: one per task, without an error.
        play: plays episodes.
        progress: called with what was chosen.
        processes: that it plays in; where they can play several lengths at once they do, and some may turn
            out not to have been needed. What is taken is the same.

    Returns:
        By task: "length" [m], "offset" (3,) in world [m], and the "success" per length that was tried.
    """
    found: dict[str, dict[str, Any]] = {site.task: {"success": {}} for site in sites}
    lengths = list(LADDER)
    while lengths and (open_ := [site for site in sites if "length" not in found[site.task]]):
        at_once = max(1, processes // (len(open_) * EPISODES))
        tried, lengths = lengths[:at_once], lengths[at_once:]
        wanted = [(site, length, k) for length in tried for site in open_ for k in range(EPISODES)]
        left = [one for one in wanted if _key(*one) not in log.cases]
        for one, played in zip(left, play([_order(*one) for one in left]), strict=True):
            log.keep(_case(*one, played))
        for site, length in product(open_, tried):
            if "length" not in found[site.task]:
                _choose_length(found[site.task], log, site, length, progress)
    return found


def _choose_length(
    entry: dict[str, Any], log: CaseLog, site: EpisodeSite, length: float, progress: Progress
) -> None:
    share = Share.of([log.cases[_key(site, length, k)]["success"] for k in range(EPISODES)])
    entry["success"][f"{1e3 * length:g} mm"] = share.as_dict()
    if (share.value or 0.0) <= AT_MOST or length == LADDER[-1]:
        entry |= {"length": length, "offset": list(offset_of(length))}
        progress(f"{site.task}: calibration off by {1e3 * length:g} mm, zero residual {share.value}")


def offset_of(length: float) -> tuple[float, float, float]:
    """The error (3,) in world [m]."""
    x, y, z = (length * part for part in DIRECTION)
    return x, y, z


def _key(site: EpisodeSite, length: float, number: int) -> str:
    return f"gap/{site.task}/{1e3 * length:g}mm/{number}"


def _order(site: EpisodeSite, length: float, number: int) -> Order:
    seed = int(np.random.SeedSequence([_GAP, number]).generate_state(1)[0] >> 1)
    return Order(replace(site, offset=offset_of(length)), seed, site.max_actions, {}, 0.003)


def _case(site: EpisodeSite, length: float, number: int, played: Played) -> Case:
    return {
        "key": _key(site, length, number),
        "task": site.task,
        "length": length,
        "success": played.success,
        "detected": played.ended == "done",
        "actions": len(played.steps),
        "final_error": played.final_error,
        "why": played.why,
    }
