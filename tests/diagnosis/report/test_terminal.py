"""Ten lines, verdict first, and the same facts as the report."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import (
    BODY_EFFECTS,
    EFFECTS,
    FAMILIES,
    IMAGE_EFFECTS,
    POSE_EFFECTS,
    READING_EFFECTS,
    find_family,
)
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.report.html_report import to_html
from samrl_core.diagnosis.report.terminal import LINES, WIDTH, summary, tracked
from samrl_core.diagnosis.result import VERDICTS, ParameterEstimate
from tests.diagnosis.report import samples

FILES = ("report.json", "report.html", "summary.png")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_at_most_ten_lines_that_fit(verdict: str) -> None:
    lines = summary(samples.diagnosis(verdict), FILES)
    assert 3 <= len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert lines[0].startswith(words.VERDICT_LABEL[verdict].upper())
    assert all(name in lines[-1] for name in FILES)


def test_everything_at_once_still_fits() -> None:
    d = samples.diagnosis("ambiguous")
    long = "x" * 300
    many = replace(
        d, effects=d.effects * 3, alarms=(long, long), nearest=samples.DELAY, reasons=(f"{long}\n{long}",)
    )
    lines = summary(replace(many, verdict="effect"), FILES)
    assert len(lines) == LINES and max(map(len, lines)) <= WIDTH
    assert not any("\n" in line for line in lines)
    assert lines[-1].endswith("summary.png")


def test_the_effect_is_named_with_its_parameters_and_how_far() -> None:
    text = "\n".join(summary(samples.diagnosis("effect")))
    assert "Coulomb friction at joint panda_joint4" in text
    assert "coulomb_friction@joint:panda_joint4, probability 97 %: Fc = 0.412 ± 0.031 N m" in text
    assert "shrinks by 83 % (79 to 86 %); +29 points on the runner-up" in text
    assert "8 % of the excess energy remains with the named effect, 17 % of the held-out gap" in text


def test_where_nothing_is_named_no_gap_grows_by_it() -> None:
    """Two trackers in order read that their held-out gap grows by 59 %: by an effect that nobody named."""
    effect = samples.diagnosis("effect")
    assert effect.gap is not None
    lines = "\n".join(summary(replace(samples.diagnosis("no_gap"), gap=effect.gap)))
    assert "how far" in lines and "on held-out recordings" in lines
    assert "shrinks" not in lines and "runner-up" not in lines


def test_an_error_of_the_description_is_said_with_what_it_leaves() -> None:
    """A limit that was a placeholder was the cause, and of a load beside it only the page spoke."""
    said = (
        "this log fits if no torque is limited to 1.5 N m of pan",
        "beside it there is a gap: a load",
        "more",
    )
    text = "\n".join(summary(replace(samples.diagnosis("effect"), reasons=said)))
    assert all(reason in text for reason in said[:2]) and said[2] not in text
    assert "beside it there" not in "\n".join(summary(samples.diagnosis("effect")))


def test_what_remains_is_never_nothing_and_never_of_the_torque_alone() -> None:
    """Three effects left 81 % of a hobby arm's held-out gap, and nothing unexplained."""
    d = samples.diagnosis("effect")
    assert d.gap is not None
    left = replace(d, unexplained_fraction=0.0, gap=replace(d.gap, shrink=0.19))
    text = " ".join(" ".join(summary(left)).split())
    assert "< 1 % of the excess energy remains with the named effect, 81 % of the held-out gap" in text


@pytest.mark.parametrize(
    ("value", "said"), [(1.0, "> 99 %"), (0.9999, "> 99 %"), (0.97, "97 %"), (0.0, "< 1 %")]
)
def test_no_probability_is_a_certainty(value: float, said: str) -> None:
    d = samples.diagnosis("effect")
    sure = replace(d, effects=(replace(d.effects[0], probability=value),))
    assert f"probability {said}" in "\n".join(summary(sure))


