"""The scores as rows: what was measured, its interval, and the aim; for terminal and page alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ScoreRow:
    """One line of the table."""

    group: str
    name: str
    value: str
    interval: str
    cases: str
    aim: str = ""
    met: bool | None = None  # None: no aim, or nothing measured


@dataclass(frozen=True)
class Aim:
    """Target of a score."""

    least: float | None = None
    most: float | None = None

    def __str__(self) -> str:
        if self.least is not None and self.most is not None:
            return f"{self.least:.0%} to {self.most:.0%}"
        return f"≥ {self.least:.0%}" if self.least is not None else f"≤ {self.most or 0:.0%}"

    def met(self, value: float) -> bool:
        """Whether a value reaches it."""
        return (self.least is None or value >= self.least) and (self.most is None or value <= self.most)


def score_rows(scores: dict[str, Any]) -> list[ScoreRow]:
    """All scalar scores in reading order."""
    d, w, p, r = scores["detection"], scores["which"], scores["place"], scores["refusal"]
    h, i, t, a, c = (scores[k] for k in ("how_far", "intervals", "two_effects", "ambiguity", "calibration"))
    risk, time = scores["risk_coverage"], scores["runtime"]
    images = _image_rows(scores["tiles"], scores["bound"])
    rows = [
        _share("whether", "gap detected, single effects", d["single"]),
        _share("whether", "gap detected, severity from the median on", d["single_severe"], Aim(0.90)),
        _share("whether", "gap detected, outside the library", d["outside"]),
        _share("whether", "gap detected, two effects", d["double"]),
        _share("whether", "false alarms", d["false_alarms"], Aim(most=0.05)),
        _share("whether", "false alarms, background within tolerance", d["false_alarms_within_tolerance"]),
        _share("whether", "false alarms, background beyond tolerance", d["false_alarms_beyond_tolerance"]),
        _share("which", "family right", w["top1_family"]),
        _share("which", "family right, severity from the median on", w["top1_family_severe"], Aim(0.80)),
        _share("which", "family right, below the median", w["top1_family_weak"]),
        _share("which", "family and place right", w["top1_family_place"]),
        _share("which", "family and place right, severe", w["top1_family_place_severe"]),
        _share("which", "family among the first three", w["top3_family"]),
        _share("which", "family right among those named", w["among_named"]),
        _number("which", "family right, mean over families", w["macro_average"], percent=True),
        _share("where", "place right", p["place"], Aim(0.90)),
        _share("where", "strongest residual at the true joint", p["where_first_joint_effects"]),
        _share("where", "onset stated, switched-on effects", p["onset_found"]),
        _share("where", "onset within 0.5 s", p["onset_within_half_second"]),
        _number("where", "onset error, median [s]", p["onset_median_error_s"]),
        _share("where", "onset stated though always there", p["onset_claimed_on_steady"]),
        _share("no", "unknown refused", r["unknown_rejected"]),
        _share(
            "no", "unknown refused, at 5 % of known refused", r["unknown_rejected_at_5_percent"], Aim(0.80)
        ),
        _share("no", "unknown refused, outside the library", r["outside_rejected"]),
        _share("no", "unknown refused, family left out", r["left_out_rejected"]),
        _share("no", "unknown refused among gaps detected", r["unknown_rejected_among_seen"]),
        _share("no", "unknown named as something", r["unknown_named"]),
        _share("no", "known wrongly refused", r["known_refused"], Aim(most=0.05)),
        _number("no", "AUROC unknown against known", r["auroc"], Aim(0.90), percent=True),
        _number("no", "AUROC among gaps detected", r["auroc_among_seen"], percent=True),
        _number("no", "wrong among all named", risk["risk"], percent=True),
        _number("no", "mean risk over coverage", risk["mean_risk_over_coverage"], percent=True),
        _number("no", "calibration error of probabilities (ECE)", c["ece"], Aim(most=0.10), percent=True),
        _number("no", "Brier score of probabilities", c["brier"]),
        _spread("how far", "shrink, all single worlds", h["all"]["shrink"]),
        _spread("how far", "shrink, right name", h["named_right"]["shrink"]),
        _spread("how far", "shrink with the true effect", h["all"]["oracle_shrink"]),
        _spread("how far", "shrink over the true effect's, all", h["all"]["ratio"], Aim(0.85)),
        _spread("how far", "shrink over the true effect's, right name", h["named_right"]["ratio"], Aim(0.85)),
        _spread("how far", "shrink over the true effect's, wrong name", h["named_wrong"]["ratio"]),
        _number(
            "how far",
            "squared gap removed, over the true effects'",
            h["all"]["energy_ratio_pooled"],
            percent=True,
        ),
        _spread("how far", "margin to the runner-up", h["margin_to_runner_up"], Aim(0.20)),
        _share("how far", "95 % intervals hold the truth", i["coverage"], Aim(0.85, 0.99)),
        _number("how far", "parameter error, median", i["median_relative_error"], percent=True),
        *images,
        _share("two", "both families", t["both_families"], Aim(0.50)),
        _share("two", "both, with places", t["both_with_place"]),
        _share("two", "at least one", t["at_least_one"], Aim(0.90)),
        _share("two", "second effect claimed on singles", t["spurious_second_on_singles"]),
        _share("ambiguous", "verdict ambiguous", a["ambiguous"]),
        _share("ambiguous", "true cause in the set", a["coverage"], Aim(0.95)),
        _share("ambiguous", "true family in the set", a["coverage_family"]),
        _number("ambiguous", "size of the set, median", a["median_size"]),
        _number("time", "one world, median [s]", time.get("median_s")),
        _number("time", "one world, 95 % of them [s]", time.get("p95_s")),
    ]
    return rows


def _image_rows(tiles: dict[str, Any], bound: dict[str, Any]) -> list[ScoreRow]:
    """Of worlds of a camera; other worlds have none."""
    if not tiles["worlds"]:
        return []
    return [
        _number("images", "IoU of tiles, median", tiles["median"], Aim(0.5), percent=True),
        _share("images", "IoU of 0.5 or more", tiles["half"]),
        _share("images", "IoU of 0.5 or more, gaps detected", tiles["half_of_detected"]),
        _number("images", "error over the least deviation that noise allows, median", bound["error_median"]),
        _number("images", "stated deviation over the same, median", bound["stated_median"]),
    ]


def _share(group: str, name: str, s: dict[str, Any], aim: Aim | None = None) -> ScoreRow:
    cases = f"{s['successes']}/{s['trials']}"
    if s["value"] is None:
        return ScoreRow(group, name, "–", "", cases, str(aim or ""))
    interval = f"{s['ci95'][0]:.1%} – {s['ci95'][1]:.1%}"
    return ScoreRow(
        group,
        name,
        f"{s['value']:.1%}",
        interval,
        cases,
        str(aim or ""),
        aim.met(s["value"]) if aim else None,
    )


def _spread(group: str, name: str, s: dict[str, Any], aim: Aim | None = None) -> ScoreRow:
    if not s["n"]:
        return ScoreRow(group, name, "–", "", "0", str(aim or ""))
    low, high = s["median_ci95"]
    value = f"{s['median']:.1%} (mean {s['mean']:.1%})"
    return ScoreRow(
        group,
        name,
        value,
        f"{low:.1%} – {high:.1%}",
        str(s["n"]),
        str(aim or ""),
        aim.met(s["median"]) if aim else None,
    )


def _number(
    group: str, name: str, value: float | None, aim: Aim | None = None, percent: bool = False
) -> ScoreRow:
    if value is None:
        return ScoreRow(group, name, "–", "", "", str(aim or ""))
    text = f"{value:.1%}" if percent else f"{value:.3g}"
    return ScoreRow(group, name, text, "", "", str(aim or ""), aim.met(value) if aim else None)
