from __future__ import annotations

from typing import Any

import pytest

from samrl_core.blind_test.scores.outcome import Outcome, SealedTruth, Shrinks
from samrl_core.blind_test.scores.page import score_page
from samrl_core.blind_test.scores.scores import all_scores
from samrl_core.blind_test.scores.table import score_rows

CF, VF = "coulomb_friction", "viscous_friction"


def effect(
    family: str, place: str, severity: float = 0.6, onset: float | None = None, **more: Any
) -> dict[str, Any]:
    return {"family": family, "place": place, "form": "T0", "severity": severity, "onset": onset,
            "parameters": {}, **more}  # fmt: skip


def truth(kind: str, *effects: dict[str, Any], scale: float = 1.0, id: str = "w") -> SealedTruth:
    return SealedTruth(id, kind, "pybullet", "tool_arm", effects, scale)


def said(verdict: str, *effects: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"verdict": verdict, "effects": list(effects), "where": [], "unexplained_fraction": 0.1, **more}


def named(
    family: str, place: str, probability: float = 0.9, role: str = "primary", **more: Any
) -> dict[str, Any]:
    return {
        "family": family,
        "place": place,
        "probability": probability,
        "role": role,
        "parameters": {},
        **more,
    }


def single_set() -> list[Outcome]:
    """Six with Coulomb friction at j1: right; wrong place; wrong family; no_gap; ambiguous; crashed."""
    t = truth("single", effect(CF, "joint:j1"))
    return [
        Outcome(t, said("effect", named(CF, "joint:j1")), 10.0),
        Outcome(t, said("effect", named(CF, "joint:j2", 0.6)), 20.0),
        Outcome(
            t,
            said("effect", named(VF, "joint:j1", 0.5), runner_ups=[named(CF, "joint:j1", 0.4, "runner_up")]),
        ),
        Outcome(t, said("no_gap")),
        Outcome(
            t,
            said(
                "ambiguous",
                named(CF, "joint:j1"),
                ambiguity_set=[["coulomb_friction@joint:j1", "backlash@joint:j1"]],
            ),
        ),
        Outcome(t, None, 30.0),
    ]


def test_every_single_world_stays_in_the_denominator() -> None:
    s = all_scores(single_set())
    which = s["which"]
    assert (which["top1_family"]["successes"], which["top1_family"]["trials"]) == (
        2,
        6,
    )  # ambiguous is no top-1
    assert which["top1_family_place"]["successes"] == 1
    assert which["top3_family"]["successes"] == 4  # both right ones, the runner-up, the ambiguous
    assert (which["among_named"]["successes"], which["among_named"]["trials"]) == (2, 3)
    assert (s["detection"]["single"]["successes"], s["detection"]["single"]["trials"]) == (4, 6)
    assert s["place"]["place"]["successes"] == 2  # the wrong family was at the right place
    assert s["verdicts"] == {"ambiguous": 1, "crashed": 1, "effect": 3, "no_gap": 1}
    assert s["runtime"]["median_s"] == 20.0


def test_a_verdict_that_names_nothing_cannot_score_by_its_effects_list() -> None:
    t = truth("single", effect(CF, "joint:j1"))
    for verdict in ("no_gap", "ambiguous", "none_of_mine", "not_testable"):
        scores = all_scores([Outcome(t, said(verdict, named(CF, "joint:j1")))])
        assert scores["which"]["top1_family"]["successes"] == 0


def test_false_alarms_count_crashes_and_are_split_by_background() -> None:
    worlds = [
        Outcome(truth("none"), said("no_gap")),
        Outcome(truth("none"), said("not_testable")),
        Outcome(truth("none", scale=1.8), said("effect", named(CF, "joint:j1"))),
        Outcome(truth("none", scale=1.2), said("none_of_mine")),
        Outcome(truth("none"), None),
    ]
    d = all_scores(worlds)["detection"]
    assert (d["false_alarms"]["successes"], d["false_alarms"]["trials"]) == (3, 5)
    assert (
        d["false_alarms_within_tolerance"]["successes"],
        d["false_alarms_within_tolerance"]["trials"],
    ) == (1, 3)
    assert (
        d["false_alarms_beyond_tolerance"]["successes"],
        d["false_alarms_beyond_tolerance"]["trials"],
    ) == (2, 2)


