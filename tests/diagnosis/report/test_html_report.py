"""report.html stands alone, escapes what it shows, and stays small; summary.png is a picture."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import BODY_EFFECTS
from samrl_core.diagnosis.report.figures import (
    OVERLAY_COUNT,
    OVERLAY_POINTS,
    SCALE,
    STRIP_WINDOWS,
    cell_tone,
    decimated,
    heat_tone,
    rms,
    shown_samples,
    timeline_figure,
)
from samrl_core.diagnosis.report.html_report import to_html
from samrl_core.diagnosis.report.json_report import read_report
from samrl_core.diagnosis.report.summary_picture import to_png
from samrl_core.diagnosis.report.words import grouped
from samrl_core.diagnosis.report.write_report import write_report
from samrl_core.diagnosis.result import (
    VERDICTS,
    Diagnosis,
    FamilyWords,
    Heatmap,
    NamedEffect,
    ParameterEstimate,
    Timeline,
)
from tests.diagnosis.report import samples

EVIL = "<script>alert(1)</script>\"'&$"
LOADING = {"src", "href", "srcset", "data", "action", "poster", "background", "formaction"}


class Page(HTMLParser):
    """Tags, what they would load, and the content of script elements by id."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.loads: list[str] = []
        self.scripts: dict[str, str] = {}
        self.text = ""
        self.ids: set[str] = set()
        self._script: str | None = None
        self._open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        values = dict(attrs)
        self.ids |= {values["id"] or ""} if "id" in values else set()
        self.loads += [value or "" for name, value in attrs if name in LOADING]
        assert not any(name.startswith("on") for name, _ in attrs)
        if tag == "script":
            self._script = values.get("id") or "main"
            self.scripts[self._script] = ""
        if tag not in ("meta", "link", "br", "img", "col"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, f"</{tag}> closes something else"
        if tag == "script":
            self._script = None

    def handle_data(self, data: str) -> None:
        if self._script is not None:
            self.scripts[self._script] += data
        else:
            self.text += data


@cache
def page_of(verdict: str) -> str:
    return to_html(samples.diagnosis(verdict))


@cache
def evil() -> Diagnosis:
    d = samples.diagnosis("ambiguous")
    o, w, t = d.overlays[0], d.where[0], d.timelines[0]
    place = f"joint:{EVIL}"
    assert d.next_experiment is not None and d.heatmap is not None
    return replace(
        d,
        arm=EVIL,
        version=EVIL,
        reasons=(EVIL,),
        alarms=(EVIL,),
        notes=(EVIL,),
        where=(replace(w, place=place, recording=EVIL, channel=EVIL),),
        effects=(replace(d.effects[0], place=place, form=EVIL),),
        ambiguity_set=((f"backlash@{place}", f"{EVIL}@{place}"),),
        next_experiment=replace(d.next_experiment, why=EVIL, file="next.yaml", programme={"name": EVIL}),
        not_testable={EVIL: EVIL},
        inputs=(replace(d.inputs[0], bag=EVIL),),
        heatmap=replace(d.heatmap, places=(place, *d.heatmap.places[1:])),
        timelines=(replace(t, recording=EVIL, energy={place: t.energy[samples.PLACES[0]]}, onset=3.0),),
        curves=(
            replace(
                samples.friction_curve(np.random.default_rng(0)), effect=f"backlash@{place}", x_label=EVIL
            ),
        ),
        overlays=(replace(o, recording=EVIL, joint=EVIL, quantity=EVIL, unit=EVIL),),
        couplings=((EVIL, EVIL, EVIL, 0.5),),
        settings={EVIL: EVIL},
        timings={EVIL: 1.0},
    )


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_is_whole_and_loads_nothing(verdict: str) -> None:
    text = page_of(verdict)
    page = Page(text)
    assert page._open == []
    assert [load for load in page.loads if not load.startswith("data:")] == []
    assert not re.search(r"url\(|@import|https?://", re.sub(r'id="library">[^<]*', "", text))
    assert "default-src 'none'" in text
    assert page.tags.count("h1") == 1
    assert len(text.encode()) < 6_000_000


def test_the_plot_library_unpacks_to_itself() -> None:
    packed = Page(page_of("effect")).scripts["library"]
    assert "plotly.js v" in gzip.decompress(base64.b64decode(packed))[:200].decode()


def test_names_cannot_break_out() -> None:
    text = to_html(evil(), to_png(evil()))
    page = Page(text)
    assert "<script>alert" not in text
    # Beside data there are two scripts, whatever the names hold: the library and the page's own.
    data = [i for i in page.scripts if i not in ("library", "main")]
    assert page.tags.count("script") == len(data) + 2
    assert text.count("alert(1)") > 15
    for name in data:
        json.loads(page.scripts[name])
        # What plotly draws, it reads as HTML of its own kind, so there names are escaped twice.
        if name != "overlay-index":
            assert "<script" not in page.scripts[name].replace("\\u003c", "<")
    assert EVIL in page.text  # and people see the name as it is


def test_a_free_body_has_no_arm_to_level() -> None:
    """Families that several kinds of recordings show were explained as of an arm, whatever was recorded."""
    size = {"ax": ParameterEstimate(0.02, "rad", (0.015, 0.025))}
    tilt = NamedEffect("base_tilt", "cell", 0.99, size, 40.0)
    told = {e.family: FamilyWords(e.meaning, e.remedy, e.explained) for e in BODY_EFFECTS}
    d = replace(samples.diagnosis("effect"), effects=(tilt,), told=told)
    for page in (to_html(d), to_html(replace(d, verdict="ambiguous", ambiguity_set=(("base_tilt@cell",),)))):
        assert "bodies from another direction" in page and "about the track" in page
        assert "The arm stands" not in page and "about the base" not in page and "controller to" not in page


def test_facts_stand_in_the_page() -> None:
    text = Page(page_of("effect")).text
    headline = "Coulomb friction at joint panda_joint4 causes the gap"
    figures = ("83 %", "79 to 86 %", "0.412 ± 0.031 N m", "Stribeck friction")
    for fact in (headline, *figures, "What to do", "c" * 64, "3 samples with a repeated stamp", "no images"):
        assert fact in text
    ambiguous = Page(page_of("ambiguous")).text
    assert "samrl excite next.yaml" in ambiguous and "from_hz: 1.0" in ambiguous
    unknown = Page(page_of("none_of_mine")).text
    assert "it would be wrong" in unknown and "repeats 12.0 times per turn" in unknown and "Alarms" in unknown


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_figure_has_its_data_and_every_overlay_its_entry(verdict: str) -> None:
    d = samples.diagnosis(verdict)
    text = page_of(verdict)
    page = Page(text)
    wanted = re.findall(r'data-figure="([^"]+)"', text)
    assert len(wanted) == len(d.timelines) + len(d.curves) and set(wanted) <= set(page.scripts)
    if d.overlays:
        index = json.loads(page.scripts["overlay-index"])
        assert {entry["id"] for entry in index} <= set(page.scripts) and len(index) == len(d.overlays)
        assert ("overlay" in page.ids) and {"pick-recording", "pick-joint", "pick-quantity"} <= page.ids


def test_the_worst_signal_of_the_named_joint_comes_first() -> None:
    page = Page(page_of("effect"))
    assert json.loads(page.scripts["overlay-index"])[0]["key"][:2] == [samples.HELD_OUT, "panda_joint4"]


@pytest.mark.thorough
def test_many_long_recordings_stay_below_six_megabytes() -> None:
    d = samples.diagnosis("effect")
    copies = tuple(replace(o, recording=f"c{i}.mcap") for i in range(20) for o in d.overlays)
    text = to_html(replace(d, overlays=copies))
    assert len(copies) > OVERLAY_COUNT
    assert len(text.encode()) < 6_000_000
    assert f"{len(copies) - OVERLAY_COUNT} signals with smaller errors are left out" in text


def test_thinning_keeps_spikes() -> None:
    o = samples.overlays(np.random.default_rng(0))[0]
    measured, nominal = o.measured.copy(), o.nominal.copy()
    measured[12_345], nominal[6_789] = 50.0, -70.0
    spiky = replace(o, measured=measured, nominal=nominal)
    keep = decimated(spiky, OVERLAY_POINTS)
    assert {12_345, 6_789, 0, len(o.time) - 1} <= set(keep.tolist())
    assert len(keep) <= OVERLAY_POINTS + 2 and (np.diff(keep) > 0).all()


def test_windows_are_joined_by_no_line() -> None:
    o = samples.overlays(np.random.default_rng(0))[0]
    there = np.concatenate([np.arange(0, 400), np.arange(5000, 5400), np.arange(9000, 9400)])
    parts = {name: getattr(o, name)[there] for name in ("time", "measured", "nominal")}
    windows = replace(o, with_effect=None, runner_up=None, **parts)
    for points in (OVERLAY_POINTS, 100):
        shown = shown_samples(windows, points)
        breaks = np.flatnonzero(np.isnan(shown(windows.time)))
        assert len(breaks) == 2 and np.isnan(shown(windows.nominal)[breaks]).all()
        before, after = shown(windows.time)[breaks - 1], shown(windows.time)[breaks + 1]
        assert (before <= o.time[[399, 5399]]).all() and (after >= o.time[[5000, 9000]]).all()
    assert not np.isnan(shown_samples(o, 100)(o.time)).any()


def test_signals_with_gaps_are_drawn_and_measured() -> None:
    d = samples.diagnosis("effect")
    o = d.overlays[0]
    measured = o.measured.copy()
    measured[100:5000] = np.nan
    holed = replace(o, measured=measured)
    assert rms(holed.nominal, measured) == pytest.approx(rms(o.nominal[5000:], o.measured[5000:]), rel=0.05)
    assert np.isnan(rms(None, measured)) and np.isnan(rms(o.nominal, np.full(len(measured), np.nan)))
    Page(to_html(replace(d, overlays=(holed,))))


def test_tones_begin_at_the_threshold() -> None:
    tones = [cell_tone(v, 2.0) for v in (0.1, 1.6, 1.999, 2.0, 4.0, 40.0, 1e9)]
    assert tones == sorted(tones) and tones[2] < 2 <= tones[3]


def test_tones_reach_as_far_as_the_picture_does() -> None:
    tones = [cell_tone(v, 1.0, 1000.0) for v in (1.0, 10.0, 100.0, 999.9, 1000.0)]
    assert tones == sorted(tones) and len(set(tones)) >= 4 and tones[-1] == len(SCALE) - 1


def drawn_strip(line: Timeline, named: set[str], tone: Callable[[float], int]) -> Any:
    """The heatmap trace of a timeline."""
    return timeline_figure(line, named, tone).data[0]


def test_over_time_has_the_tones_of_the_table() -> None:
    table = Heatmap(("joint:a",), (("link", "slow"),), np.array([[40.0]]), 2.0)
    line = Timeline("r", np.arange(3.0), {"joint:a": np.array([0.1, 2.0, 40.0])}, 5.0)
    drawn = drawn_strip(line, {"joint:a"}, heat_tone(table))
    assert list(drawn.z[0]) == [0, 2, len(SCALE) - 1]
    assert list(drawn.y) == ["<b>a</b>"] and list(drawn.customdata[0]) == pytest.approx([0.1, 2.0, 40.0])


def test_a_long_recording_keeps_its_highest_windows() -> None:
    energy = np.ones(5000)
    energy[4321] = 9.0
    line = Timeline("r", 0.25 * np.arange(5000), {"joint:a": energy}, 2.0)
    drawn = drawn_strip(line, set(), lambda v: int(v > 2))
    row = drawn.z[0]
    assert len(drawn.x) == len(row) <= STRIP_WINDOWS and sum(row) == 1
    at = float(drawn.x[int(np.argmax(row))])
    assert at <= 0.25 * 4321 < at + 0.25 * (5000 // STRIP_WINDOWS + 1)


def test_sentences_of_one_kind_share_a_bullet() -> None:
    alike = [f"viscous_friction@joint:j{i}: Fv ended on the bound of its search" for i in range(40)]
    gains = ["backlash@joint:j1 gains 12.5 of evidence", "cable@arm:tool_arm gains 1e+03 of evidence"]
    found = grouped([*alike, *gains, "something else"])
    assert [(first, len(more)) for first, more in found] == [
        (alike[0], 39),
        (gains[0], 1),
        ("something else", 0),
    ]
    page = to_html(replace(samples.diagnosis("none_of_mine"), reasons=tuple(alike)))
    assert "and 39 more of this kind" in page and page.count("Fv ended on the bound") == 40


@pytest.mark.parametrize(
    ("shrink", "unexplained", "says"),
    [(0.8, 0.04, "Both agree"), (0.2, 0.01, "adds up in motion"), (0.95, 0.6, "hardly shows it")],
)
def test_shrink_and_unexplained_are_read_together(shrink: float, unexplained: float, says: str) -> None:
    d = samples.diagnosis("effect")
    assert d.gap is not None
    page = to_html(replace(d, gap=replace(d.gap, shrink=shrink), unexplained_fraction=unexplained))
    assert says in page and "Two measures of what is left" in page
    assert "Two measures" not in to_html(replace(d, unexplained_fraction=float("nan")))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_picture_is_a_png(verdict: str) -> None:
    picture = to_png(samples.diagnosis(verdict))
    assert picture.startswith(b"\x89PNG\r\n") and 5_000 < len(picture) < 600_000


def test_all_files_are_written_together(tmp_path: Path) -> None:
    paths = write_report(samples.diagnosis("ambiguous"), tmp_path / "out")
    assert [p.name for p in paths] == ["report.json", "report.html", "summary.png", "next.yaml"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(p.name for p in paths)
    assert read_report(paths[0])["next_experiment"]["file"] == "next.yaml"


@pytest.mark.parametrize("name", ["/etc/next.yaml", "../next.yaml", "a/b.yaml"])
def test_a_next_experiment_elsewhere_is_refused(name: str, tmp_path: Path) -> None:
    d = samples.diagnosis("ambiguous")
    assert d.next_experiment is not None
    with pytest.raises(InputError, match="plain name"):
        write_report(replace(d, next_experiment=replace(d.next_experiment, file=name)), tmp_path)
    assert list(tmp_path.iterdir()) == []
