"""Reports of several days become series, whatever was named on which day."""

from __future__ import annotations

import json
from typing import Any

import pytest

from samrl_core.diagnosis.history.history import Day, History, history, in_order, wanted
from samrl_core.diagnosis.history.page import to_html, to_png

EFFECT = "coulomb_friction@joint:j1"


def entry(value: float, half: float = 0.02) -> dict[str, Any]:
    family, _, place = EFFECT.partition("@")
    estimate = {"value": value, "unit": "N m", "ci95": [value - half, value + half]}
    return {"family": family, "place": place, "probability": 0.9, "parameters": {"Fc": estimate}}


def day(k: int, value: float | None, robot: str = "arm", named: bool = True, time: bool = True) -> Day:
    effects = [entry(value)] if value is not None and named else []
    tracked = [entry(value)] if value is not None and not named else []
    report = {
        "verdict": "effect" if effects else "no_gap",
        "effects": effects,
        "tracked": tracked,
        "gap": {"held_out": {"shrink": 0.8 if effects else None}},
    }
    return Day(robot, f"day-{k}", 1.7e9 + 86400.0 * k if time else None, report, folder=f"{robot}/day-{k}")


def made(*values: float | None, named_from: float = 0.3) -> History:
    return history([day(k, v, named=v is None or v >= named_from) for k, v in enumerate(values)])


def test_a_step_between_unnamed_and_named_days_is_told() -> None:
    found = made(0.11, 0.10, 0.10, 0.50, 0.51, 0.50)
    (series,) = found.series
    (step,) = series.steps
    assert [p.day for p in series.between(step)] == ["day-2", "day-3"]
    assert [p.named for p in series.points] == [False] * 3 + [True] * 3
    content = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    (change,) = content["robots"]["arm"]["parameters"][0]["changes"]
    assert (change["after_day"], change["on_day"]) == ("day-2", "day-3")
    assert change["before"] == pytest.approx(0.10, abs=0.02) and change["after"] == pytest.approx(
        0.5, abs=0.02
    )


def test_robots_are_kept_apart_and_days_sorted_by_their_clock() -> None:
    days = in_order([day(2, 0.5), day(0, 0.5, "other"), day(1, 0.5)])
    assert [(d.robot, d.name) for d in days] == [("arm", "day-1"), ("arm", "day-2"), ("other", "day-0")]
    assert in_order([day(2, 0.5, time=False), day(1, 0.5)])[0].name == "day-2"  # order of the folders
    assert wanted(days) == {"arm": (EFFECT,), "other": (EFFECT,)}


def test_refused_days_and_missing_intervals_are_left_out_of_series() -> None:
    refused = Day("arm", "day-9", None, None, "no motion", "arm/day-9")
    unknown = day(1, 0.5)
    assert unknown.report is not None
    unknown.report["effects"][0]["parameters"]["Fc"]["ci95"] = None
    found = history([day(0, 0.5), unknown, refused])
    assert [p.day for p in found.series[0].points] == ["day-0"]
    assert found.as_dict()["robots"]["arm"]["days"][2]["verdict"] == "refused"


@pytest.mark.parametrize("time", [True, False])
def test_page_and_picture(time: bool) -> None:
    values = (0.11, 0.10, 0.10, 0.50, 0.51, 0.50)
    days = [day(k, v, "<b>arm", named=v > 0.3, time=time) for k, v in enumerate(values)]
    refused = Day("<b>arm", "day $9$", None if not time else 1.8e9, None, "no <motion>", "x")
    found = history([*days, refused])
    page = to_html(found)
    assert "<b>arm" not in page and "&lt;motion&gt;" in page and "day-2 and day-3" in page
    assert page.count("<svg") == 1 and 'href="%3Cb%3Earm/day-3/report.html"' in page
    assert to_png(found).startswith(b"\x89PNG\r\n")


def test_nothing_named_anywhere() -> None:
    found = history([day(0, None), day(1, None)])
    assert found.series == () and "No effect was named on any day" in to_html(found)
    assert to_png(found).startswith(b"\x89PNG\r\n")