def test_confusion_has_verdicts_as_columns_and_sums_to_all_worlds() -> None:
    worlds = [*single_set(), Outcome(truth("none"), said("no_gap"))]
    table = all_scores(worlds)["confusion"]
    assert table["rows"] == [CF, "(none)"]
    assert table["columns"] == [CF, VF, "no_gap", "ambiguous", "none_of_mine", "not_testable", "crashed"]
    assert table["counts"] == [[2, 1, 1, 1, 0, 0, 1], [0, 0, 1, 0, 0, 0, 0]]


def test_macro_average_weighs_families_not_worlds() -> None:
    right = Outcome(truth("single", effect(VF, "joint:j1")), said("effect", named(VF, "joint:j1")))
    assert all_scores([*single_set(), right])["which"]["macro_average"] == pytest.approx((2 / 6 + 1) / 2)


def test_refusal_of_unknown_and_known() -> None:
    known = truth("single", effect(CF, "joint:j1"))
    odd = truth("outside", effect("hum", "joint:j1"))
    worlds = [
        Outcome(known, said("effect", named(CF, "joint:j1"), unexplained_fraction=0.1)),
        Outcome(known, said("effect", named(CF, "joint:j1"), unexplained_fraction=0.3)),
        Outcome(odd, said("none_of_mine", unexplained_fraction=0.2)),
        Outcome(odd, said("effect", named(CF, "joint:j1"), unexplained_fraction=0.2)),
        Outcome(odd, said("no_gap", unexplained_fraction=0.9)),
        Outcome(odd, None),
    ]
    left = Outcome(known, said("none_of_mine"), withheld=True)
    r = all_scores(worlds, [left])["refusal"]
    assert (r["unknown_rejected"]["successes"], r["unknown_rejected"]["trials"]) == (2, 5)
    assert (r["outside_rejected"]["successes"], r["outside_rejected"]["trials"]) == (1, 4)
    assert r["known_refused"]["successes"] == 0
    # unknown 1.2, .2, 0, -1, 1.1 against known .1, .3: wins 2 + 1 + 0 + 0 + 2 of 10
    assert r["auroc"] == pytest.approx(0.5)
    assert r["unknown_rejected_at_5_percent"]["successes"] == 2


def test_a_withheld_family_named_is_wrong() -> None:
    t = truth("single", effect(CF, "joint:j1"))
    s = all_scores([], [Outcome(t, said("effect", named(CF, "joint:j1")), withheld=True)])
    assert s["risk_coverage"]["risk"] == 1.0
    assert s["calibration"]["brier"] == pytest.approx(0.81)


def test_calibration_is_of_family_and_place() -> None:
    c = all_scores(single_set())["calibration"]
    assert c["n"] == 3
    assert c["brier"] == pytest.approx((0.01 + 0.36 + 0.25) / 3)
    assert c["ece"] == pytest.approx((0.1 + 0.6 + 0.5) / 3)


def test_two_effects_and_spurious_seconds() -> None:
    t = truth("double", effect(CF, "joint:j1"), effect(VF, "joint:j2"))
    both = said("effect", named(CF, "joint:j1"), named(VF, "joint:j3", role="secondary"))
    one = said("effect", named(VF, "joint:j2"))
    spurious = Outcome(truth("single", effect(CF, "joint:j1")), both)
    s = all_scores([Outcome(t, both), Outcome(t, one), Outcome(t, None), spurious])["two_effects"]
    assert (s["both_families"]["successes"], s["both_families"]["trials"]) == (1, 3)
    assert s["both_with_place"]["successes"] == 0
    assert s["at_least_one"]["successes"] == 2
    assert (s["spurious_second_on_singles"]["successes"], s["spurious_second_on_singles"]["trials"]) == (1, 1)


def test_the_same_family_twice_must_be_named_twice() -> None:
    t = truth("double", effect(CF, "joint:j1"), effect(CF, "joint:j2"))
    s = all_scores([Outcome(t, said("effect", named(CF, "joint:j1")))])["two_effects"]
    assert s["both_families"]["successes"] == 0
    assert s["at_least_one"]["successes"] == 1