def test_a_cause_below_one_half_is_named_beside_its_rivals() -> None:
    d = samples.diagnosis("effect")
    rivals = tuple(replace(r, probability=0.04) for r in d.runner_ups)
    text = "\n".join(
        summary(replace(d, effects=(replace(d.effects[0], probability=0.27),), runner_ups=rivals))
    )
    assert "probability 27 % among all that were tried, no rival's above 4 %:" in " ".join(text.split())


def test_an_ambiguous_gap_shows_the_set_and_the_next_recording() -> None:
    text = " ".join(" ".join(summary(samples.diagnosis("ambiguous"))).split())
    # Each with the size that it would have.
    assert re.search(r"Backlash at joint panda_joint4 \(.+ ± .+\) or Joint elasticity at", text)
    assert "samrl excite next.yaml" in text
    assert "which" not in text  # nothing is named


def test_what_is_there_beside_the_candidates_is_shown_with_its_size() -> None:
    """A late camera or a clock, and in either case a camera that sits elsewhere."""
    d = samples.diagnosis("ambiguous")
    both = replace(d, effects=(*d.effects, replace(samples.DELAY, role="secondary")))
    text = " ".join(" ".join(summary(both)).split())
    assert f"beside it {words.effect(samples.DELAY.name)} ({words.parameters(samples.DELAY)})" in text
    assert words.parameters(samples.DELAY) in to_html(both)
    assert "no recording is known that decides" in to_html(replace(both, next_experiment=None))
    assert "beside it" not in " ".join(summary(d))


def test_files_of_one_folder_are_named_behind_it() -> None:
    """Whole paths of three files were cut off before the report's name."""
    folder = "/data/cells/panda/2026-11-02/afternoon/report"
    text = summary(samples.diagnosis("effect"), [f"{folder}/report.json", f"{folder}/report.html"])[-1]
    assert text.endswith(f"in {folder}: report.json, report.html")


def test_an_unknown_gap_names_nothing_and_warns_of_the_nearest() -> None:
    text = "\n".join(summary(samples.diagnosis("none_of_mine")))
    assert "Command delay at arm tool_arm, but it would be wrong" in text
    assert "repeats 12.0 times per turn (+0.81)" in text


def test_why_nothing_is_named_is_said_once_and_whole() -> None:
    """An alarm that is the reason stood there twice, and both times without its end."""
    there = "1.01 times its fitted size at a commanded effort of -18 N m, "
    why = f"it would have {there * 2}and 2.4 times here"
    d = replace(samples.diagnosis("none_of_mine"), reasons=(why,), alarms=(why,))
    text = " ".join(" ".join(summary(d, FILES)).split())
    assert text.count(why) == 1 and " alarm " not in text
    assert "  alarm        another" in summary(replace(d, alarms=(why, "another")), FILES)


@pytest.mark.parametrize(
    ("shrink", "ci95", "said"),
    [
        (0.83, (0.79, 0.86), "held-out gap shrinks by 83 % (79 to 86 %)"),
        (-0.004, (-0.25, 0.225), "held-out gap does not shrink (95 % interval of its shrink -25 to 22 %)"),
        (-0.07, (-0.2, -0.001), "held-out gap grows by 7 % (95 % interval of its shrink -20 to 0 %)"),
    ],
)
def test_a_gap_that_stays_is_not_said_to_shrink(shrink: float, ci95: tuple[float, float], said: str) -> None:
    """`shrinks by -0 %` was read as a success by who skims it."""
    d = samples.diagnosis("effect")
    assert d.gap is not None
    assert said in "\n".join(summary(replace(d, gap=replace(d.gap, shrink=shrink, ci95=ci95))))


def test_a_gap_that_would_not_shrink_anyway_is_said_so() -> None:
    """A cause found and a gap that stays contradict each other for who does not read the report."""
    said = "the gap does not shrink for sure, nor would it were it all there is"
    d = samples.diagnosis("effect")
    assert "  but " not in "\n".join(summary(d))
    assert f"  but          {said}" in summary(replace(d, reasons=(*d.reasons, said)))


