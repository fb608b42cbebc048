"""One formula with many shapes hides several plain ones: sets that grow from another start."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from samrl_core.diagnosis.effects.friction.coulomb_friction import EFFECT as COULOMB
from samrl_core.diagnosis.effects.friction.load_dependent_friction import EFFECT as LOAD
from samrl_core.diagnosis.effects.friction.stribeck_friction import EFFECT as STRIBECK
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.other_starts import explains_more, in_plain_terms, simplest
from samrl_core.diagnosis.selection.selection import Selection
from tests.diagnosis.controllers.kinds import VELOCITY_DRIVE
from tests.diagnosis.controllers.machines import Differs, worlds


def leaving(members: int, evidence: float, fitted: float, unseen: float, shapes: int = 0) -> Selection:
    """A selection of as many members, each with one amplitude and as many shapes."""
    form = SimpleNamespace(amplitudes=("a",), refine=dict.fromkeys(map(str, range(shapes)), (0.1, 1.0)))
    h = SimpleNamespace(form=form, shape={}, effect=SimpleNamespace(parameters=(), renamed_shapes=()))
    chosen = SimpleNamespace(hypotheses=(h,) * members, log_evidence=evidence)
    return cast("Selection", SimpleNamespace(chosen=chosen, remaining=fitted, held_out_remaining=unseen))


@pytest.mark.parametrize(
    ("tried", "better"),
    [
        (leaving(2, 995.0, 102.0, 40.0), True),
        (leaving(1, 995.0, 102.0, 40.0), False),  # a single one has been weighed already
        (leaving(2, 970.0, 102.0, 40.0), False),  # clearly less evidence
        (leaving(2, 995.0, 120.0, 40.0), False),  # leaves more of what was fitted
        (leaving(2, 995.0, 102.0, 60.0), False),  # unseen recordings say little
    ],
)
def test_unseen_recordings_speak_for_a_larger_set(tried: Selection, better: bool) -> None:
    assert explains_more(tried, leaving(1, 1000.0, 100.0, 100.0), 16.0) is better


def test_a_small_unseen_remainder_says_nothing() -> None:
    assert not explains_more(leaving(2, 1000.0, 100.0, 2.0), leaving(1, 1000.0, 100.0, 10.0), 16.0)


def test_of_several_sets_the_simplest_is_taken_unless_another_leaves_clearly_less() -> None:
    found = leaving(1, 1000.0, 100.0, 180.0, shapes=5)
    rich, plain = leaving(2, 1005.0, 90.0, 58.0, shapes=4), leaving(2, 995.0, 97.0, 69.0)
    assert simplest(found, [rich, plain], 16.0) is plain
    assert simplest(found, [rich, leaving(2, 995.0, 97.0, 80.0)], 16.0) is rich
    assert simplest(found, [leaving(2, 995.0, 97.0, 170.0)], 16.0) is found


def test_a_drop_that_has_become_nothing_leaves_coulomb_friction() -> None:
    (recordings,) = worlds(VELOCITY_DRIVE, [Differs(coulomb=0.3)], 3, 4.0)
    trials, _ = arm_trials(recordings, [])
    evidence = Evidence(Likelihood(trials), 2.0)
    pool = evidence.screen([COULOMB, STRIBECK, LOAD])

    def best(family: str) -> int:
        fits = [(evidence.fit([h]).log_evidence, k) for k, h in enumerate(pool) if h.effect.family == family]
        return max(fits)[1]

    drop, load = pool[best("stribeck_friction")], pool[best("load_dependent_friction")]
    plain = in_plain_terms(evidence, pool, evidence.fit([drop, load]))
    assert [h.effect.family for h in plain.hypotheses] == ["coulomb_friction", "load_dependent_friction"]
    alone = evidence.fit([drop])
    assert in_plain_terms(evidence, pool, alone) is alone
