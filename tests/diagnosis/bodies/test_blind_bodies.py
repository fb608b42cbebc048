"""Bodies that SciPy, MuJoCo and PyBullet move, with random causes, sizes, backgrounds and trackers."""

from __future__ import annotations

from collections import Counter

import pytest

from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.kinds.bodies.body_tracks import split_bodies
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis.bodies.blind_bodies import SHOWN, UNKNOWN, Case, draw, right

SEEDS = range(70, 80)


def told(case: Case) -> Diagnosis:
    fit, held_out, _ = split_bodies(list(case.recordings))
    return diagnose(fit, held_out)[0]


def is_right(case: Case, d: Diagnosis) -> bool:
    ambiguous = d.ambiguity_set[0] if d.ambiguity_set else ()
    families = tuple(name.partition("@")[0] for name in ambiguous)
    return right(case, d.verdict, tuple(e.family for e in d.effects), families)


LONGER = [("none", 0), ("base_tilt", 3), ("drag", 0), ("rate", 4)]


@pytest.mark.parametrize(
    "cause, seed",
    [("contact_friction", 0), *(pytest.param(*case, marks=pytest.mark.thorough) for case in LONGER)],
)
def test_a_body_in_another_engine_is_told(cause: str, seed: int) -> None:
    case = draw(cause, seed)
    assert is_right(case, told(case)), case.setting


@pytest.mark.slow
def test_blind_bodies_are_told_or_refused() -> None:
    counts: Counter[str] = Counter()
    covered: Counter[bool] = Counter()
    for cause in SHOWN:
        for seed in SEEDS:
            case = draw(cause, seed)
            d = told(case)
            good = is_right(case, d)
            group = "none" if cause == "none" else "unknown" if cause in UNKNOWN else "known"
            counts[group] += 1
            counts[f"{group} right"] += good
            counts["named wrong"] += d.verdict == "effect" and not good
            name = {"contact_friction": "mu", "contact_stiffness": "e"}.get(cause)
            if good and name is not None:
                low, high = d.effects[0].parameters[name].ci95
                covered[low <= case.size <= high] += 1
    print(dict(counts), dict(covered))
    assert counts["none right"] == counts["none"]
    assert counts["known right"] >= 0.85 * counts["known"]
    assert counts["unknown right"] >= 0.8 * counts["unknown"]
    assert counts["named wrong"] <= 0.03 * (counts["known"] + counts["unknown"])
    assert covered[True] >= 0.8 * sum(covered.values())