def test_a_size_that_was_asked_for_is_shown() -> None:
    """`--track` was heard, and answered in report.json alone."""
    assert tracked(samples.diagnosis("effect")) == []
    asked = replace(samples.diagnosis("effect"), tracked=(samples.DELAY,))
    (line,) = tracked(asked)
    (why,) = tracked(replace(samples.diagnosis("effect"), notes=("other", "x@y is not tracked: no place")))
    assert why == "  note         x@y is not tracked: no place"
    assert line.split()[:2] == ["tracked", "command_delay@arm:tool_arm:"] and "=" in line


@pytest.mark.parametrize(
    ("estimate", "shown"),
    [
        (ParameterEstimate(0.412, "N m", (0.381, 0.443)), "0.412 ± 0.031 N m"),
        (ParameterEstimate(8200.0, "N m/rad", (7100.0, 9400.0)), "8200 ± 1150 N m/rad"),
        (ParameterEstimate(-3e-9, "s", (-4e-9, -2e-9)), "-3e-09 ± 1e-09 s"),
        (ParameterEstimate(1.5, "", (1.5, 1.5)), "1.5"),
        (ParameterEstimate(2e-4, "1", (1.993e-4, 2.007e-4)), "200.00 ± 0.70 ppm"),
        (ParameterEstimate(2.0, "1", (float("-inf"), float("inf"))), "2"),
        (ParameterEstimate(2.0, "s", (float("-inf"), float("inf"))), "2 s"),
        # A load at the edge of what is possible was `0.007 ± 0.027`, a negative mass.
        (ParameterEstimate(0.007, "kg", (0.006, 0.060)), "0.007 [0.006, 0.060] kg"),
        (ParameterEstimate(0.39, "1", (0.1, 0.41)), "0.39 [0.10, 0.41]"),
        (ParameterEstimate(0.05, "s", (0.1, 0.3)), "0.05 [0.10, 0.30] s"),
        (ParameterEstimate(5e6, "N/m", (4.9e6, 6e6)), "5e+06 [4900000, 6000000] N/m"),
    ],
)
def test_digits_follow_the_interval(estimate: ParameterEstimate, shown: str) -> None:
    assert words.parameter(estimate) == shown
    number, unit = shown.split()[0], words.symbol(estimate.unit)
    assert words.value(estimate) in (f"{number} {unit}".rstrip(), f"{number} ppm")


@pytest.mark.parametrize(
    ("fraction", "shown"), [(0.999, "> 99 %"), (0.001, "< 1 %"), (0, "0 %"), (1, "100 %"), (None, "–")]
)
def test_per_cent_never_rounds_to_certainty(fraction: float | None, shown: str) -> None:
    assert words.percent(fraction) == shown


def test_every_family_of_the_catalogue_is_explained() -> None:
    assert sorted(f.number for f in FAMILIES.values()) == list(range(1, len(FAMILIES) + 1))
    readme = (Path(words.__file__).parents[3] / "README.md").read_text()
    assert f"{len(EFFECTS)} of {len(FAMILIES)} known families of effects" in readme
    elsewhere = {e.family for e in (*POSE_EFFECTS, *BODY_EFFECTS, *READING_EFFECTS)}
    by_images = {e.family for e in IMAGE_EFFECTS} - elsewhere - {e.family for e in EFFECTS}
    assert "images of a known scene four" in readme and len(by_images) == 4
    assert "ten more" in readme and len(elsewhere - {e.family for e in EFFECTS}) == 10
    for name, f in FAMILIES.items():
        assert f.family == name and f.title[0].isupper()
        assert f.meaning.endswith(".") and f.remedy.endswith(".") and len(f.meaning) < 120
    with pytest.raises(InputError, match="unknown family of effects 'gremlins'"):
        find_family("gremlins")