def test_intervals_compare_equal_names_and_units_of_right_t0_claims_only() -> None:
    true = {
        "Fc": {"value": 0.5, "unit": "N m"},
        "ve": {"value": 0.01, "unit": "rad/s"},
        "s": {"value": 1, "unit": "1"},
    }
    stated = {
        "Fc": {"value": 0.4, "unit": "N m", "ci95": [0.3, 0.6]},
        "ve": {"value": 0.03, "unit": "rad/s", "ci95": [0.02, 0.04]},
        "s": {"value": 1, "unit": "N m", "ci95": [0, 2]},
        "other": {"value": 1, "unit": "1", "ci95": [0, 2]},
    }
    report = said("effect", named(CF, "joint:j1", parameters=stated))
    right = truth("single", effect(CF, "joint:j1", parameters=true))
    other_form = truth("single", effect(CF, "joint:j1", form="T1", parameters=true))
    i = all_scores([Outcome(right, report), Outcome(other_form, report)])["intervals"]
    assert (i["coverage"]["successes"], i["coverage"]["trials"]) == (1, 2)
    assert i["median_relative_error"] == pytest.approx((0.2 + 2.0) / 2)


def test_onset_error_prefers_the_true_place() -> None:
    t = truth("single", effect(CF, "joint:j1", onset=4.0))
    where = [{"place": "joint:j2", "onset": 9.0}, {"place": "joint:j1", "onset": 4.3}]
    p = all_scores(
        [Outcome(t, said("effect", named(CF, "joint:j1"), where=where)), Outcome(t, said("no_gap"))]
    )["place"]
    assert p["onset_median_error_s"] == pytest.approx(0.3)
    assert (p["onset_within_half_second"]["successes"], p["onset_within_half_second"]["trials"]) == (1, 2)


def test_shrink_of_unnamed_worlds_is_zero_and_the_ratio_keeps_them() -> None:
    t = truth("single", effect(CF, "joint:j1"))
    good = Outcome(t, said("effect", named(CF, "joint:j1")), shrinks=Shrinks(5, 1, 0.5, 0.8, 0.9))
    silent = Outcome(t, said("no_gap"), shrinks=Shrinks(5, 5, 0.5, 0.0, 0.9))
    crashed = Outcome(t, None, detail={"oracle_shrink": 0.9, "oracle_nominal": 5.0, "oracle_effect": 0.5})
    h = all_scores([good, silent, crashed])["how_far"]
    assert h["all"]["shrink"]["mean"] == pytest.approx(0.8 / 3)
    assert h["all"]["ratio"]["n"] == 3
    assert h["all"]["ratio_pooled"] == pytest.approx(0.8 / 2.7)
    assert h["named_right"]["ratio"]["median"] == pytest.approx(0.8 / 0.9)
    assert h["all"]["energy_ratio_pooled"] == pytest.approx((25 - 1) / (3 * (25 - 0.25)))


def test_margin_from_the_reports_own_numbers() -> None:
    t = truth("single", effect(CF, "joint:j1"))
    gap = {"held_out": {"shrink": 0.8, "nominal": 2.0, "with_effect": 0.4, "runner_up": 1.2}}
    h = all_scores([Outcome(t, said("effect", named(CF, "joint:j1"), gap=gap))])["how_far"]
    assert h["margin_to_runner_up"]["median"] == pytest.approx(0.8 - 0.4)


def test_severity_curve_holds_every_world_once() -> None:
    worlds = [
        Outcome(truth("single", effect(CF, "joint:j1", s)), said("no_gap"))
        for s in (0.0, 0.2, 0.59, 0.8, 1.0)
    ]
    curve = all_scores(worlds)["severity_curve"]
    assert [c["detected"]["trials"] for c in curve] == [1, 1, 1, 0, 2]


def test_ambiguity_sets_cover_and_have_a_size() -> None:
    a = all_scores(single_set())["ambiguity"]
    assert (a["coverage"]["successes"], a["coverage"]["trials"], a["median_size"]) == (1, 1, 2.0)


def test_table_and_page_of_a_study_without_any_world() -> None:
    scores = all_scores([])
    assert {row.met for row in score_rows(scores)} == {None}
    assert "<html" in score_page(scores, [], {})


def test_page_is_self_contained_and_escapes_names() -> None:
    page = score_page(all_scores(single_set()), single_set(), {"commit": "<b>"})
    assert "&lt;b&gt;" in page
    assert "http" not in page.replace("http-equiv", "")
    assert page.count("data:image/png;base64,") == 6
